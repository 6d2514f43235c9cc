"""The drives of the wheel, and values for machines.

`fmurun.drives.PmsmDrive` is the path of the archive of FMI 3.0, `fmurun.drives.fmi2.PmsmDrive` that of FMI 2.0; `machines` has the
motor files by their names. `tune` returns start values for `fmurun` and FMPy:

    from fmurun import drives, simulate_fmu

    result = simulate_fmu(drives.PmsmDrive, start_values=drives.tune("ipmsm-2.2kw") | {"speed_ref": 100.0})
"""

import json
import os
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
        raise AttributeError(f"the wheel has no drive {name} for FMI {folder[3:]}.0; it has {has}")
    return found[name]


machines = {path.stem: str(path) for path in sorted((_FOLDER / "motors").glob("*.toml"))}


def tune(motor, *, fmu="PmsmDrive", estimator=None, fmi=3):
    """Start values of an FMU for a machine, by the rules of `fmu tune`: a dictionary for FMPy and `fmurun`.

    The drive is not tried: `fmu tune MOTOR.toml` does that, and notes the starts and the loads at which it fails.

    Args:
        motor: a motor file, or the name of one of `machines`
        fmu: "PmsmDrive", "PmsmDriveMean", "PmsmPlant" or "SensorlessController"
        estimator: instead of that of the file, such as "Rasmussen", "Hybrid" or "Sensored"
        fmi: 2 or 3: in FMI 2.0 each element of an array has its own name

    Raises:
        FmuError: the file cannot be read or is invalid, or the machine does not suit the estimator; the message names file, line and value
        ValueError: an argument is none of those

    >>> values = tune("ipmsm-2.2kw")
    >>> values["controller.estimator"], round(values["plant.motor.R_s"], 2)
    (4, 3.6)
    """
    models = ("PmsmDrive", "PmsmDriveMean", "PmsmPlant", "SensorlessController")
    if fmu not in models:
        raise ValueError(f"fmu must be one of {', '.join(models)}, not {fmu!r}")
    if estimator is not None and fmu == "PmsmPlant":
        raise ValueError(f"estimator = {estimator!r}: PmsmPlant has no estimator; omit it")
    if fmi not in (2, 3):
        raise ValueError(f"fmi must be 2 or 3, not {fmi!r}")
    path = machines.get(motor, os.fspath(motor))
    if not os.path.isfile(path):
        raise FmuError(None, None, None, f"{path}: is neither a motor file nor one of {', '.join(machines)}")
    values = json.loads(_core.tune(path, estimator))["PmsmDrive" if fmu == "PmsmDriveMean" else fmu]
    if fmi == 3:
        return values
    flat = {}
    for name, value in values.items():
        flat |= {f"{name}[{k}]": x for k, x in enumerate(value, 1)} if isinstance(value, list) else {name: value}
    return flat


def __getattr__(name):
    return _archive("fmi3", name)


def __dir__():
    return ["fmi2", "machines", "tune", *_archives("fmi3")]


from . import fmi2  # noqa: E402, F401  It gets its archives from here.
