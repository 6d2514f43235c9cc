"""Notebooks of examples/: executed as they stand, and compared with what they keep."""

import os
import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

EXAMPLES = Path(__file__).parents[2] / "examples"


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


def keep(notebook, path):
    """Write a notebook without the traces of the machine and the time that ran it."""
    notebook.metadata.language_info = {"name": "python"}
    for output in (output for cell in code(notebook) for output in cell.outputs if "data" in output):
        output.metadata.clear()
        svg = re.sub(r"<dc:date>.*?</dc:date>", "", output.data["image/svg+xml"])
        output.data["image/svg+xml"] = "".join(f"{line.rstrip()}\n" for line in svg.splitlines())
    nbformat.write(notebook, path)


def check(name, tmp_path, monkeypatch):
    """Execute a notebook: it shows what it keeps, with one plot, and no trace of a machine. `UPDATE_GOLDEN=1` writes what it shows."""
    path = EXAMPLES / name
    for variable in ("IPYTHONDIR", "JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR", "MPLCONFIGDIR"):
        monkeypatch.setenv(variable, str(tmp_path / variable))
    # A cache of fonts that takes more than 5 s to build is a warning in the notebook.
    subprocess.run([sys.executable, "-c", "import matplotlib.font_manager"], check=True)
    kept, now = (nbformat.read(path, as_version=4) for _ in range(2))
    # Lines that a slow machine prints more than 0.2 s apart are two outputs, unless they are joined.
    options = {"resources": {"metadata": {"path": str(EXAMPLES)}}, "record_timing": False, "coalesce_streams": True}
    NotebookClient(now, timeout=600, startup_timeout=600, kernel_name="python3", **options).execute()
    if "UPDATE_GOLDEN" in os.environ:
        keep(now, path)
        return
    for before, after in zip(code(kept), code(now), strict=True):
        assert list(shown(before)) == list(shown(after)), f"{after.source}\n{after.outputs}"[:4000]
    assert sum("image/svg+xml" in output.get("data", {}) for cell in code(kept) for output in cell.outputs) == 1
    cells = code(kept)
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert all(not cell.metadata for cell in cells)
    text = path.read_text()
    for trace in ("/home/", "/tmp/", "/root/", "iopub", "dc:date", "Traceback"):
        assert trace not in text, trace
    assert len(text) < 150_000
