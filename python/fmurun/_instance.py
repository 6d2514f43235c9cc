"""Open FMUs and their instances, by FMPy's names."""

import io
import os
import shutil
import tempfile
import warnings
import zipfile
from functools import lru_cache

import numpy as np

from . import _core
from ._description import _build
from ._error import FmuError


@lru_cache(maxsize=16)
def _described(fmu):
    """The description of an open FMU, shared and never written."""
    return _build(fmu.describe())


def _open(filename):
    """An open FMU from an archive or from a folder with its files."""
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
                    # One date for all: equal files give an equal archive.
                    file.writestr(zipfile.ZipInfo(inside), open(path, "rb").read())
    return _core.open(filename, archive.getvalue())


def read_model_description(filename, validate=True, validate_variable_names=False, validate_model_structure=False):
    """Read the description of an FMU, from its archive or from the folder that it was extracted to.

    The reader refuses what it cannot understand. It does not check the file against the schema of the standard, even
    with `validate`: `fmu check` does.
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


def _array(values, n):
    """The memory of `n` numbers, given as a NumPy array or as an array or a pointer of ctypes."""
    if isinstance(values, np.ndarray):
        return values.reshape(-1)[:n]
    return np.ctypeslib.as_array(values, (n,)) if n else np.empty(0)


class _Instance(_core.Instance):
    """The methods that both standards and both interfaces share."""

    def __new__(cls, guid, unzipDirectory, modelIdentifier=None, instanceName=None, libraryPath=None, fmiCallLogger=None,
                requireFunctions=True, *, kind=None, loggingOn=False, visible=False, logger=None, fmu=None):  # fmt: skip
        if libraryPath is not None:
            raise ValueError(f"libraryPath = {libraryPath!r}: the library of the archive is used; pack another one into it")
        fmu = fmu or _open(unzipDirectory)
        description = _described(fmu)
        kind = kind or (issubclass(cls, (FMU2Model, FMU3Model)), False, False)
        talks = logger is not None or fmiCallLogger is not None
        made = super().__new__(_talking(cls) if talks else cls, fmu, instanceName or description.modelName, kind,
                               loggingOn if loggingOn is None else bool(loggingOn), bool(visible), fmiCallLogger is not None)  # fmt: skip
        made.fmu, made.unzipDirectory, made.modelDescription = fmu, unzipDirectory, description
        made._loggers, made._freed = (logger, fmiCallLogger), False
        return made

    def __init__(self, *_, **__):
        pass

    def instantiate(self, visible=False, callbacks=None, loggingOn=False, **more):
        """Switch logging on; the instance already exists, with the arguments of `instantiate_fmu`."""
        late = [name for name, value in {"visible": visible, "callbacks": callbacks, **more}.items() if value]
        if late:
            raise ValueError(f"{', '.join(late)}: give this to instantiate_fmu, which creates the instance")
        if loggingOn:
            self._set_debug_logging(True)

    def setDebugLogging(self, loggingOn, categories=()):
        """Switch logging of all categories on or off, regardless of `categories`."""
        self._set_debug_logging(bool(loggingOn))

    def messages(self):
        """Take the FMU's messages since the last call: (status, category, text)."""
        return self._take_messages()

    def _warn(self):
        """Give each warning of the FMU once as a Python warning."""
        texts = {text: None for status, _, text in self._take_messages() if status == "Warning"}
        for text in texts:
            # Many FMUs begin with the name of the instance.
            named = text.startswith(f"{self.instanceName}: ")
            warnings.warn(text if named else f"{self.instanceName}: {text}", stacklevel=3)

    def _talk(self):
        """Pass new messages and calls to the loggers."""
        logger, call_logger = self._loggers
        if call_logger is not None:
            for line in self._take_calls():
                call_logger(line)
        if logger is not None and not self._freed:
            for status, category, text in self._take_messages():
                name = self.instanceName.encode()
                before = (None, name) if self.modelDescription.fmiVersion == "2.0" else (None,)
                logger(*before, _STATUS.get(status, 5), category.encode(), text.encode())

    def getDirectionalDerivative(self, unknowns, knowns, seed, nSensitivity=None):
        """Partial derivatives of the unknowns in the direction of the seed of the knowns, by value references."""
        return self._sensitivity(list(unknowns), list(knowns), list(seed), nSensitivity or len(unknowns), False)


