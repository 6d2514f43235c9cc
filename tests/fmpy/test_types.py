"""EveryType.fmu in FMPy: integers of every size, single precision, strings, arrays and matrices, a resource file."""

import os
import shutil
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from lxml import etree

FOLDER = Path(os.environ.get("FMU_TYPES", "target/fmu"))
BITS = {"int8": 8, "uint8": 8, "int16": 16, "uint16": 16, "int32": 32, "uint32": 32, "int64": 64, "uint64": 64}


@pytest.fixture(params=[2, 3])
def version(request):
    return request.param


@pytest.fixture
def archive(version):
    return str(FOLDER / f"fmi{version}" / "EveryType.fmu")


def test_fmpy_finds_no_problem(archive):
    assert validate_fmu(archive) == []


def test_types(archive, version):
    for v in fmpy.read_model_description(archive).modelVariables:
        name = v.name.rsplit(".")[-1]
        if name in BITS:
            expected = "Integer" if version == 2 else name.replace("uint", "UInt").replace("int", "Int")
            assert v.type == expected, v.name
        if name in ("label", "status", "revision"):
            assert v.type == "String"


def test_the_difference_is_relative(archive):
    """In the type definition and in the variable; validate_fmu checks both against the schema."""
    with zipfile.ZipFile(archive) as file:
        root = etree.fromstring(file.read("modelDescription.xml"))
    relative = [e for e in root.iter() if e.get("relativeQuantity") == "true"]
    assert len(relative) == 2 and all((e.get("unit"), e.get("displayUnit")) == ("K", "degC") for e in relative)


def test_simulation(archive, version):
    inputs = {"in.uint8": 200, "in.int16": -32768, "in.uint16": 65535, "in.int32": 2, "in.single": 0.25}
    if version == 3:
        inputs |= {"in.uint32": 2**32 - 1, "in.int64": -(2**63), "in.uint64": 2**64 - 1}
    given = inputs | {"label": "four", "in.fan": 1}
    weights = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 10.0]])
    if version == 2:
        given |= {f"weights[{i + 1},{k + 1}]": weights[i, k] for i in range(2) for k in range(3)}
    else:
        given["weights"] = " ".join(map(str, weights.ravel()))
    outputs = [name.replace("in.", "out.") for name in inputs]
    sums = ["sums[1]", "sums[2]"] if version == 2 else ["sums"]
    result = fmpy.simulate_fmu(archive, start_values=given, output=[*outputs, "x", "square", "letters", *sums], stop_time=0.3)
    for name, value in inputs.items():
        assert result[name.replace("in.", "out.")][-1] == value, name
    assert result["square"][-1] == 4 and result["letters"][-1] == 4
    assert result["x"][-1] == pytest.approx(4 - 3 * np.exp(-0.6), rel=1e-9)
    last = [result[name][-1] for name in sums] if version == 2 else result["sums"][-1]
    assert list(last) == [1 + 4 + 9, 30 + 0.5]


def test_texts_of_an_instance(archive, version, tmp_path):
    """The pointer to a string stays valid until the next call; a blank in a path is escaped in the URI."""
    folder = tmp_path / "with a blank % \u00e4"
    shutil.unpack_archive(archive, folder, "zip")
    description = fmpy.read_model_description(archive)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    fmu = (FMU2Slave if version == 2 else FMU3Slave)(
        guid=description.guid, unzipDirectory=str(folder), modelIdentifier="EveryType", instanceName="it"
    )
    fmu.instantiate()
    if version == 2:
        fmu.setupExperiment()
    fmu.enterInitializationMode()
    wanted = [reference["label"], reference["revision"]]
    read = fmu.getString
    assert [t.decode() if isinstance(t, bytes) else t for t in read(wanted)] == ["as built & <tested>", "r1 \u00b5"]
    fmu.setString([reference["label"]], ["\u03c8"])
    assert [t.decode() if isinstance(t, bytes) else t for t in read([reference["status"]])] == ["\u03c8"]
    fmu.freeInstance()
