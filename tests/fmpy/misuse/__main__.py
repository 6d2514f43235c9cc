"""Runs one case in this process: `python -m misuse CASE FOLDER`, FOLDER an unpacked FMU.

Nothing may appear on stdout or stderr: the FMU has a logger. A failure is a traceback and an exit status.
"""

import faulthandler
import sys

from . import cases  # noqa: F401  (fills CASES)
from .abi import Fmu
from .case import CASES
from .run import alone, run


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


main(*sys.argv[1:])
