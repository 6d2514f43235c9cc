"""The drives of the wheel, and values for machines.

`fmurun.drives.PmsmDrive` is the path of the archive of FMI 3.0, `fmurun.drives.fmi2.PmsmDrive` that of FMI 2.0; `machines` has the
motor files by their names. `tune` returns start values for `fmurun` and FMPy:

    from fmurun import drives, simulate_fmu

    result = simulate_fmu(drives.PmsmDrive, start_values=drives.tune("ipmsm-2.2kw") | {"speed_ref": 100.0})
"""

import json
import os
import warnings
from pathlib import Path

from .. import _core
from .._error import FmuError

_FOLDER = Path(__file__).parent


def _archives(folder):
    return {path.stem: str(path) for path in sorted((_FOLDER / folder).glob("*.fmu"))}


def _archive(folder, name):
    """The path of an archive of the wheel."""
    if name.startswith("_"):
        raise AttributeError(name)
    found = _archives(folder)
    if name not in found:
        has = ", ".join(found) or "none: it was built without them"
        raise AttributeError(f"the wheel has no drive {name} for FMI {folder[3:]}.0; it has {has}{_core.suggest(name, list(found))}")
    return found[name]


machines = {path.stem: str(path) for path in sorted((_FOLDER / "motors").glob("*.toml"))}


def tune(motor, *, fmu="PmsmDrive", estimator=None, control="speed", shaft="free", fmi=3):
    """Start values of an FMU for a machine, by the rules of `fmu tune`: a dictionary for FMPy and `fmurun`.

    The drive is not tried: `fmu tune MOTOR.toml` does that, and notes the starts and the loads at which it fails.

    Args:
        motor: a motor file, or the name of one of `machines`
        fmu: "PmsmDrive", "PmsmDriveMean", "PmsmPlant" or "SensorlessController"
        estimator: instead of that of the file, such as "Rasmussen", "Hybrid" or "Sensored"
        control: "speed", by `speed_ref`, or "torque", by `tau_ref`
        shaft: "free", the drive turns its own inertia, or "imposed", by `speed_shaft` and `angle_shaft` of a drive train
        fmi: 2 or 3: in FMI 2.0 each element of an array has its own name

    Raises:
        FmuError: the file cannot be read or is invalid, or the machine does not suit the estimator; the message names file, line and value
        ValueError: an argument is none of those

    >>> values = tune("ipmsm-2.2kw")
    >>> values["controller.estimator"], round(values["plant.motor.R_s"], 2)
    (4, 3.6)

    A vehicle or a hub motor: torque control with a sensor, and the full current limit.

    >>> values = tune("traction-100kw", estimator="Sensored", control="torque", shaft="imposed")
    >>> values["controller.speed_loop.torque_mode"], values["plant.mechanics.imposed"]
    (True, True)
    """
    models = ("PmsmDrive", "PmsmDriveMean", "PmsmPlant", "SensorlessController")
    if fmu not in models:
        raise ValueError(f"fmu must be one of {', '.join(models)}, not {fmu!r}{_core.suggest(str(fmu), list(models))}")
    if estimator is not None and fmu == "PmsmPlant":
        raise ValueError(f"estimator = {estimator!r}: PmsmPlant has no estimator; omit it")
    _standard(fmi)
    path = machines.get(motor, os.fspath(motor))
    if not os.path.isfile(path):
        raise FmuError(None, None, None, f"{path}: is neither a motor file nor one of {', '.join(machines)}{_core.suggest(str(motor), list(machines))}")
    values = json.loads(_core.tune(path, estimator, control, shaft))["PmsmDrive" if fmu == "PmsmDriveMean" else fmu]
    return _flat(values, fmi)


def from_datasheet(sheet, *, fmi=3):
    """Start values of `MappedDrive` for the drive of a data sheet, as `fmu datasheet` computes them: a dictionary for FMPy and `fmurun`.

        values = drives.from_datasheet("drive.toml") | {"plant.mechanics.imposed": True}
        result = simulate_fmu(drives.MappedDrive, start_values=values, ...)

    Args:
        sheet: the file; `fmu datasheet --example` prints one, and docs/drive-train.md describes its keys
        fmi: 2 or 3: in FMI 2.0 each element of an array has its own name

    Raises:
        FmuError: the file cannot be read or is invalid; the message names file and value
        ValueError: `fmi` is neither 2 nor 3

    Warns:
        UserWarning: a value may be wrong, for example losses that fall while the torque rises
    """
    _standard(fmi)
    values, doubts = _core.datasheet(os.fspath(sheet))
    for doubt in doubts:
        warnings.warn(doubt, stacklevel=2)
    return _flat(json.loads(values), fmi)


def _standard(fmi):
    if fmi not in (2, 3):
        raise ValueError(f"fmi must be 2 or 3, not {fmi!r}")


def _flat(values, fmi):
    """In FMI 2.0 each element of an array has its own name."""
    if fmi == 3:
        return values
    flat = {}
    for name, value in values.items():
        flat |= {f"{name}[{k}]": x for k, x in enumerate(value, 1)} if isinstance(value, list) else {name: value}
    return flat


def __getattr__(name):
    return _archive("fmi3", name)


def __dir__():
    return ["fmi2", "from_datasheet", "machines", "tune", *_archives("fmi3")]


from . import fmi2  # noqa: E402, F401  It gets its archives from here.
