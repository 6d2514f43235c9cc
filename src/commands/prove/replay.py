"""Replays an example in FMPy: its version, the problems that its validation finds, and the largest deviation from the reference,
relative to the largest value of the column. A cell of an array has several numbers; bytes are hexadecimal digits."""
import csv
import json
import sys

import fmpy
import numpy as np
from fmpy.validation import validate_fmu

archive, reference, stimuli, start, stop, step = sys.argv[1:]
start, stop, step = float(start), float(stop), float(step)
variables = {variable.name: variable for variable in fmpy.read_model_description(archive).modelVariables}


def columns(path):
    with open(path, newline="") as file:
        names, *rows = csv.reader(file)
    return {name: column for name, column in zip(names, zip(*rows))}


def signals(path):
    """What FMPy takes as input, a field for each column with as many numbers as a cell has; and why it does not take this one."""
    cells = columns(path)
    del cells["time"]
    strange = [name for name in cells if name not in variables or variables[name].type in ("String", "Binary")]
    if strange:
        return None, f"FMPy feeds no texts, no bytes and no elements of arrays, such as {strange[0]}"
    numbers = {name: np.array([[float(x) for x in cell.split()] for cell in column]) for name, column in cells.items()}
    moving = [name for name, x in numbers.items() if variables[name].variability != "continuous" and np.ptp(x, axis=0).any()]
    if moving:
        return None, f"FMPy steps to the changes of a discrete input such as {moving[0]}, and the reference holds it over a step"
    lengths = {name: x.shape[1] for name, x in numbers.items()}
    if set(lengths.values()) - {1} and len(lengths) > 1:
        name = max(lengths, key=lengths.get)
        return None, f"FMPy does not feed the array {name} beside another input"
    fields = [(name, float, () if n == 1 else (n,)) for name, n in lengths.items()]
    data = np.zeros(len(next(iter(numbers.values()))), dtype=[("time", float), *fields])
    data["time"] = columns(path)["time"]
    for name, x in numbers.items():
        data[name] = x[:, 0] if lengths[name] == 1 else x
    return data, None


def cell(name, value):
    """A recorded value as a cell of the reference."""
    if variables[name].type == "Binary":
        return value.hex() if isinstance(value, bytes) else value
    return value.decode() if isinstance(value, bytes) else str(value)


def deviation(name, found, expected):
    if variables[name].type in ("String", "Binary"):
        return 0.0 if [cell(name, x).strip() for x in found] == list(expected) else np.inf
    expected = np.array([[float(x) for x in row.split()] for row in expected])
    found = np.array(found, dtype=float).reshape(expected.shape)
    return np.max(np.abs(found - expected), initial=0.0) / max(np.max(np.abs(expected), initial=0.0), 1e-300)


fed, cannot = signals(stimuli) if stimuli else (None, None)
if cannot:
    print(json.dumps({"version": fmpy.__version__, "cannot": cannot, "problems": validate_fmu(archive)}))
    sys.exit()
expected = columns(reference)
times = np.array(expected.pop("time"), dtype=float)
result = fmpy.simulate_fmu(
    archive, start_time=start, stop_time=stop, output_interval=step, fmi_type="CoSimulation", output=list(expected), input=fed
)
rows = result[np.rint((times - start) / step).astype(int)]
assert np.allclose(rows["time"], times, rtol=0, atol=1e-6 * step), "other instants"
# FMPy records no texts.
recorded = {name: column for name, column in expected.items() if name in rows.dtype.names}
largest = float(max((deviation(name, rows[name], column) for name, column in recorded.items()), default=0.0))
print(json.dumps({
    "version": fmpy.__version__,
    "deviation": largest if np.isfinite(largest) else None,
    "problems": validate_fmu(archive),
}))
