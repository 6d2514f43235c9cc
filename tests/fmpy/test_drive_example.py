"""`examples/drive.py` and `examples/drive.ipynb` run as they stand, and the notebook keeps what it shows today.

`UPDATE_GOLDEN=1 cargo test --test fmpy example` writes the notebook's outputs.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

EXAMPLES = Path(__file__).parents[2] / "examples"
NOTEBOOK = EXAMPLES / "drive.ipynb"


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def shown(cell):
    """What a cell shows: kinds of output, words and numbers of its texts, size and labels of its plots."""
    for output in cell.outputs:
        yield output.output_type
        if output.output_type == "stream":
            yield from re.findall(r"[a-z_]+", output.text)
            yield from (pytest.approx(float(x), rel=0.01, abs=0.2) for x in re.findall(r"-?\d+\.\d", output.text))
        svg = output.get("data", {}).get("image/svg+xml", "")
        yield re.search(r'width="[\d.]+pt" height="[\d.]+pt"', svg) and "a plot"
        yield re.findall(r"<text[^>]*>([^<]*)</text>", svg)


def keep(notebook):
    """Write a notebook without the traces of the machine and the time that ran it."""
    notebook.metadata.language_info = {"name": "python"}
    for output in (output for cell in code(notebook) for output in cell.outputs if "data" in output):
        output.metadata.clear()
        svg = re.sub(r"<dc:date>.*?</dc:date>", "", output.data["image/svg+xml"])
        output.data["image/svg+xml"] = "".join(f"{line.rstrip()}\n" for line in svg.splitlines())
    nbformat.write(notebook, NOTEBOOK)


@pytest.mark.parametrize("standard", ["fmi2", "fmi3"])
def test_the_script(archives, standard, tmp_path):
    command = [sys.executable, EXAMPLES / "drive.py", archives / standard]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=300, cwd=tmp_path, env={**os.environ, "MPLBACKEND": "Agg"}
    )
    assert done.returncode == 0, done.stderr
    motor, generator = (float(re.search(r"efficiency ([\d.]+) %", line)[1]) for line in done.stdout.splitlines())
    assert 80 < generator < motor < 90, done.stdout
    labels = re.findall(r"<text[^>]*>([^<]*)</text>", (tmp_path / "drive.svg").read_text())
    assert {"speed [rpm]", "torque [N.m]", "power [W]", "efficiency [%]", "time [s]", "p_loss"} <= set(labels)


def test_the_notebook(archives, tmp_path, monkeypatch):
    monkeypatch.setenv("FMU_ARCHIVES", str(archives))
    for name in ("IPYTHONDIR", "JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR", "MPLCONFIGDIR"):
        monkeypatch.setenv(name, str(tmp_path / name))
    kept = nbformat.read(NOTEBOOK, as_version=4)
    now = nbformat.read(NOTEBOOK, as_version=4)
    options = {"resources": {"metadata": {"path": str(EXAMPLES)}}, "record_timing": False}
    NotebookClient(now, timeout=120, kernel_name="python3", **options).execute()
    if "UPDATE_GOLDEN" in os.environ:
        keep(now)
        return
    assert [list(shown(cell)) for cell in code(kept)] == [list(shown(cell)) for cell in code(now)]
    assert sum("image/svg+xml" in output.get("data", {}) for cell in code(kept) for output in cell.outputs) == 1


def test_the_notebook_is_the_script_and_keeps_no_trace_of_a_machine():
    script = (EXAMPLES / "drive.py").read_text().splitlines()
    cells = code(nbformat.read(NOTEBOOK, as_version=4))
    lines = [line for cell in cells for line in cell.source.splitlines()]
    own = [line for line in lines if line not in script]
    assert [line.split()[0] for line in own] == ["import", "folder", "%config"], own
    left = [line for line in script[script.index("import sys") :] if line not in lines]
    assert [line.split()[0] for line in left] == ["import", "folder", 'figure.savefig("drive.svg")'], left
    assert [cell.execution_count for cell in cells] == [1, 2, 3, 4]
    assert all(not cell.metadata for cell in cells)
    text = NOTEBOOK.read_text()
    for trace in ("/home/", "/tmp/", "/root/", "iopub", "dc:date", "Traceback"):
        assert trace not in text, trace
    assert len(text) < 150_000
