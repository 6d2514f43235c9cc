"""Every case of `misuse` on every archive, each in its own process with a time-out."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from misuse import cases  # noqa: F401  (fills CASES)
from misuse.case import CASES

SECONDS = 60


@pytest.mark.parametrize("name", list(CASES))
def test_case(name, unpacked):
    command = [sys.executable, "-m", "misuse", name, str(unpacked)]
    here = Path(__file__).parent
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        pytest.fail(f"{name}: still running after {SECONDS} s")
    if done.returncode < 0:
        pytest.fail(f"{name}: ended by {signal.Signals(-done.returncode).name}\n{done.stderr}")
    assert done.returncode == 0, done.stderr
    assert (done.stdout, done.stderr) == ("", ""), "the FMU printed"
