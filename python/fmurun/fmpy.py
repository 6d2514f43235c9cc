"""FMPy's functions and classes for one FMU, by the same names: scripts change their import.

    from fmurun.fmpy import extract, instantiate_fmu, read_model_description

`read_model_description` returns objects with FMPy's attributes; `instantiate_fmu` returns an `FMU2Slave` or an `FMU3Slave`
with FMPy's methods for co-simulation. An `FmuError` (also `FMICallException` here) says which call failed and why.
Model exchange, scheduled execution, event mode, directional derivatives, binary variables and clocks are not there.
"""

import io
import os
import shutil
import tempfile
import zipfile
from dataclasses import dataclass, field
from functools import lru_cache

from . import _core
from ._error import FmuError

FMICallException = FmuError

__all__ = [
    "CoSimulation", "DefaultExperiment", "FMICallException", "FMU2Slave", "FMU3Slave", "FmuError", "ModelDescription",
    "ModelVariable", "ScalarVariable", "dump", "extract", "instantiate_fmu", "read_model_description", "simulate_fmu",
]  # fmt: skip


@dataclass(eq=False)
class DefaultExperiment:
    """Times (s) as the file has them, texts; None where it says nothing."""

    startTime: str | None = None
    stopTime: str | None = None
    tolerance: str | None = None
    stepSize: str | None = None


@dataclass(eq=False)
class InterfaceType:
    """An interface that the FMU has."""

    modelIdentifier: str
    needsExecutionTool: bool = False
    canBeInstantiatedOnlyOncePerProcess: bool = False
    canGetAndSetFMUstate: bool = False
    canSerializeFMUstate: bool = False


class ModelExchange(InterfaceType):
    """Model exchange; this package does not run it."""


class ScheduledExecution(InterfaceType):
    """Scheduled execution; this package does not run it."""


@dataclass(eq=False)
class CoSimulation(InterfaceType):
    """The co-simulation interface and its capabilities."""

    canHandleVariableCommunicationStepSize: bool = False
    fixedInternalStepSize: float | None = None
    canInterpolateInputs: bool = False
    hasEventMode: bool = False
    mightReturnEarlyFromDoStep: bool = False


@dataclass(eq=False)
class Item:
    """One value of an enumeration."""

    name: str
    value: str
    description: str | None = None


@dataclass(eq=False)
class DisplayUnit:
    """A unit to show values in: shown = factor * value + offset."""

    name: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(eq=False)
class BaseUnit:
    """Exponents of the SI base units, factor and offset to them."""

    kg: int = 0
    m: int = 0
    s: int = 0
    A: int = 0
    K: int = 0
    mol: int = 0
    cd: int = 0
    rad: int = 0
    factor: float = 1.0
    offset: float = 0.0


@dataclass(eq=False)
class Unit:
    """A unit with its display units."""

    name: str
    baseUnit: BaseUnit | None = None
    displayUnits: list = field(default_factory=list)


@dataclass(eq=False)
class SimpleType:
    """A type definition."""

    name: str
    type: str
    description: str | None = None
    quantity: str | None = None
    unit: str | None = None
    displayUnit: str | None = None
    min: str | None = None
    max: str | None = None
    nominal: str | None = None
    items: list = field(default_factory=list)
    relativeQuantity: bool = False


@dataclass(eq=False)
class ModelVariable:
    """A variable. Properties that the file leaves to the type definition or to the standard are filled in."""

    name: str
    valueReference: int
    type: str
    description: str | None = field(default=None, repr=False)
    causality: str | None = field(default=None, repr=False)
    variability: str | None = field(default=None, repr=False)
    initial: str | None = field(default=None, repr=False)
    declaredType: SimpleType | None = field(default=None, repr=False)
    quantity: str | None = field(default=None, repr=False)
    unit: str | None = field(default=None, repr=False)
    displayUnit: str | None = field(default=None, repr=False)
    min: str | None = field(default=None, repr=False)
    max: str | None = field(default=None, repr=False)
    nominal: str | None = field(default=None, repr=False)
    start: str | None = field(default=None, repr=False)
    shape: tuple = field(default=(), repr=False)
    derivative: "ModelVariable | None" = field(default=None, repr=False)
    sourceline: int | None = field(default=None, repr=False)
    alias: "ModelVariable | None" = field(default=None, repr=False)
    relativeQuantity: bool | None = field(default=None, repr=False)


