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


def at(schedule, t):
    """Value of an input that holds each entry from its time on."""
    index = bisect_right([start - 1e-9 for start, _ in schedule], t)
    return schedule[index - 1][1] if index else 0.0


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
    from_plant, from_controller = plant.of(*CURRENTS, "theta_e", "speed"), controller.of(*VOLTAGES, "theta_est")
    to_plant = plant.of(*VOLTAGES, "tau_load")
    to_controller = controller.of(*CURRENTS, "theta_meas", "speed_meas", "speed_ref")
    plant.set_reals(plant.of("u_dc"), [experiment["u_dc"]])
    controller.set_reals(controller.of("u_dc"), [experiment["u_dc"]])
    speed, theta_est = [], []
    for k in range(experiment["steps"] + 1):
        t = k * T_S
        out, command = plant.get_reals(from_plant), controller.get_reals(from_controller)
        if k % experiment["every"] == 0:
            speed.append(out[4])
            theta_est.append(command[3])
        plant.set_reals(to_plant, [*command[:3], at(experiment["load"], t)])
        controller.set_reals(to_controller, [*out, at(experiment["speed_ref"], t)])
        controller.slave.setBoolean(controller.of("enable"), [t >= experiment["on"] - 1e-9])
        plant.slave.doStep(currentCommunicationPoint=t, communicationStepSize=T_S)
        controller.slave.doStep(currentCommunicationPoint=t, communicationStepSize=T_S)
    plant.close()
    controller.close()
    assert speed == experiment["speed"]
    assert theta_est == experiment["theta_est"]
