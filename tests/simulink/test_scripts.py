"""Every function that fmu simulink writes: MISS_HIT's parser of MATLAB, the functions of docs/simulink.md, names and ports."""

import os
import pathlib
import re
import zipfile
from xml.etree import ElementTree

import pytest
from miss_hit_core.config import Config
from miss_hit_core.errors import Message_Handler
from miss_hit_core.m_language import MATLAB_Latest_Language
from miss_hit_core.m_lexer import MATLAB_Lexer
from miss_hit_core.m_parser import MATLAB_Parser

FOLDERS = sorted(pathlib.Path(os.environ["SIMULINK_FOLDERS"]).iterdir())
SCRIPTS = [path for folder in FOLDERS for path in sorted(folder.glob("*.m"))]
PAGE = (pathlib.Path(__file__).parents[2] / "docs/simulink.md").read_text()
# The first column of the page's table of functions.
DOCUMENTED = set(re.findall(r"`([\w.]+)`", "\n".join(row.split("|")[1] for row in PAGE.splitlines() if row.startswith("| `"))))
WORDS = "function end if for else in numel".split()


def strings(line):
    """A line without its strings and comment, and its strings."""
    rest, found, at = "", [], 0
    while at < len(line):
        if line[at] == "%":
            break
        if line[at] == "'" and not re.search(r"[\w)\]}']$", rest):
            match = re.compile(r"'((?:[^']|'')*)'").match(line, at)
            assert match, f"open string: {line}"
            found.append(match[1].replace("''", "'"))
            rest, at = rest + "''", match.end()
            continue
        rest, at = rest + line[at], at + 1
    return rest, found


def code(path):
    return [strings(line)[0] for line in path.read_text().splitlines()]


def identify(path):
    return f"{path.parent.name}/{path.name}"


@pytest.mark.parametrize("path", SCRIPTS, ids=identify)
def test_the_parser_takes_it(path):
    messages = Message_Handler("debug")
    messages.register_file(str(path))
    language = MATLAB_Latest_Language()
    lexer = MATLAB_Lexer(language, messages, path.read_text(), str(path))
    assert MATLAB_Parser(messages, lexer, Config()).parse_file() is not None
    assert messages.errors == 0


@pytest.mark.parametrize("path", SCRIPTS, ids=identify)
def test_lines_brackets_and_names(path):
    text = path.read_text()
    assert all(len(line) <= 120 for line in text.splitlines())
    whole = "\n".join(code(path))
    for opening, closing in ("()", "[]", "{}"):
        assert whole.count(opening) == whole.count(closing), opening
    assert all(len(name) <= 63 for name in re.findall(r"[A-Za-z]\w*", whole))
    assert re.match(r"function (?:p = )?(\w+)\(\)", text)[1] == path.stem


@pytest.mark.parametrize("path", SCRIPTS, ids=identify)
def test_it_calls_documented_functions_alone(path):
    whole = re.sub(r"\.\.\.\n", " ", "\n".join(code(path)))
    own = set(re.findall(r"^function (?:\w+ = )?(\w+)", whole, re.M))
    variables = set(re.findall(r"^\s*(?:for )?(\w+)(?:\.\w+|\(\w+\))? = ", whole, re.M))
    variables |= set(re.findall(r"\w+", " ".join(re.findall(r"^function [^(]*\(([^)]*)\)", whole, re.M))))
    called = set(re.findall(r"(?<![\w.])([A-Za-z][\w.]*)\(", whole))
    # A method of an object counts by its last name.
    methods = {name.rsplit(".", 1)[1] for name in called if "." in name and name.split(".")[0] in variables}
    called = {name for name in called if name.split(".")[0] not in variables} | methods
    siblings = {other.stem for other in path.parent.glob("*.m")}
    assert called <= DOCUMENTED | own | siblings | set(WORDS), called - DOCUMENTED - own
    # Every other word is a variable, a property or a keyword.
    used = set(re.findall(r"(?<![\w.'])([A-Za-z]\w*)", whole)) - {name.split(".")[0] for name in called}
    known = variables | own | siblings | set(WORDS) | {"Simulink", "simscape", "p", "true", "false", "NaN", "Inf"}
    assert used <= known, used - known


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_each_port_and_parameter_is_that_of_the_fmu(folder):
    archive = next(folder.glob("*.fmu"))
    root = ElementTree.fromstring(zipfile.ZipFile(archive).read("modelDescription.xml"))
    variables = [v for v in root.find("ModelVariables") if v.get("name")]
    build = next(folder.glob("build_*.m")).read_text()
    count = {way: sum(v.get("causality") == way for v in variables) for way in ("input", "output")}
    assert f"numel(ports.Inport) ~= {count['input']} ||" in build
    assert f"numel(ports.Outport) ~= {count['output']}\n" in build
    # Each input is reached once: by a block, a bus or the flange.
    head, _, tail = build.partition("inputs = {")
    plain = [int(number) for number in re.findall(r"'\w+', (\d+), ", tail.partition("};")[0])]
    buses = [int(n) for bus in re.findall(r"\nbus_in\((.*?)\}", build, re.S) for n in re.findall(r"'\w+', (\d+), '", bus)]
    shaft = [int(number) for number in re.findall(r"add_line\(block, '(?:speed|angle)_of_shaft/1', 'FMU/(\d+)'\)", build)]
    assert sorted(plain + buses + shaft) == list(range(1, count["input"] + 1))
    # Fields that the block reads exist in the struct, and the other way round.
    values = next(folder.glob("*_parameters.m"), None)
    fields = set(re.findall(r"^p\.(\w+) = ", values.read_text(), re.M)) if values else set()
    assert set(re.findall(r"\bp\.(\w+)", build)) == fields
