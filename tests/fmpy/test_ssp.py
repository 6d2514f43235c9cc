"""The closed loop as an SSP: its files against the schemas of SSP 1.0, and its run in `fmpy.ssp` against `fmu simulate`.

FMPy exchanges values as Jacobi does, but passes external inputs one step late, and 0 before the start: the reference
run has its inputs shifted by that step.
"""

import csv
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet, read_ssd

FOLDER = Path(os.environ["FMU_SSP"])
T_S = 1e-4
STOP = 0.6
COMPONENTS = {"controller": "SensorlessController", "plant": "PmsmPlant"}


@pytest.fixture(params=["fmi2.ssp", "fmi3.ssp", "motor.ssp"])
def ssp(request):
    return FOLDER / request.param


def test_the_schemas_accept_it(ssp):
    """`read_ssd` validates the description and every SSV file that it names."""
    description = read_ssd(ssp, validate=True)
    system = description.system
    assert [c.name for c in system.elements] == list(COMPONENTS)
    assert {c.name for c in system.connectors if c.kind == "input"} >= {"speed_ref", "tau_load", "u_dc"}
    sources = {b.source for b in system.parameterBindings}
    assert sources == {"resources/SensorlessDrive.ssv"}
    values = {p.name: float(p.value) for p in system.parameterBindings[0].parameterValues[0].parameters}
    assert values["u_dc"] == (540 if ssp.stem == "motor" else 325)
    with zipfile.ZipFile(ssp) as file:
        assert file.testzip() is None
        assert {i.compress_type for i in file.infolist()} <= {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
        assert all(i.filename == "SystemStructure.ssd" or i.filename.startswith("resources/") for i in file.infolist())


def test_every_connector_is_a_variable(ssp, tmp_path):
    with zipfile.ZipFile(ssp) as file:
        for component in read_ssd(ssp).system.elements:
            description = read_model_description(file.extract(component.source, tmp_path))
            kinds = {v.name: v.causality for v in description.modelVariables}
            assert len({c.name for c in component.connectors}) == len(component.connectors) > 0
            assert all(kinds[c.name] == c.kind for c in component.connectors)


def test_the_units_are_those_that_the_connectors_name(ssp):
    with zipfile.ZipFile(ssp) as file:
        text = file.read("SystemStructure.ssd").decode()
    named = {part.split('"')[0] for part in text.split('ssc:Real unit="')[1:]}
    assert {unit.name for unit in read_ssd(ssp).units} == named


def parameters(ssp, tmp_path):
    """The values that are bound to the components, as `simulate_ssp` wants them: it reads none by itself."""
    found = ParameterSet(name="all")
    with zipfile.ZipFile(ssp) as file:
        for component in read_ssd(ssp).system.elements:
            description = read_model_description(file.extract(component.source, tmp_path))
            variables = {v.name: v for v in description.modelVariables}
            for binding in component.parameterBindings:
                for p in binding.parameterValues[0].parameters:
                    value = {"Real": float, "Integer": int}.get(p.type, str)(p.value)
                    if p.type == "Boolean":
                        value = float(p.value == "true")
                    if p.type == "Enumeration":
                        value = next(i.value for i in variables[p.name].declaredType.items if i.name == p.value)
                    found.parameters.append(Parameter(name=f"{component.name}.{p.name}", type=p.type, value=value))
    return found


@pytest.mark.parametrize("name", ["fmi2", "motor"])
def test_a_start_and_a_load_step_as_with_fmu_simulate(name, tmp_path):
    """Bit for bit: the same binaries, the same order of exchange."""
    with open(FOLDER / f"{name}.csv") as file:
        header, *rows = csv.reader(file)
    expected = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    ssp = FOLDER / f"{name}.ssp"
    u_dc = 540.0 if name == "motor" else 325.0
    result = simulate_ssp(
        str(ssp),
        stop_time=STOP,
        step_size=T_S,
        parameter_set=parameters(ssp, tmp_path),
        input={
            "speed_ref": lambda t: 0.0 if t < 0.1 - T_S / 2 else 50.0,
            "tau_load": lambda t: 0.0 if t < 0.4 - T_S / 2 else 1.0,
            "u_dc": lambda _: u_dc,
        },
    )
    n = round(STOP / T_S)
    # A row of FMPy has the start time of its step and the outputs at its end.
    for column in header[1:]:
        np.testing.assert_array_equal(result[column][:n], expected[column][1:], err_msg=column)
    # The machine of the motor's file is still on its way, led by a current.
    assert 10.0 < result["speed"][n - 1] < 60.0, "the drive turns"


def test_fmi_3_is_beyond_fmpy_ssp():
    """It instantiates every FMU as one of FMI 2.0. When this fails, FMPy supports it: run the test above with fmi3
    too."""
    with pytest.raises(Exception, match="Cannot find shared library .*binaries"):
        simulate_ssp(str(FOLDER / "fmi3.ssp"), stop_time=0.001, step_size=T_S)
