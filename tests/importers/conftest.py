"""`FMU_ARCHIVES` names the folder with fmi2/NAME.fmu and fmi3/NAME.fmu, `FMU_REFERENCE` the file with the native runs."""

import os
from pathlib import Path

import pytest
from reference import EXPERIMENTS

for variable in ("FMU_ARCHIVES", "FMU_REFERENCE"):
    if variable not in os.environ:
        pytest.exit(f"{variable} is not set: run these tests with `cargo test --test importers`", 2)


@pytest.fixture(scope="session")
def archives():
    """The folder of the archives."""
    return Path(os.environ["FMU_ARCHIVES"]).absolute()


@pytest.fixture(params=EXPERIMENTS, ids=lambda e: e.name.replace(" ", "-"))
def experiment(request):
    """Each experiment."""
    return request.param