_STATUS = {"OK": 0, "Warning": 1, "Discard": 2, "Error": 3, "Fatal": 4, "Pending": 5}


@lru_cache
def _talking(cls):
    """Wraps the methods of a class so that they call the loggers at their end."""

    def __getattribute__(self, name):
        value = cls.__getattribute__(self, name)
        if name.startswith("_") or not callable(value):
            return value

        def method(*arguments, **named):
            try:
                return value(*arguments, **named)
            finally:
                self._talk()

        def free():
            self._talk()
            value()
            self._freed = True
            self._talk()

        return free if name == "freeInstance" else method

    return type(cls.__name__, (cls,), {"__getattribute__": __getattribute__})


class _Model:
    """Methods of Model Exchange. Vectors are NumPy arrays, or arrays or pointers of ctypes as in FMPy, with their length."""

    enterContinuousTimeMode = _core.Instance._enter_continuous
    setTime = _core.Instance._set_time

    def completedIntegratorStep(self, noSetFMUStatePriorToCurrentPoint=True):
        """Report a completed step: (enter event mode, terminate)."""
        return self._completed()

    def setContinuousStates(self, x, nx):
        """Set all continuous states."""
        self._set_states(_array(x, nx).tolist())

    def getContinuousStates(self, x, nx):
        """Read all continuous states."""
        _array(x, nx)[:] = self._vector("states", nx)

    def getDerivatives(self, dx, nx):
        """Compute the derivatives of all states."""
        _array(dx, nx)[:] = self._vector("derivatives", nx)

    def getEventIndicators(self, z, nz):
        """Compute all event indicators."""
        _array(z, nz)[:] = self._vector("indicators", nz)

    def getNominalsOfContinuousStates(self, nominals, nx):
        """Read the nominal values of all states."""
        _array(nominals, nx)[:] = self._vector("nominals", nx)


class _FMU2(_Instance):
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


class _FMU3(_Instance):
    """Getters return all elements of arrays."""

    getFloat64 = _core.Instance._get_reals
    setFloat64 = _core.Instance._set_reals
    updateDiscreteStates = _core.Instance._update

    def enterInitializationMode(self, tolerance=None, startTime=0.0, stopTime=None):
        """Begin the initialization; times (s) and relative tolerance of the experiment."""
        self._setup(tolerance, startTime, stopTime)
        self._enter()

    def getAdjointDerivative(self, unknowns, knowns, seed, nSensitivity=None):
        """The seed of the unknowns times their partial derivatives, by value references."""
        return self._sensitivity(list(unknowns), list(knowns), list(seed), nSensitivity or len(knowns), True)


class FMU2Slave(_FMU2):
    """A Co-Simulation instance of FMI 2.0 with FMPy's methods."""

    getRealOutputDerivatives = _core.Instance._output_derivatives


class FMU3Slave(_FMU3):
    """A Co-Simulation instance of FMI 3.0 with FMPy's methods."""

    getOutputDerivatives = _core.Instance._output_derivatives
    enterStepMode = _core.Instance._enter_steps


class FMU2Model(_Model, _FMU2):
    """A Model Exchange instance of FMI 2.0 with FMPy's methods."""

    newDiscreteStates = _core.Instance._update


class FMU3Model(_Model, _FMU3):
    """A Model Exchange instance of FMI 3.0 with FMPy's methods."""

    getContinuousStateDerivatives = _Model.getDerivatives

    def getNumberOfContinuousStates(self):
        """Number of continuous states."""
        return self._counts()[0]

    def getNumberOfEventIndicators(self):
        """Number of event indicators."""
        return self._counts()[1]


