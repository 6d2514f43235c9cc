"""The efficiency map of `fmu map` in NumPy; FMU_MAP names its folder."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(os.environ["FMU_MAP"])


def test_the_arrays_are_those_of_the_table():
    data = np.load(FOLDER / "map.npz")
    shape = tuple(len(data[axis]) for axis in ["u_dc", "T", "speed", "x"])
    assert shape == (2, 1, 11, 11)
    assert data["p_in"].shape == data["region"].shape == shape and data["tau_max"].shape == shape[:3]
    assert set(np.unique(data["region"])) <= {"mtpa", "fw", "mtpv", "limit"}
    speed = np.broadcast_to(data["speed"][:, None], shape)
    with (FOLDER / "map.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == np.isfinite(data["p_in"]).sum()
    for name, array in [("speed", speed), *((name, data[name]) for name in ["torque", "i_d", "p_cu", "efficiency"])]:
        assert [float(row[name]) for row in rows] == pytest.approx(array[np.isfinite(data["p_in"])], rel=1e-8, abs=1e-12)


def test_loss_and_efficiency():
    data = np.load(FOLDER / "map.npz")
    losses = sum(data[f"p_{name}"] for name in ["cu", "iron", "cond", "sw", "friction"])
    assert data["p_in"] == pytest.approx(data["torque"] * data["speed"][:, None] + losses, rel=1e-9, abs=1e-6)
    assert 0.95 < np.nanmax(data["efficiency"]) < 0.97