ScalarVariable = ModelVariable


@dataclass(eq=False)
class Unknown:
    """An entry of the model structure."""

    variable: ModelVariable | None
    dependencies: list | None = None
    dependenciesKind: list | None = None
    sourceline: int = 0


@dataclass(eq=False)
class ModelDescription:
    """The contents of modelDescription.xml."""

    fmiVersion: str
    modelName: str
    instantiationToken: str
    description: str | None = field(default=None, repr=False)
    author: str | None = field(default=None, repr=False)
    version: str | None = field(default=None, repr=False)
    copyright: str | None = field(default=None, repr=False)
    license: str | None = field(default=None, repr=False)
    generationTool: str | None = field(default=None, repr=False)
    generationDateAndTime: str | None = field(default=None, repr=False)
    variableNamingConvention: str = field(default="flat", repr=False)
    defaultExperiment: DefaultExperiment | None = None
    coSimulation: CoSimulation | None = None
    modelExchange: ModelExchange | None = None
    scheduledExecution: ScheduledExecution | None = None
    unitDefinitions: list = field(default_factory=list, repr=False)
    typeDefinitions: list = field(default_factory=list, repr=False)
    modelVariables: list = field(default_factory=list, repr=False)
    outputs: list = field(default_factory=list, repr=False)
    derivatives: list = field(default_factory=list, repr=False)
    initialUnknowns: list = field(default_factory=list, repr=False)

    @property
    def guid(self):
        """The instantiation token, by its name of FMI 2.0."""
        return self.instantiationToken

    @property
    def fmiMajorVersion(self):
        """2 or 3."""
        return int(self.fmiVersion.split(".")[0])


def _co_simulation(identifier, attributes):
    """The capabilities of FMI 3.0 go by FMPy's names."""
    # FMI 3.0 writes State where FMI 2.0 writes state.
    attributes = {name.replace("FMUState", "FMUstate"): text.strip() for name, text in attributes}
    step = attributes.pop("fixedInternalStepSize", None)
    known = CoSimulation.__dataclass_fields__
    flags = {name: text in ("true", "1") for name, text in attributes.items() if name in known}
    return CoSimulation(identifier, fixedInternalStepSize=None if step is None else float(step), **flags)


def _build(d):
    """Objects from the dictionary of `Fmu.describe`."""
    types = {t["name"]: SimpleType(**t | {"items": [Item(*i) for i in t["items"]]}) for t in d["types"]}
    variables, names = [], {}
    for v in d["variables"]:
        aliases = v.pop("aliases")
        v |= {"declaredType": types.get(v["declaredType"]), "shape": tuple(v["shape"])}
        variable = ModelVariable(**v)
        variables.append(variable)
        names[variable.name] = variable
        for name, description, unit in aliases:
            more = {"name": name, "alias": variable}
            more |= {"description": description} if description else {}
            more |= {"displayUnit": unit} if unit else {}
            names[name] = ModelVariable(**v | more)
    for variable in names.values():
        variable.derivative = names.get(variable.derivative)
    variables += [v for v in names.values() if v.alias]

    def unknowns(entries):
        resolve = lambda list_: None if list_ is None else [names.get(n) for n in list_]
        return [Unknown(names.get(name), resolve(deps), kinds, line) for name, deps, kinds, line in entries]

    units = [
        Unit(name, base and BaseUnit(*base[0], *base[1:]), [DisplayUnit(*shown) for shown in all_shown])
        for name, base, all_shown in d["units"]
    ]
    plain = ("fmiVersion", "modelName", "instantiationToken", "description", "author", "version", "copyright", "license")
    return ModelDescription(
        **{name: d[name] for name in (*plain, "generationTool", "generationDateAndTime")},
        variableNamingConvention="structured" if d["structured"] else "flat",
        defaultExperiment=DefaultExperiment(**d["defaultExperiment"]),
        coSimulation=d["coSimulation"] and _co_simulation(*d["coSimulation"]),
        modelExchange=d["modelExchange"] and ModelExchange(d["modelExchange"]),
        scheduledExecution=d["scheduledExecution"] and ScheduledExecution(d["scheduledExecution"]),
        unitDefinitions=units,
        typeDefinitions=list(types.values()),
        modelVariables=variables,
        **{name: unknowns(d[name]) for name in ("outputs", "derivatives", "initialUnknowns")},
    )


