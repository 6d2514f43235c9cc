"""Types of `fmurun.drives`."""

from os import PathLike
from typing import Any

from . import fmi2 as fmi2

machines: dict[str, str]
MappedDrive: str
PmsmDrive: str
PmsmDriveMean: str
PmsmPlant: str
SensorlessController: str

def tune(
    motor: str | PathLike[str],
    *,
    fmu: str = "PmsmDrive",
    estimator: str | None = None,
    control: str = "speed",
    shaft: str = "free",
    fmi: int = 3,
) -> dict[str, Any]: ...
def from_datasheet(sheet: str | PathLike[str], *, fmi: int = 3) -> dict[str, Any]: ...