def _typed(type_):
    def get(self, vr, nValues=None):
        return self._get(type_, vr)

    def set_(self, vr, values):
        self._set(type_, vr, values)

    get.__doc__, set_.__doc__ = f"Read {type_} variables.", f"Write {type_} variables."
    return get, set_


for _class, _types in (
    (_FMU2, ("Integer", "Boolean", "String")),
    (_FMU3, ("Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean", "String",
             "Binary")),
):
    for _type in _types:
        _get, _set = _typed(_type)
        _get.__name__, _set.__name__ = f"get{_type}", f"set{_type}"
        setattr(_class, f"get{_type}", _get)
        setattr(_class, f"set{_type}", _set)


def instantiate_fmu(unzipdir, model_description, fmi_type=None, visible=False, debug_logging=False, logger=None,
                    fmi_call_logger=None, library_path=None, early_return_allowed=False, event_mode_used=False,
                    intermediate_update=None, require_functions=True, required_intermediate_variables=None):  # fmt: skip
    """Create an instance from an extracted FMU, or from the archive itself, for Co-Simulation or Model Exchange.

    Arguments as FMPy's. `logger` gets the FMU's messages as FMPy's does, when the call that caused them ends; `fmi_call_logger`
    gets a line "fmi3DoStep -> OK" for each call. Calls during a step, `intermediate_update`, are not made.
    """
    unsupported = {"library_path": library_path, "intermediate_update": intermediate_update,
                   "required_intermediate_variables": required_intermediate_variables}  # fmt: skip
    for name, value in unsupported.items():
        if value is not None:
            raise ValueError(f"{name} = {value!r}: fmurun has no such instances; FMPy has")
    fmu = _open(unzipdir)
    kind = _kind(_described(fmu), _interface(model_description, fmi_type), event_mode_used, early_return_allowed)
    return _instance(fmu, kind, unzipdir, debug_logging, visible, logger, fmi_call_logger)


def _interface(description, fmi_type):
    """ "CoSimulation" or "ModelExchange": the requested interface, or that of the FMU."""
    has = {"CoSimulation": description.coSimulation, "ModelExchange": description.modelExchange}
    if fmi_type is None:
        fmi_type = next((name for name, interface in has.items() if interface), "CoSimulation")
    if fmi_type not in has:
        raise ValueError(f"fmi_type must be CoSimulation or ModelExchange, not {fmi_type!r}")
    if not has[fmi_type]:
        raise FmuError(None, None, description.modelName, f"has no {fmi_type}")
    return fmi_type


def _kind(description, fmi_type, event_mode, early_return):
    """(Model Exchange, event mode, early return) if the FMU has them."""
    exchange, stepping = fmi_type == "ModelExchange", description.coSimulation
    three = description.fmiVersion != "2.0" and not exchange
    return exchange, three and event_mode and stepping.hasEventMode, three and early_return and stepping.mightReturnEarlyFromDoStep


def _instance(fmu, kind, unzipdir=None, debug_logging=False, visible=False, logger=None, fmi_call_logger=None):
    """An instance of an open FMU."""
    classes = ((FMU3Slave, FMU3Model), (FMU2Slave, FMU2Model))
    cls = classes[_described(fmu).fmiVersion == "2.0"][kind[0]]
    return cls(None, unzipdir, kind=kind, loggingOn=debug_logging, visible=visible, logger=logger,
               fmiCallLogger=fmi_call_logger, fmu=fmu)  # fmt: skip


def dump(filename):
    """Print the name, the standard and the variables of an FMU."""
    description = read_model_description(filename)
    print(f"{description.modelName}, FMI {description.fmiVersion}: {description.description or ''}")
    for v in description.modelVariables:
        print(f"  {v.name:30} {v.causality:20} {v.start or '':>12} {v.unit or '':10} {v.description or ''}")
