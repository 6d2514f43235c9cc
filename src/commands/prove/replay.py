"""Replays an example in FMPy: its version, the problems that its validation finds, and the largest deviation from the reference,
relative to the largest value of the column."""
import csv
import json
import sys

import fmpy
import numpy as np
from fmpy.validation import validate_fmu

archive, reference, stimuli, start, stop, step = sys.argv[1:]
start, stop, step = float(start), float(stop), float(step)


def columns(path):
    with open(path, newline="") as file:
        names, *rows = csv.reader(file)
    return np.array([tuple(map(float, row)) for row in rows], dtype=[(name, float) for name in names])


expected = columns(reference)
names = list(expected.dtype.names[1:])
result = fmpy.simulate_fmu(
    archive, start_time=start, stop_time=stop, output_interval=step, fmi_type="CoSimulation", output=names,
    input=columns(stimuli) if stimuli else None,
)
rows = result[np.rint((expected["time"] - start) / step).astype(int)]
assert np.allclose(rows["time"], expected["time"], rtol=0, atol=1e-6 * step), "other instants"
deviations = [np.max(np.abs(rows[n] - expected[n])) / max(np.max(np.abs(expected[n])), 1e-300) for n in names]
print(json.dumps({
    "version": fmpy.__version__,
    "deviation": float(max(deviations, default=0.0)),
    "problems": validate_fmu(archive),
}))
