"""PmsmDrive with the SSV files that `fmu tune` writes for machines of `motors/`: the start, then rated torque as a step.

`FMU_TUNED` names the folder with NAME.PmsmDrive.ssv; its enumerations are integers.
"""

import os
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
# Rated speed in rad/s, rated torque in N.m, u_dc in V, time in s at which the load comes.
MACHINES = {
    "drone-22v": (1466.076572, 0.2, 22.2, 1.0),
    "ipmsm-2.2kw": (157.079633, 14.0, 540.0, 2.0),
}


def values(name):
    """Names and values of the file."""
    root = ET.parse(Path(os.environ["FMU_TUNED"]) / f"{name}.PmsmDrive.ssv").getroot()
    kinds = {"Real": float, "Integer": int, "Boolean": lambda text: text == "true"}
    return {
        parameter.get("name"): kinds[value.tag.removeprefix(SSV)](value.get("value"))
        for parameter in root.iter(f"{SSV}Parameter")
        for value in parameter
    }


@pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
@pytest.mark.parametrize("name", MACHINES)
def test_a_tuned_drive_starts_and_takes_its_rated_torque(archives, standard, name):
    rated, torque, u_dc, load = MACHINES[name]
    parameters = values(name)
    assert parameters["u_dc"] == u_dc and parameters["controller.mechanics.J"] == parameters["plant.mechanics.J"]
    speed = 0.5 * rated
    inputs = np.array(
        [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.3, speed, 0.0), (load, speed, 0.0), (load, speed, torque), (9.0, speed, torque)],
        dtype=[("time", float), ("speed_ref", float), ("tau_load", float)],
    )
    result = simulate_fmu(
        archives / f"fmi{standard}" / "PmsmDrive.fmu",
        stop_time=load + 1.0,
        step_size=1e-3,
        output_interval=1e-3,
        start_values={**parameters, "plant.initial.theta_e": 2.5},
        input=inputs,
        output=["speed", "speed_est", "tau_e", "lock_lost"],
    )
    for time in (load - 0.01, load + 1.0):
        row = result[np.searchsorted(result["time"], time - 1e-6)]
        assert row["speed"] == pytest.approx(speed, rel=0.02), (time, row)
        assert row["speed_est"] == pytest.approx(row["speed"], rel=0.02), (time, row)
        assert row["lock_lost"] < 1.0, (time, row)
    assert result["tau_e"][-1] == pytest.approx(torque, rel=0.1)
