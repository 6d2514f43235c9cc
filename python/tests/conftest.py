"""`FMU_ARCHIVES` names the folder that holds fmi2/NAME.fmu and fmi3/NAME.fmu, `FMURUN` the folder that fmurun is installed in."""

import doctest
import importlib
import os
import sys
from pathlib import Path

import pytest

for variable in ("FMU_ARCHIVES", "FMURUN", "FMU_REFERENCE"):
    if variable not in os.environ:
        pytest.exit(f"{variable} is not set: run `cargo test --test python`", 2)
FOLDER = Path(os.environ["FMU_ARCHIVES"]).absolute()
# Processes of Dask and joblib import it, too.
sys.path.insert(0, os.environ["FMURUN"])
os.environ["PYTHONPATH"] = os.pathsep.join([os.environ["FMURUN"], os.path.dirname(__file__)])
os.environ["OPENBLAS_NUM_THREADS"] = "1"


@pytest.fixture(scope="session")
def archives():
    """The folder of the archives."""
    return FOLDER


@pytest.fixture(scope="session", params=["fmi2", "fmi3"])
def standard(request):
    """Each standard's folder."""
    return FOLDER / request.param


@pytest.fixture(scope="session")
def plant():
    """Path of the plant's archive."""
    return FOLDER / "fmi3" / "PmsmPlant.fmu"


@pytest.fixture(scope="session")
def reference():
    """The folder of the Reference-FMUs."""
    return Path(os.environ["FMU_REFERENCE"]).absolute()


@pytest.fixture
def run_doctests():
    """Run a module's doctests; returns how many there are."""

    def run(name):
        paths = {"PLANT": str(FOLDER / "fmi3/PmsmPlant.fmu"), "CONTROLLER": str(FOLDER / "fmi3/SensorlessController.fmu")}
        failed, tried = doctest.testmod(importlib.import_module(name), extraglobs=paths, verbose=False)
        assert failed == 0
        return tried

    return run
