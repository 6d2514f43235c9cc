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
# As in misuse/__main__.py.
SECONDS = 600
# Python's own allocator hides what the sanitizer looks for; Python leaks at its end.
SANITIZED = {"LD_PRELOAD": ASAN, "ASAN_OPTIONS": "detect_leaks=0:exitcode=99", "PYTHONMALLOC": "malloc"}
# They measure memory, and the sanitizer holds back what was freed.
MEASURING = ["load_and_unload", "instances_are_freed"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Runs a case in a separate process; returns its exit code and output."""
    here, folder = Path(__file__).parent, tmp_path_factory.mktemp("printed")
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **({} if ASAN is None else SANITIZED)}
    command = [sys.executable, "-m", "misuse"]
    if not hasattr(os, "fork"):

        def alone(name, unpacked):
            done = subprocess.run([*command, name, unpacked], cwd=here, env=environment, capture_output=True, text=True, timeout=SECONDS)
            return done.returncode, done.stdout, done.stderr

        yield alone
        return
    server = subprocess.Popen(command, cwd=here, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def forked(name, unpacked):
        path = folder / f"{unpacked.parent.name}-{unpacked.name}-{name}"
        print(name, unpacked, path, sep="\t", file=server.stdin, flush=True)
        return int(server.stdout.readline()), *(path.with_suffix(kind).read_text() for kind in (".out", ".err"))

    yield forked
    server.communicate()


@pytest.mark.parametrize("name", list(CASES))
def test_case(name, unpacked, run):
    if ASAN is not None and name in MEASURING:
        pytest.skip("measures memory")
    status, printed, errors = run(name, unpacked)
    if hasattr(signal, "SIGALRM") and status == -signal.SIGALRM:
        pytest.fail(f"{name}: still running after {SECONDS} s\n{errors}")
    if status < 0:
        pytest.fail(f"{name}: ended by {signal.Signals(-status).name}\n{errors}")
    assert status == 0, errors
    assert (printed, errors) == ("", ""), "the FMU printed"
