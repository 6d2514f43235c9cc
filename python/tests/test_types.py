"""The stubs: their completeness, and mypy's report for a file that uses them."""

import inspect
import os
import subprocess
import sys
from pathlib import Path

import fmurun

HERE = Path(__file__).parent


def test_mypy_finds_what_is_wrong_and_nothing_else(tmp_path):
    command = [sys.executable, "-m", "mypy", "--cache-dir", tmp_path, "--no-error-summary", HERE / "typed.py"]
    # A package of the path counts like an installed one, and py.typed says that it is typed.
    environment = {**os.environ, "MYPYPATH": os.environ["FMURUN"]}
    said = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment).stdout
    found = {int(line.split(":")[1]) for line in said.splitlines() if ": error:" in line}
    lines = (HERE / "typed.py").read_text().splitlines()
    assert found == {k for k, line in enumerate(lines, 1) if line.endswith("# wrong")}, said


def test_the_stub_has_every_argument():
    stub = (Path(fmurun.__file__).parent / "__init__.pyi").read_text()
    for function in (fmurun.simulate_fmu, fmurun.Plan.__init__, fmurun.Plan.run_many, fmurun.Batch.__new__, fmurun.Batch.reset):
        for name in inspect.signature(function).parameters:
            assert name in ("self", "cls") or f"{name}:" in stub, (function, name)
