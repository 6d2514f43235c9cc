"""FMPy's Model Exchange, counted: the calls of the FMU's functions, and CVode's own counters over all its restarts."""

from collections import Counter
from ctypes import CFUNCTYPE, POINTER, byref, c_double, c_int, c_long, c_void_p
from unittest.mock import patch

import fmpy
from fmpy.sundials import NV_DATA_S, CVodeSolver
from fmpy.sundials.libraries import sundials_cvode, sundials_sunmatrixdense
from fmpy.sundials.sundials_nvector import N_Vector

# FMPy binds no function that reads a counter.
COUNTERS = ("Steps", "RhsEvals", "LinRhsEvals", "JacEvals", "GEvals", "ErrTestFails", "NonlinSolvIters", "NonlinSolvConvFails")
JACOBIAN = CFUNCTYPE(c_int, c_double, N_Vector, N_Vector, c_void_p, c_void_p, N_Vector, N_Vector, N_Vector)
sundials_sunmatrixdense.SUNDenseMatrix_Data.argtypes = [c_void_p]
sundials_sunmatrixdense.SUNDenseMatrix_Data.restype = POINTER(c_double)


def simulate(archive, exact=False, **arguments):
    """Runs `simulate_fmu` in Model Exchange with CVode; returns the result and the counts.

    `exact`: the Jacobian comes from directional derivatives, not from differences.
    """
    counts = Counter()
    description = fmpy.read_model_description(archive)
    slopes = [unknown.variable for unknown in description.derivatives]
    unknowns, states = [x.valueReference for x in slopes], [x.derivative.valueReference for x in slopes]
    instantiate = fmpy.simulation.instantiate_fmu

    def instantiate_counted(*args, **kwargs):
        fmu = instantiate(*args, **kwargs)
        name = "updateDiscreteStates" if hasattr(fmu, "updateDiscreteStates") else "newDiscreteStates"
        call, update = fmu._call, getattr(fmu, name)

        def counted(name, *args):
            counts[name[4:]] += 1
            return call(name, *args)

        def updated():
            flags = update()
            counts["nominals changed"] += flags[2]
            counts["states changed"] += flags[3]
            return flags

        fmu._call = counted
        setattr(fmu, name, updated)
        return fmu

    class Solver(CVodeSolver):
        def __init__(self, **kwargs):
            super().__init__(**kwargs)
            self.fmu = kwargs["get_x"].__self__
            if exact:
                self.jacobian_ = JACOBIAN(self.jacobian)
                set_jacobian = sundials_cvode.CVodeSetJacFn
                set_jacobian.argtypes = [c_void_p, JACOBIAN]
                assert set_jacobian(self.cvode_mem, self.jacobian_) == 0

        def jacobian(self, t, y, _slope, matrix, *_):
            self.set_time(t)
            self.set_x(NV_DATA_S(y), self.nx)
            to = sundials_sunmatrixdense.SUNDenseMatrix_Data(matrix)
            for column, state in enumerate(states):
                for row, change in enumerate(self.fmu.getDirectionalDerivative(unknowns, [state], [1.0])):
                    to[column * self.nx + row] = change
            return 0

        def count(self):
            for name in COUNTERS:
                number, get = c_long(), getattr(sundials_cvode, f"CVodeGetNum{name}")
                get.argtypes = [c_void_p, POINTER(c_long)]
                assert get(self.cvode_mem, byref(number)) == 0
                counts[name] += number.value

        def step(self, t, until):
            found, *rest = super().step(t, until)
            counts["state events"] += found
            return found, *rest

        def reset(self, t):
            self.count()
            counts["restarts"] += 1
            super().reset(t)

    with patch("fmpy.simulation.instantiate_fmu", instantiate_counted), patch("fmpy.sundials.CVodeSolver", Solver):
        result = fmpy.simulate_fmu(archive, fmi_type="ModelExchange", solver="CVode", **arguments)
    return result, counts
