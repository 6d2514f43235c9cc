"""The pages of python/docs: built without network, complete, and with every public name."""

import html
import re
import subprocess
import sys
from pathlib import Path

import fmurun
import fmurun.drives
import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Name -> text of each page; a warning is an error: a link that leads nowhere, a name that does not exist."""
    out = tmp_path_factory.mktemp("docs")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-d", out / "doctrees", DOCS, out / "html"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return {page.name: page.read_text() for page in (out / "html").glob("*.html")}


def test_every_public_name_has_its_place(pages):
    reference = pages["reference.html"]
    names = [f"fmurun.{name}" for name in fmurun.__all__ if name != "drives"]
    names += [f"fmurun.Plan.{name}" for name in ("simulate", "run_many", "gradient", "rows", "meta", "from_toml")]
    names += ["fmurun.Batch.step", "fmurun.Batch.reset", "fmurun.drives.tune", "fmurun.drives.from_datasheet", "fmurun.Vehicle.run", "fmurun.Trip.plot", "fmurun.dask.sweep", "fmurun.gym.Env", "fmurun.fmpy.FMU3Slave"]
    missing = [name for name in names if f'id="{name}"' not in reference]
    assert not missing


def test_pages_need_no_network(pages):
    assert len(pages) >= 12
    for name, text in pages.items():
        assert not re.search(r'<(?:script|link|img)[^>]*(?:src|href)="(?:https?:)?//', text), name


def test_the_table_of_other_packages(pages):
    text = html.unescape(re.sub(r"<[^>]+>", "", pages["migrating.html"]))
    for word in ("FMPy", "PyFMI", "OMSimulator", "get_state_space_representation", "addConnection", "plan.run_many(table)"):
        assert word in text, word
