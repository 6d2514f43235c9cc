"""The archives under test: `FMU_ARCHIVES` names the folder that holds fmi2/NAME.fmu and fmi3/NAME.fmu.

`FMU_ONLY` names some of them, for example `fmi3-PmsmPlant`; all without it.
"""

import os
import zipfile
from pathlib import Path

import pytest
from contract import CONTRACT

FOLDER = os.environ.get("FMU_ARCHIVES")
if FOLDER is None:
    pytest.exit("set FMU_ARCHIVES to the folder that `cargo run --release -- build` wrote, target/fmu by default", 2)
# Other archives in that folder have separate tests.
NAMES = (*CONTRACT, "PmsmDrive")
ARCHIVES = sorted(path for path in Path(FOLDER).absolute().glob("fmi[23]/*.fmu") if path.stem in NAMES)
if not ARCHIVES:
    pytest.exit(f"no archive fmi2/NAME.fmu or fmi3/NAME.fmu in FMU_ARCHIVES = {FOLDER}", 2)


def name(archive):
    return f"{archive.parent.name}-{archive.stem}"


ONLY = os.environ.get("FMU_ONLY")
if ONLY is not None:
    ARCHIVES = [archive for archive in ARCHIVES if name(archive) in ONLY.split(",")]
    if not ARCHIVES:
        pytest.exit(f"no archive is named in FMU_ONLY = {ONLY}; names are like fmi3-PmsmPlant", 2)


@pytest.fixture(scope="session")
def archives():
    """The folder of the archives."""
    return Path(FOLDER).absolute()


@pytest.fixture(scope="session", params=ARCHIVES, ids=name)
def archive(request):
    """Each archive."""
    return request.param


@pytest.fixture(scope="session")
def unpacked_folders(tmp_path_factory):
    """All archives, unpacked side by side as STANDARD/NAME."""
    root = tmp_path_factory.mktemp("unpacked")
    for archive in ARCHIVES:
        with zipfile.ZipFile(archive) as file:
            file.extractall(root / archive.parent.name / archive.stem)
    return root


@pytest.fixture(scope="session", params=ARCHIVES, ids=name)
def unpacked(request, unpacked_folders):
    """The folder of each unpacked archive."""
    return unpacked_folders / request.param.parent.name / request.param.stem
