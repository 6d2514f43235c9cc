"""Dahlquist.fmu in FMPy's interface to the C functions: intermediate updates of one step, and a step that ends early."""
import sys

import fmpy
from fmpy.fmi3 import FMU3Slave

archive = sys.argv[1]
description = fmpy.read_model_description(archive)
assert description.coSimulation.providesIntermediateUpdate
(x,) = (variable for variable in description.modelVariables if variable.name == "x")
folder = fmpy.extract(archive)


def run(act, early):
    """A step from 0 to 1 s, with what `act` does with the time and the state at each update."""

    def update(environment, time, sets, gets, finished, can_return, requested, until):
        assert sets and gets and finished and bool(can_return) == early
        end = act(time, fmu.getFloat64([x.valueReference])[0])
        if end is not None:
            requested[0], until[0] = True, end

    fmu = FMU3Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="it",
    )
    fmu.instantiate(
        earlyReturnAllowed=early, intermediateUpdate=update, requiredIntermediateVariables=[x.valueReference]
    )
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    _, _, returned, last = fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=1.0)
    end = fmu.getFloat64([x.valueReference])[0]
    fmu.terminate()
    fmu.freeInstance()
    return returned, last, end


times, rows = [], [1.0]
returned, last, end = run(lambda time, state: (times.append(time), rows.append(state))[2:] or None, early=False)
assert (returned, last, end, len(rows)) == (False, 1.0, rows[-1], 11)
assert all(abs(time - 0.1 * k) < 1e-12 for k, time in enumerate(times, 1)), times
print(*(row.hex() for row in rows))
returned, last, end = run(lambda time, state: 0.4 if abs(time - 0.3) < 1e-9 else None, early=True)
assert (returned, last, end) == (True, 0.4, rows[4]), (returned, last, end)
