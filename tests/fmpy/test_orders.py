"""The runs that tests/orders/ replays in the orders of other importers, in FMPy's Model Exchange with CVode.

`FMU_ORDERS` names a JSON file with the runs and the rows that our importer gives.
"""

import json
import os

import numpy as np
import pytest
from fmpy import simulate_fmu

PATH = os.environ.get("FMU_ORDERS")
RUNS = json.load(open(PATH)) if PATH else []
# CVode starts anew at every event, and errs most there.
RELATIVE_TOLERANCE = 1e-10


def table(run):
    """Inputs as FMPy has them: two rows where one jumps."""
    times = sorted({0.0, run["times"][-1], *(t for i in run["inputs"] for t, _ in i["points"])})
    rows = [(t, after) for t in times for after in ((False, True) if t > 0 else (True,))]

    def at(points, t, after):
        return [x for since, x in points if since < t or (after and since == t)][-1]

    columns = [(i["name"], bool if i["boolean"] else float) for i in run["inputs"]]
    values = [(t, *(at(i["points"], t, after) for i in run["inputs"])) for t, after in rows]
    return np.array(values, dtype=[("time", float), *columns])


@pytest.mark.parametrize("run", RUNS, ids=lambda run: run["name"])
def test_reference(run):
    result = simulate_fmu(
        run["file"],
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=RELATIVE_TOLERANCE,
        stop_time=run["times"][-1],
        output_interval=run["times"][0],
        input=table(run) if run["inputs"] else None,
        output=run["outputs"],
        record_events=False,
    )
    times, ours = np.array(run["times"]), np.array(run["rows"])
    at = [np.abs(result["time"] - t).argmin() for t in times]
    assert np.abs(result["time"][at] - times).max() < 1e-9
    theirs = np.array([result[name][at] for name in run["outputs"]], dtype=float).T
    scale = np.abs(ours).max(axis=0)
    apart = (np.abs(theirs - ours) / np.where(scale > 0, scale, 1)).max(axis=0)
    print(f"{run['name']:32} {apart.max():8.1e} {run['outputs'][apart.argmax()]}")
    assert apart.max() <= run["tolerance"]
