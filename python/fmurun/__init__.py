"""Runs FMUs of FMI 2.0 and FMI 3.0: FMPy's `simulate_fmu`, millions of runs, batches.

- `simulate_fmu`: one run, as FMPy does it: same arguments, same result, same bits.
- `Batch`: many instances that step in one call, for reinforcement learning.
- `fmurun.fmpy`: FMPy's classes for loops written by hand.

Every error of an FMU is an `FmuError`.
"""

from . import _core  # noqa: F401
from ._batch import Batch
from ._error import FmuError
from ._simulate import simulate_fmu

__all__ = ["Batch", "FmuError", "simulate_fmu"]
