"""The archives as FMPy reads them, compared with the contract with scripts outside the project."""

import platform
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from lxml import etree

from contract import CONTRACT, DISPLAY, ESTIMATORS, VARIABILITY
from misuse.abi import Fmu

TYPES = {"2.0": {}, "3.0": {"Real": "Float64", "Integer": "Int32"}}
UNITS = {  # SI base exponents
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "A": {"A": 1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
    "W": {"kg": 1, "m": 2, "s": -3},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "kg.m2": {"kg": 1, "m": 2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "1/s": {"s": -1},
    "s": {"s": 1},
}


@pytest.fixture
def description(archive):
    return read_model_description(archive)


@pytest.fixture
def variables(description):
    return {v.name: v for v in description.modelVariables}


def value(text, type):
    """A start value from the XML, where FMPy keeps it as a string."""
    return {"Boolean": lambda t: t == "true", "Real": float}.get(type, int)(text)


def test_fmpy_finds_no_problem(archive):
    assert validate_fmu(archive) == []


def test_fmpy_validates_with_start_values(archive):
    read_model_description(archive, validate=True, validate_variable_names=True, validate_model_structure=True)


def test_header(archive, description):
    assert description.fmiVersion == {"fmi2": "2.0", "fmi3": "3.0"}[archive.parent.name]
    assert description.modelName == archive.stem == description.coSimulation.modelIdentifier
    exchange, states = description.modelExchange, {"SensorlessController": 0, "PmsmPlant": 4, "PmsmDrive": 5}[archive.stem]
    assert exchange.modelIdentifier == archive.stem
    assert exchange.canGetAndSetFMUstate
    assert description.numberOfContinuousStates == states
    assert description.numberOfEventIndicators == {0: 0, 4: 3, 5: 5}[states]
    names = ["psi_d", "psi_q", "speed", "angle", "u_cap"][:states]
    assert [d.variable.derivative.name for d in description.derivatives] == names
    if description.fmiVersion == "2.0":  # FMPy looks for this name in FMI 3.0 too, where it ends with s
        assert exchange.providesDirectionalDerivative == (states > 0)
        assert description.coSimulation.providesDirectionalDerivative == (states > 0)
    assert description.coSimulation.hasEventMode == (description.fmiVersion == "3.0" and states == 0)
    assert description.coSimulation.canGetAndSetFMUstate
    assert description.coSimulation.canSerializeFMUstate
    assert description.coSimulation.canHandleVariableCommunicationStepSize
    assert not description.coSimulation.needsExecutionTool
    assert float(description.defaultExperiment.stepSize) == (1e-3 if archive.stem == "PmsmDrive" else 1e-4)


def test_the_contract(archive, description, variables):
    if archive.stem not in CONTRACT:
        pytest.skip("nothing is promised of this FMU yet")
    # FMI 3.0 requires the independent variable; FMI 2.0 allows it, and Modelica tools stumble over its name.
    independent = [v.name for v in description.modelVariables if v.causality == "independent"]
    assert independent == ([] if description.fmiVersion == "2.0" else ["time"])
    for row in CONTRACT[archive.stem]:
        found = variables.get(row.name)
        assert found is not None, f"{row.name} is missing"
        assert found.causality == row.causality, row.name
        assert found.type == TYPES[description.fmiVersion].get(row.type, row.type), row.name
        declared = found.declaredType if found.type == "Enumeration" or found.declaredType else found
        unit = found.unit or getattr(declared, "unit", None)
        assert (unit or None) == row.unit, f"{row.name} has the unit {unit}"
        display = found.displayUnit or getattr(declared, "displayUnit", None)
        assert (display or None) == row.display, f"{row.name} is shown in {display}"
        if row.start is None:
            assert found.start is None, row.name
        else:
            assert value(found.start, row.type) == row.start, f"{row.name} starts with {found.start}"
        if row.causality == "parameter":
            assert found.variability in ("fixed", "tunable"), row.name
        if row.causality == "output":
            assert found.variability == VARIABILITY[archive.stem], row.name


def test_units(description):
    units = {unit.name: unit for unit in description.unitDefinitions}
    for name, exponents in UNITS.items():
        if name not in units:
            continue
        base = units[name].baseUnit
        assert (base.factor, base.offset) == (1.0, 0.0), name
        found = {key: getattr(base, key) for key in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
        assert {key: n for key, n in found.items() if n} == exponents, name
    for name, (unit, factor) in DISPLAY.items():
        shown = {d.name: d for d in units[unit].displayUnits} if unit in units else {}
        assert shown[name].factor == pytest.approx(factor, rel=1e-15)
        assert shown[name].offset == 0.0


def test_discrete_and_continuous_inputs(archive, variables):
    if archive.stem == "PmsmPlant":
        # A discrete input cannot be set between events, and CasADi leaves it out.
        assert {variables[name].variability for name in ("u_a", "u_b", "u_c")} == {"continuous"}


def test_estimators_are_a_subset_in_order(archive, description, variables):
    """An estimator is added when it works, with its index in the list as value."""
    if "estimator" not in variables:
        pytest.skip("no estimator")
    items = variables["estimator"].declaredType.items
    assert items[0].name == "Rasmussen"
    for item in items:
        assert ESTIMATORS[int(item.value) - 1] == item.name


def test_start_values_are_those_of_the_binary(unpacked):
    """Read back without setting anything: in FMI 3.0 at once, in FMI 2.0 in Initialization Mode."""
    fmu = Fmu(unpacked)
    it = fmu.instance(logging=False)
    if fmu.version == 2:
        it.enter()
    checked = 0
    for variable in fmu.variables.values():
        if variable.start is not None:
            kind = {"Float64": "Real"}.get(variable.type, variable.type)
            assert it.get(variable.name) == [value(variable.start, kind)], variable.name
            checked += 1
    assert checked > 10
    it.free()


def test_both_standards_tell_the_same(archives, archive):
    two, three = (read_model_description(archives / f"fmi{n}" / archive.name) for n in (2, 3))
    # Time is a variable of FMI 3.0 alone, the last one; FMI 2.0 only counts the event indicators before it.
    *others, time = three.modelVariables
    indicators = {indicator.variable.name for indicator in three.eventIndicators}
    shared = [variable for variable in others if variable.name not in indicators]
    assert (time.name, len(indicators)) == ("time", two.numberOfEventIndicators)
    scalars = iter(two.modelVariables)
    same = ("causality", "variability", "description", "unit", "min", "max")
    for new in shared:
        # FMI 2.0 has the elements of an array, one after the other.
        starts = (new.start or "").split() if new.dimensions else [new.start]
        for k, start in enumerate(starts):
            old, name = next(scalars), f"{new.name}[{k + 1}]" if new.dimensions else new.name
            assert (old.name, old.valueReference, old.start) == (name, new.valueReference + k, start)
            assert [getattr(old, key) for key in same] == [getattr(new, key) for key in same]
    assert next(scalars, None) is None


def test_contents(archive):
    """Binary, documentation and licenses are inside, and nothing else."""
    with zipfile.ZipFile(archive) as file:
        names = file.namelist()
        assert file.testzip() is None
        assert b"<html" in file.read("documentation/index.html").lower()
        assert file.read("documentation/licenses/license.txt")
    system = {"Linux": "linux", "Darwin": "darwin", "Windows": "win"}[platform.system()]
    assert any(n.startswith("binaries/") and system in n for n in names)
    assert all(n.isascii() and "\\" not in n and ".." not in n and not n.startswith("/") for n in names)
    assert len(set(names)) == len(names)


def test_terminals_and_icons(archive, variables):
    """The schema that FMPy delivers accepts the file, in an archive of FMI 2.0 as well (FMI 2.0.5, 2.3)."""
    schema = etree.XMLSchema(file=Path(fmpy.__file__).parent / "schema/fmi3/fmi3TerminalsAndIcons.xsd")
    with zipfile.ZipFile(archive) as file:
        root = etree.fromstring(file.read("terminalsAndIcons/terminalsAndIcons.xml"))
        names = file.namelist()
        pictures = [n for n in names if n.endswith(".png")]
        assert all(file.read(n).startswith(b"\x89PNG") for n in pictures)
    schema.assertValid(root)
    assert root.get("fmiVersion") == "3.0"
    assert ("model.png" in names) == (archive.parent.name == "fmi2")
    for picture in ["icon", *(e.get("iconBaseName") for e in root.iter("TerminalGraphicalRepresentation"))]:
        assert {f"terminalsAndIcons/{picture}.png", f"terminalsAndIcons/{picture}.svg"} <= set(names)
    for terminal in root.iter("Terminal"):
        members = terminal.findall("TerminalMemberVariable")
        assert len({m.get("memberName") for m in members}) == len(members) > 0
        assert all(m.get("variableName") in variables for m in members)


def test_archives_that_must_exist(archives):
    for name in CONTRACT:
        for standard in (2, 3):
            assert (archives / f"fmi{standard}" / f"{name}.fmu").is_file()


def test_the_clocked_controller(archives):
    """FMI 3.0 alone: FMPy finds no problem, and what the controller exchanges is on its one clock."""
    archive = archives / "fmi3/SensorlessControllerClocked.fmu"
    assert validate_fmu(archive) == []
    description = read_model_description(archive)
    assert description.scheduledExecution is not None
    (clock,) = (v for v in description.modelVariables if v.type == "Clock")
    assert (clock.name, clock.causality, clock.intervalVariability) == ("sample", "input", "fixed")
    exchanged = [v for v in description.modelVariables if v.causality in ("input", "output") and v is not clock]
    assert exchanged and all(v.clocks == [clock] for v in exchanged)


GOLDEN = Path(__file__).parents[2] / "modelDescription/tests/golden"


@pytest.mark.parametrize("name", ["sample", "exchange", "sampled"])
@pytest.mark.parametrize("version", ["2", "3"])
def test_golden_descriptions(name, version):
    """States, event indicators and event mode as model-description writes them: the schemas and FMPy accept them."""
    file = GOLDEN / f"{name}-{version}.0.xml"
    schema = etree.XMLSchema(file=Path(fmpy.__file__).parent / f"schema/fmi{version}/fmi{version}ModelDescription.xsd")
    schema.assertValid(etree.parse(file))
    read_model_description(str(file), validate=True, validate_variable_names=True, validate_model_structure=True)
