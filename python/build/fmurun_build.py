"""The build backend of `fmurun`: maturin, after the drives and the machines have been added to the package.

In a clone of the repository, Cargo builds the drives for this computer, or they are taken from `FMURUN_ARCHIVES`, a folder with fmi2/
and fmi3/ of `fmu build`. A source distribution contains them.
"""

import os
import shutil
import subprocess
from pathlib import Path

import maturin

_PACKAGE = Path(__file__).resolve().parents[1]
_DRIVES = _PACKAGE / "fmurun" / "drives"


def _copy(source, target):
    """Replaces a file atomically, because another build may run at the same time."""
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = target.with_name(f"{target.name}.{os.getpid()}")
    shutil.copyfile(source, partial)
    os.replace(partial, target)


def _drives():
    root = _PACKAGE.parent
    if not (root / "fmus").is_dir():
        return
    archives = os.environ.get("FMURUN_ARCHIVES")
    if archives is None:
        archives = Path(os.environ.get("CARGO_TARGET_DIR", root / "target")) / "fmurun-drives"
        command = ["cargo", "run", "--release", "--quiet", "--package", "cargo-fmu", "--", "fmu", "build", "--out", archives]
        subprocess.run(command, cwd=root, check=True)
    for folder in ("fmi2", "fmi3"):
        for archive in sorted((Path(archives) / folder).glob("*.fmu")):
            _copy(archive, _DRIVES / folder / archive.name)
    for motor in sorted((root / "motors").iterdir()):
        if motor.is_file():
            _copy(motor, _DRIVES / "motors" / motor.name)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    _drives()
    return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    _drives()
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)


def build_sdist(sdist_directory, config_settings=None):
    _drives()
    return maturin.build_sdist(sdist_directory, config_settings)


get_requires_for_build_wheel = maturin.get_requires_for_build_wheel
get_requires_for_build_editable = maturin.get_requires_for_build_editable
get_requires_for_build_sdist = maturin.get_requires_for_build_sdist
prepare_metadata_for_build_wheel = maturin.prepare_metadata_for_build_wheel
prepare_metadata_for_build_editable = maturin.prepare_metadata_for_build_editable
