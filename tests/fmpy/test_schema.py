"""`fmu check` beside the official schemas, which come with FMPy: descriptions with one mutation each, and what both find.

Every seventh mutation; `SCHEMA_SHARE=1` takes all of them, in two minutes.
"""

import copy
import io
import itertools
import json
import os
import subprocess
import zipfile
from pathlib import Path

import fmpy
import pytest
from lxml import etree

SCHEMAS = Path(fmpy.__file__).parent / "schema"
# Valid documents with every element and attribute.
FOLDER = Path(__file__).parent / "schema"
NUMBERS = ["Float32", "Float64", *[f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")]]


VALUES = ["", "abc", "-1", "0", "1.5", "NaN", "1e400", " 1 ", "1 2", "true", "True", "exact", "discrete", "input", "FF", "F"]
WORDS = ["true", "false", "flat", "local", "input", "continuous", "discrete", "exact", "constant", "dependent", "00ff"]
DATES = ["2026-02-30T00:00:00Z", "2026-02-28", "2024-02-29T24:00:00.0+14:00"]
# The ends of the integers with and without a sign.
EDGES = [str(edge) for bits in (8, 16, 32, 64) for edge in (2**bits - 1, 2**bits)]
EDGES += [str(edge) for bits in (7, 15, 31, 63) for edge in (2**bits - 1, 2**bits, -(2**bits), -(2**bits) - 1)]


def values(text):
    """Other values of an attribute: many for a number or a word of a list, few for a name."""
    first = text.split()[0]
    if first.lstrip("-").isdigit():
        return VALUES + EDGES
    if text.startswith("2026"):
        return VALUES + DATES
    return VALUES if first in WORDS or "." in first or "e-" in first else VALUES[:2]


def kinds(root):
    """One element for each path of two names, and its attributes that no such element before it has."""
    seen = set()
    for element in root.iter():
        parents = [ancestor.tag for ancestor in element.iterancestors()]
        # Inside an annotation, everything is allowed.
        if {"Annotation", "Tool"} & set(parents):
            continue
        kind = (*parents[:1], element.tag)
        # The types of numbers differ in their values alone.
        is_number = element.tag.removesuffix("Type") in NUMBERS
        common = (*parents[:1], "number") if is_number else kind
        keys = {name: (kind if name in {"min", "max", "start"} else common, name) for name in element.attrib}
        attributes = [name for name, key in keys.items() if key not in seen]
        if kind not in seen or attributes:
            yield element, kind not in seen, attributes
        seen |= {kind, *keys.values()}


def mutations(document):
    """Descriptions with one mutation each, and what it is."""
    root = etree.fromstring(document)

    def mutate(element, change):
        tree = copy.deepcopy(root)
        (target,) = tree.xpath(root.getroottree().getpath(element))
        change(target)
        return etree.tostring(tree, encoding="UTF-8", xml_declaration=True)

    def swap(element):
        other = next(iter(s for s in element.itersiblings() if s.tag != element.tag))
        other.addnext(element)

    structure = {
        "text": lambda e: setattr(e, "text", (e.text or "") + "text"),
        "a line break": lambda e: setattr(e, "text", (e.text or "") + "\n"),
        "an attribute": lambda e: e.set("color", "red"),
        "an attribute with a prefix": lambda e: e.set("{urn:x}color", "red"),
        "a child": lambda e: etree.SubElement(e, "Color"),
        "a child with a prefix": lambda e: etree.SubElement(e, "{urn:x}Color"),
    }
    inner = {
        "another name": lambda e: setattr(e, "tag", e.tag + "x"),
        "a namespace": lambda e: setattr(e, "tag", "{urn:x}" + e.tag),
        "removed": lambda e: e.getparent().remove(e),
        "twice": lambda e: e.addnext(copy.deepcopy(e)),
    }
    for element, is_new, attributes in kinds(root):
        path = root.getroottree().getpath(element)
        if is_new:
            changes = structure | (inner if element is not root else {})
            if any(s.tag != element.tag for s in element.itersiblings()):
                changes = changes | {"moved": swap}
            for what, change in changes.items():
                yield f"{path}: {what}", mutate(element, change)
        for name in attributes:
            yield f"{path}: no {name}", mutate(element, lambda e, name=name: e.attrib.pop(name))
            for value in values(element.get(name)):
                yield f"{path}: {name}={value!r}", mutate(element, lambda e, name=name, value=value: e.set(name, value))


# Where the text of the standard demands more than its schema, by parts of what is mutated.
STRICTER = [
    "fmiVersion=",
    "/Dimension",
    "Start: no value",
    "defaultConnectionColor",
    "modelIdentifier=",
    "ariableName=",
    "SourceFile: name=",
]
STRICTER += ["maxSize='18446744073709551616'"]


@pytest.mark.parametrize(
    ("standard", "own", "file", "schema", "checks"),
    [
        ("fmi2", "fmi2.xml", "modelDescription.xml", "fmi2ModelDescription", "X01a,X01b"),
        ("fmi3", "fmi3.xml", "modelDescription.xml", "fmi3ModelDescription", "X01a,X01b"),
        ("fmi3", "terminalsAndIcons.xml", "terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons", "I01"),
        ("fmi3", "buildDescription.xml", "sources/buildDescription.xml", "fmi3BuildDescription", "Z08"),
    ],
)
def test_the_checker_finds_what_the_schema_finds(tmp_path, standard, own, file, schema, checks):
    validator = etree.XMLSchema(etree.parse(SCHEMAS / standard / f"{schema}.xsd"))
    document = (FOLDER / own).read_bytes()
    assert validator.validate(etree.fromstring(document)), validator.error_log
    share = int(os.environ.get("SCHEMA_SHARE", "7"))
    cases = {"plain": (document, True)}
    for what, mutated in itertools.islice(mutations(document), 0, None, share):
        cases[what] = (mutated, validator.validate(etree.parse(io.BytesIO(mutated))))
    for k, (document, _) in enumerate(cases.values()):
        entries = {
            "modelDescription.xml": (FOLDER / "fmi3.xml").read_bytes(),
            "sources/a.c": "",
            "terminalsAndIcons/t.png": "",
            file: document,
        }
        with zipfile.ZipFile(tmp_path / f"{k}.fmu", "w") as archive:
            for name, content in entries.items():
                archive.writestr(name, content)
    files = [f"{k}.fmu" for k in range(len(cases))]
    command = [os.environ["FMU_COMMAND"], "check", *files, "--only", checks, "--format", "json"]
    output = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    reports = {report["file"]: report["findings"] for report in json.loads(output.stdout)}
    missed, strict = [], []
    for k, (what, (_, valid)) in enumerate(cases.items()):
        # A file that the command refuses is named in its error.
        found = f"{k}.fmu" not in reports or any(f["verdict"] == "violated" for f in reports[f"{k}.fmu"])
        if not valid and not found:
            missed.append(what)
        if valid and found and not any(part in what for part in STRICTER):
            strict.append((what, [f["evidence"] for f in reports.get(f"{k}.fmu", [])]))
    print(f"{own}: {len(cases)} descriptions, {sum(not valid for _, valid in cases.values())} invalid")
    assert not missed, "not found:\n" + "\n".join(missed)
    assert not strict, f"found in valid ones:\n{strict}"
