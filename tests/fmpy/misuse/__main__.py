"""Runs one case in this process: `python -m misuse CASE FOLDER`, FOLDER an unpacked FMU.

Nothing may appear on stdout or stderr: the FMU has a logger. A failure is a traceback and an exit status.

`python -m misuse` forks a process for each line of its standard input, CASE, FOLDER and a path, separated by tabs, and prints the
exit code of each: starting Python takes ten times as long as most cases. PATH.out and PATH.err get what the process prints.
"""

import faulthandler
import os
import signal
import sys

from . import cases  # noqa: F401  (fills CASES)
from .abi import Fmu
from .case import CASES
from .run import alone, run

# A hang, even on a busy machine: a case takes seconds, under the sanitizer minutes.
SECONDS = 600


def main(name, folder):
    """The case, with a witness beside it."""
    faulthandler.enable()
    function = CASES[name]
    fmu = Fmu(folder)
    if not function.witness:
        function(fmu)
        return
    undisturbed = alone(fmu, 40)
    witness = fmu.instance(b"witness").begin()
    before = run(witness, 20)
    function(fmu)
    assert before + run(witness, 20) == undisturbed, "another instance noticed"
    witness.free()


def serve():
    """In a forked process, returns the case and the folder of a line; in this process, returns None after the last line."""
    for line in iter(sys.stdin.readline, ""):
        name, folder, path = line.rstrip("\n").split("\t")
        child = os.fork()
        if child == 0:
            files = os.devnull, f"{path}.out", f"{path}.err"
            for descriptor, file in enumerate(files):
                opened = os.open(file, os.O_WRONLY | os.O_CREAT if descriptor else os.O_RDONLY, 0o600)
                os.dup2(opened, descriptor)
                os.close(opened)
            signal.alarm(SECONDS)
            return name, folder
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
    return None


# The process of a case ends as any other does: what the FMU does at the end of its process is part of the case.
asked = sys.argv[1:] or serve()
if asked:
    main(*asked)
