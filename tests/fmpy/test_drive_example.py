"""`examples/drive.py` and `examples/drive.ipynb` run unchanged, and the notebook's stored outputs are up to date.

`UPDATE_GOLDEN=1 cargo test --test fmpy example` writes the notebook's outputs.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "common"))
import notebook

EXAMPLES = notebook.EXAMPLES


@pytest.mark.parametrize("standard", ["fmi2", "fmi3"])
def test_the_script(archives, standard, tmp_path):
    command = [sys.executable, EXAMPLES / "drive.py", archives / standard]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=600, cwd=tmp_path, env={**os.environ, "MPLBACKEND": "Agg"}
    )
    assert done.returncode == 0, done.stderr
    motor, generator = (float(re.search(r"efficiency ([\d.]+) %", line)[1]) for line in done.stdout.splitlines())
    assert 80 < generator < motor < 90, done.stdout
    labels = re.findall(r"<text[^>]*>([^<]*)</text>", (tmp_path / "drive.svg").read_text())
    assert {"speed [rpm]", "torque [N.m]", "power [W]", "efficiency [%]", "time [s]", "p_loss"} <= set(labels)


def test_the_notebook(archives, tmp_path, monkeypatch):
    monkeypatch.setenv("FMU_ARCHIVES", str(archives))
    notebook.check("drive.ipynb", tmp_path, monkeypatch)


def test_the_notebook_is_the_script():
    script = (EXAMPLES / "drive.py").read_text().splitlines()
    cells = notebook.code(nbformat.read(EXAMPLES / "drive.ipynb", as_version=4))
    lines = [line for cell in cells for line in cell.source.splitlines()]
    own = [line for line in lines if line not in script]
    assert [line.split()[0] for line in own] == ["import", "folder", "%config"], own
    left = [line for line in script[script.index("import sys") :] if line not in lines]
    assert [line.split()[0] for line in left] == ["import", "folder", 'figure.savefig("drive.svg")'], left
