"""Every case of `misuse` on every archive, each in its own process with a time-out.

With FMU_UNDER=valgrind each of them under valgrind: a wrong read or write is a failure, and so is a use of what was never
written.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from misuse import cases  # noqa: F401  (fills CASES)
from misuse.case import CASES

UNDER = os.environ.get("FMU_UNDER")
SECONDS = 60 if UNDER is None else 1200
# Python's own allocator hides what valgrind looks for.
VALGRIND = ["valgrind", "--quiet", "--error-exitcode=99", "--leak-check=no", "--num-callers=30"]


@pytest.mark.parametrize("name", list(CASES))
def test_case(name, unpacked, tmp_path):
    command = [sys.executable, "-m", "misuse", name, str(unpacked)]
    here = Path(__file__).parent
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    said = tmp_path / "valgrind"
    if UNDER == "valgrind":
        command = [*VALGRIND, f"--log-file={said}", *command]
        environment["PYTHONMALLOC"] = "malloc"
    try:
        done = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        pytest.fail(f"{name}: still running after {SECONDS} s")
    if done.returncode < 0:
        pytest.fail(f"{name}: ended by {signal.Signals(-done.returncode).name}\n{done.stderr}")
    assert done.returncode == 0, done.stderr + (said.read_text() if said.exists() else "")
    assert (done.stdout, done.stderr) == ("", ""), "the FMU printed"
