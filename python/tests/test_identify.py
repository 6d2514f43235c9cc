"""`identify` of a record in memory, and of the same record in a file."""

import json
import math
import os
import subprocess

import numpy as np
import pytest

from fmurun import FmuError, identify

R_S, L_D, L_Q, PSI_M, N_P, STEP = 0.5, 4e-3, 6e-3, 0.1, 4, 1e-4


def record():
    """A machine at imposed speeds with sines of current: the voltage is what the equations give, as a mean over a step."""
    rows = 20000
    t = np.arange(rows + 1) * STEP
    w = 200.0 + 150.0 * np.sin(2.0 * t)
    theta = 200.0 * t + 75.0 * (1.0 - np.cos(2.0 * t))
    i = 5.0 * np.sin(3.0 * t) + 1j * 8.0 * np.sin(5.0 * t)
    flux = (PSI_M + L_D * i.real + 1j * L_Q * i.imag) * np.exp(1j * theta)
    stator = i * np.exp(1j * theta)
    u = np.diff(flux) / STEP + R_S * (stator[1:] + stator[:-1]) / 2.0
    stator, t, theta = stator[:-1], t[:-1], theta[:-1]
    return {
        "t": t, "u_alpha": u.real, "u_beta": u.imag, "i_alpha": stator.real, "i_beta": stator.imag,
        "theta": np.mod(theta, 2.0 * math.pi), "u_dc": np.full(rows, 300.0), "note": np.array(["x"] * rows), "w": w[:-1],
    }  # fmt: skip


@pytest.mark.skipif("FMU_COMMAND" not in os.environ, reason="FMU_COMMAND is not set")
def test_a_frame_and_a_file_give_the_same_numbers(tmp_path):
    frame = record()
    found = identify(frame, n_p=N_P, current=12.0, delay=0, zero=None)
    values = found["values"]
    for name, truth in {"R_s": R_S, "L_d": L_D, "L_q": L_Q, "psi_M": PSI_M}.items():
        assert values[name]["value"] == pytest.approx(truth, rel=2e-3), name
    assert values["J"]["value"] is None and "load is unknown" in values["J"]["refused"]
    names = list(frame)
    rows = [",".join(names)] + [",".join(str(frame[name][k]) for name in names) for k in range(len(frame["t"]))]
    (tmp_path / "record.csv").write_text("\n".join(rows))
    arguments = ["identify", tmp_path / "record.csv", "--n-p", "4", "--current", "12", "--delay", "0", "--json"]
    run = subprocess.run([os.environ["FMU_COMMAND"], *arguments], capture_output=True, text=True, check=False)
    assert run.returncode == 1 and json.loads(run.stdout) == found


def test_what_cannot_be_used_is_one_line():
    frame = record()
    for changes, message in [
        ({"u_alpha": np.full(20000, math.nan)}, "record:1:u_alpha: NaN is not a finite number"),
        ({"theta": frame["theta"][:5]}, "record: theta has 5 values, the first column 20000"),
    ]:
        with pytest.raises(FmuError, match=message):
            identify(frame | changes, n_p=4)
    with pytest.raises(FmuError, match="--n-p 0: expected 1 to 200"):
        identify(frame, n_p=0)
    with pytest.raises(FmuError, match="has no column speed3"):
        identify(frame, n_p=4, map={"speed": "speed3"})