@lru_cache(maxsize=16)
def _described(fmu):
    """The description of an open FMU, shared: nobody writes it."""
    return _build(fmu.describe())


def _open(filename):
    """An open FMU from an archive or from a folder with the files of one."""
    filename = os.fspath(filename)
    if not os.path.isdir(filename):
        return _core.open(filename)
    if not os.path.isfile(os.path.join(filename, "modelDescription.xml")):
        raise FmuError(None, None, None, f"{filename}: is a folder without modelDescription.xml")
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        for folder, _, names in sorted(os.walk(filename)):
            for name in sorted(names):
                path = os.path.join(folder, name)
                inside = os.path.relpath(path, filename).replace(os.sep, "/")
                if inside.startswith(("modelDescription.xml", "binaries/", "resources/", "terminalsAndIcons/")):
                    # One date for all: the same files are the same FMU.
                    file.writestr(zipfile.ZipInfo(inside), open(path, "rb").read())
    return _core.open(filename, archive.getvalue())


def read_model_description(filename, validate=True, validate_variable_names=False, validate_model_structure=False):
    """Read the description of an FMU, from its archive or from the folder that it was extracted to.

    The reader refuses what it cannot understand. It does not check the file against the schema of the standard, whatever
    `validate` says: `fmu check` does.
    """
    return _build(_open(filename).describe())


def extract(filename, unzipdir=None, include=None):
    """Extract an FMU to a folder, a new temporary one by default; returns its path. `include(name)` selects files."""
    made = unzipdir is None
    unzipdir = tempfile.mkdtemp() if made else os.fspath(unzipdir)
    try:
        with zipfile.ZipFile(filename) as file:
            names = file.namelist()
            bad = next((n for n in names if "\\" in n or ":" in n or n.startswith("/") or ".." in n.split("/")), None)
            if bad is not None:
                raise FmuError(None, None, None, f"{filename}: entry {bad!r} leads outside of the archive")
            file.extractall(unzipdir, members=filter(include, names))
    except BaseException:
        if made:
            shutil.rmtree(unzipdir, ignore_errors=True)
        raise
    return unzipdir


def _refuse(**arguments):
    """Refuse arguments that are set to something that this package does not do."""
    for name, value in arguments.items():
        if value not in (None, False):
            raise NotImplementedError(f"{name} = {value!r}: fmurun does not do this; FMPy does")


class _Slave(_core.Instance):
    """What both standards share."""

    def __new__(cls, guid, unzipDirectory, modelIdentifier=None, instanceName=None, fmiCallLogger=None, requireFunctions=True,
                libraryPath=None, *, loggingOn=False, fmu=None):  # fmt: skip
        _refuse(fmiCallLogger=fmiCallLogger, libraryPath=libraryPath)
        fmu = fmu or _open(unzipDirectory)
        made = super().__new__(cls, fmu, instanceName or _described(fmu).modelName, loggingOn)
        made.fmu, made.unzipDirectory, made.modelDescription = fmu, unzipDirectory, _described(fmu)
        return made

    def instantiate(self, visible=False, callbacks=None, loggingOn=False, **more):
        """The instance is there already; switches logging on."""
        _refuse(visible=visible, callbacks=callbacks, **more)
        if loggingOn:
            self._set_debug_logging(True)

    def setDebugLogging(self, loggingOn, categories=()):
        """Switch logging of all categories on or off."""
        _refuse(categories=list(categories) or None)
        self._set_debug_logging(bool(loggingOn))

    def messages(self):
        """Take the FMU's messages since the last time: (status, category, text)."""
        return self._take_messages()


