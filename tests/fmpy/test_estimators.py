"""A start and a load step for every estimator of the controller, with fmpy, against the native run of the same Jacobi loop.

`FMU_ESTIMATORS` names the JSON file with the experiments: parameters, inputs over time, and the speed and estimated angle
that the Rust types gave. The packed FMUs have to give the same numbers to the last bit.
"""

import json
import os
from bisect import bisect_right
from pathlib import Path

import pytest

from pair import Unit

FILE = os.environ.get("FMU_ESTIMATORS")
EXPERIMENTS = json.loads(Path(FILE).read_text()) if FILE else []
T_S = 1e-4
CURRENTS, VOLTAGES = ("i_a", "i_b", "i_c"), ("u_a", "u_b", "u_c")


def split(parameters):
    """Real parameters, integers and enumerations, and Booleans."""
    reals = {n: v for n, v in parameters.items() if isinstance(v, float)}
    booleans = {n: v for n, v in parameters.items() if isinstance(v, bool)}
    integers = {n: v for n, v in parameters.items() if n not in reals and n not in booleans}
    return {"parameters": reals, "integers": integers, "booleans": booleans}


def at(schedule):
    """An input that holds each entry from its time on, as a function of time."""
    starts = [start - 1e-9 for start, _ in schedule]
    values = [0.0, *(value for _, value in schedule)]
    return lambda t: values[bisect_right(starts, t)]


def test_every_estimator_is_here(archives):
    """Each item of the enumeration in the XML has its two experiments."""
    unit = Unit(archives / "fmi3" / "SensorlessController.fmu")
    items = [v.declaredType.items for v in unit.description.modelVariables if v.name == "estimator"][0]
    unit.close()
    names = {item.name for item in items}
    assert {e["name"].split(":")[0] for e in EXPERIMENTS} == names


@pytest.mark.parametrize("standard", ["fmi2", "fmi3"])
@pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda e: e["name"].replace(": ", "-").replace(" ", "-"))
def test_as_native(archives, standard, experiment):
    plant = Unit(archives / standard / "PmsmPlant.fmu", **split(experiment["plant"]))
    controller = Unit(archives / standard / "SensorlessController.fmu", **split(experiment["controller"]))
    from_plant, from_controller = plant.reader(*CURRENTS, "theta_e", "speed"), controller.reader(*VOLTAGES, "theta_est")
    to_plant = plant.writer(*VOLTAGES, "tau_load")
    to_controller = controller.writer(*CURRENTS, "theta_meas", "speed_meas", "speed_ref")
    step_plant, step_controller = plant.stepper(T_S), controller.stepper(T_S)
    enable, enabled = controller.of("enable"), None
    plant.set_reals(plant.of("u_dc"), [experiment["u_dc"]])
    controller.set_reals(controller.of("u_dc"), [experiment["u_dc"]])
    speed, theta_est = [], []
    load, speed_ref = at(experiment["load"]), at(experiment["speed_ref"])
    for k in range(experiment["steps"] + 1):
        t = k * T_S
        out, command = from_plant(), from_controller()
        if k % experiment["every"] == 0:
            speed.append(out[4])
            theta_est.append(command[3])
        to_plant(*command[:3], load(t))
        to_controller(*out, speed_ref(t))
        if (on := t >= experiment["on"] - 1e-9) is not enabled:
            controller.slave.setBoolean(enable, [on])
            enabled = on
        step_plant(t)
        step_controller(t)
    plant.close()
    controller.close()
    assert speed == experiment["speed"]
    assert theta_est == experiment["theta_est"]
