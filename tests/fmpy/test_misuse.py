"""Every case of `misuse` on every archive, each in its own process with a time-out.

FMU_ASAN names the run-time library of AddressSanitizer where the archives were compiled with it: then a read or write outside
of what the FMU owns is a failure too.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from misuse import cases  # noqa: F401  (fills CASES)
from misuse.case import CASES

ASAN = os.environ.get("FMU_ASAN")
# A hang, even on a busy machine: a case takes seconds, under the sanitizer minutes.
SECONDS = 600
# Python's own allocator hides what the sanitizer looks for; Python leaks at its end.
SANITIZED = {"LD_PRELOAD": ASAN, "ASAN_OPTIONS": "detect_leaks=0:exitcode=99", "PYTHONMALLOC": "malloc"}
# They measure memory, and the sanitizer holds back what was freed.
MEASURING = ["load_and_unload", "instances_are_freed"]


@pytest.mark.parametrize("name", list(CASES))
def test_case(name, unpacked):
    if ASAN is not None and name in MEASURING:
        pytest.skip("measures memory")
    command = [sys.executable, "-m", "misuse", name, str(unpacked)]
    here = Path(__file__).parent
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **({} if ASAN is None else SANITIZED)}
    try:
        done = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        pytest.fail(f"{name}: still running after {SECONDS} s")
    if done.returncode < 0:
        pytest.fail(f"{name}: ended by {signal.Signals(-done.returncode).name}\n{done.stderr}")
    assert done.returncode == 0, done.stderr
    assert (done.stdout, done.stderr) == ("", ""), "the FMU printed"
