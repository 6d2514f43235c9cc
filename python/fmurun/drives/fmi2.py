"""The drives of the wheel for FMI 2.0: `fmurun.drives.fmi2.PmsmDrive` is the path of an archive."""

from . import _archive, _archives


def __getattr__(name):
    return _archive("fmi2", name)


def __dir__():
    return list(_archives("fmi2"))