class FMU2Slave(_Slave):
    """A co-simulation instance of FMI 2.0 with FMPy's methods."""

    getReal = _core.Instance._get_reals
    setReal = _core.Instance._set_reals

    def setupExperiment(self, tolerance=None, startTime=0.0, stopTime=None):
        """Times (s) and relative tolerance of the experiment."""
        self._setup(tolerance, startTime, stopTime)

    def enterInitializationMode(self):
        """Begin the initialization."""
        self._enter()

    getFMUstate = _core.Instance.getFMUState
    setFMUstate = _core.Instance.setFMUState
    freeFMUstate = _core.Instance.freeFMUState
    serializeFMUstate = _core.Instance.serializeFMUState
    deSerializeFMUstate = _core.Instance.deserializeFMUState


class FMU3Slave(_Slave):
    """A co-simulation instance of FMI 3.0 with FMPy's methods. Getters return all elements of arrays."""

    getFloat64 = _core.Instance._get_reals
    setFloat64 = _core.Instance._set_reals

    def enterInitializationMode(self, tolerance=None, startTime=0.0, stopTime=None):
        """Begin the initialization; times (s) and relative tolerance of the experiment."""
        self._setup(tolerance, startTime, stopTime)
        self._enter()


def _typed(type_):
    def get(self, vr, nValues=None):
        return self._get(type_, vr)

    def set_(self, vr, values):
        self._set(type_, vr, values)

    get.__doc__, set_.__doc__ = f"Read {type_} variables.", f"Write {type_} variables."
    return get, set_


for _class, _types in (
    (FMU2Slave, ("Integer", "Boolean", "String")),
    (FMU3Slave, ("Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean", "String")),
):
    for _type in _types:
        _get, _set = _typed(_type)
        _get.__name__, _set.__name__ = f"get{_type}", f"set{_type}"
        setattr(_class, f"get{_type}", _get)
        setattr(_class, f"set{_type}", _set)


def instantiate_fmu(unzipdir, model_description, fmi_type=None, visible=False, debug_logging=False, logger=None,
                    fmi_call_logger=None, library_path=None, early_return_allowed=False, event_mode_used=False,
                    intermediate_update=None, require_functions=True, required_intermediate_variables=None):  # fmt: skip
    """Create a co-simulation instance from an extracted FMU, or from the archive itself.

    Arguments as FMPy's. NotImplementedError names one that this package does not know.
    """
    _refuse(visible=visible, logger=logger, fmi_call_logger=fmi_call_logger, library_path=library_path,
            early_return_allowed=early_return_allowed, event_mode_used=event_mode_used,
            intermediate_update=intermediate_update,
            required_intermediate_variables=required_intermediate_variables)  # fmt: skip
    if fmi_type not in (None, "CoSimulation") or model_description.coSimulation is None:
        fmi_type = fmi_type if model_description.coSimulation else "of an FMU without co-simulation"
        raise NotImplementedError(f"fmi_type = {fmi_type!r}: fmurun runs co-simulation only; FMPy does the rest")
    return _instance(_open(unzipdir), debug_logging, unzipdir)


def _instance(fmu, debug_logging, unzipdir=None):
    """An instance of an open FMU."""
    slave = FMU2Slave if _described(fmu).fmiVersion == "2.0" else FMU3Slave
    return slave(None, unzipdir, loggingOn=bool(debug_logging), fmu=fmu)


def dump(filename):
    """Print the name, the standard and the variables of an FMU."""
    description = read_model_description(filename)
    print(f"{description.modelName}, FMI {description.fmiVersion}: {description.description or ''}")
    for v in description.modelVariables:
        print(f"  {v.name:30} {v.causality:20} {v.start or '':>12} {v.unit or '':10} {v.description or ''}")


from ._simulate import simulate_fmu  # noqa: E402  (it needs the classes above)
