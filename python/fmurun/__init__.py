"""Runs FMUs of FMI 2.0 and FMI 3.0: FMPy's `simulate_fmu`, millions of runs, batches.

- `simulate_fmu`: one run, as FMPy does it: same arguments, same result, Co-Simulation or Model Exchange.
- `Plan`: a system of FMUs for many runs on all processors, and on clusters by `fmurun.dask.sweep`.
- `identify`: a machine's data from a record of its running drive.
- `linearize`: matrices A, B, C and D of an FMU for Model Exchange.
- `frequency_response`: gain and phase of running FMUs, sampled controllers included, with the margins of loops.
- `Batch`: many instances that step in one call, for reinforcement learning; environments in `fmurun.gym`.
- `vehicle`: a vehicle on a driving cycle with a drive: Wh/km, efficiency, losses by cause, temperatures, a figure.
- `plot`: a result, with matplotlib; notebooks show results by themselves.
- `fmurun.drives`: the drives of this wheel, and start values for machines.
- `fmurun.fmpy`: FMPy's classes for loops written by hand.

Every error of an FMU is an `FmuError`.
"""

from . import drives
from ._batch import Batch
from ._error import FmuError
from ._frequency import FrequencyResponse, frequency_response
from ._identify import identify
from ._linearize import Linearization, linearize
from ._plan import Plan
from ._plot import plot
from ._simulate import simulate_fmu
from ._vehicle import Trip, Vehicle, vehicle

__all__ = ["Batch", "FmuError", "FrequencyResponse", "Linearization", "Plan", "Trip", "Vehicle", "drives", "frequency_response", "identify",
           "linearize", "plot", "simulate_fmu", "vehicle"]  # fmt: skip
