"""Open FMUs and their instances, by FMPy's names."""

import io
import os
import shutil
import tempfile
import zipfile
from functools import lru_cache

from . import _core
from ._description import _build
from ._error import FmuError


@lru_cache(maxsize=16)
def _described(fmu):
    """The description of an open FMU, shared and never written."""
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
                    # One date for all: equal files give an equal archive.
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
    """Refuse values of arguments that this package does not support."""
    for name, value in arguments.items():
        if value not in (None, False):
            raise NotImplementedError(f"{name} = {value!r}: fmurun does not do this; FMPy does")


class _Slave(_core.Instance):
    """The methods that both standards share."""

    def __new__(cls, guid, unzipDirectory, modelIdentifier=None, instanceName=None, fmiCallLogger=None, requireFunctions=True,
                libraryPath=None, *, loggingOn=False, fmu=None):  # fmt: skip
        _refuse(fmiCallLogger=fmiCallLogger, libraryPath=libraryPath)
        fmu = fmu or _open(unzipDirectory)
        made = super().__new__(cls, fmu, instanceName or _described(fmu).modelName, loggingOn)
        made.fmu, made.unzipDirectory, made.modelDescription = fmu, unzipDirectory, _described(fmu)
        return made

    def instantiate(self, visible=False, callbacks=None, loggingOn=False, **more):
        """Switch logging on; the instance exists already."""
        _refuse(visible=visible, callbacks=callbacks, **more)
        if loggingOn:
            self._set_debug_logging(True)

    def setDebugLogging(self, loggingOn, categories=()):
        """Switch logging of all categories on or off."""
        _refuse(categories=list(categories) or None)
        self._set_debug_logging(bool(loggingOn))

    def messages(self):
        """Take the FMU's messages since the last call: (status, category, text)."""
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
    (FMU3Slave, ("Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean", "String",
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
