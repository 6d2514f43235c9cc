"""gemseo-fmu runs PmsmDrive of FMI 2.0 in Co-Simulation, through the FMPy that it asks for, 0.3.19.

It sets its inputs again after initialization: pass `input_names`, and no fixed parameter among them.
"""

import numpy as np
import pytest
from gemseo_fmu.disciplines.fmu_discipline import FMUDiscipline
from reference import DRIVE_STEP

INPUTS = ["speed_ref", "tau_load"]


def drive(archives, steps, inputs, standard="fmi2", **options):
    return FMUDiscipline(
        archives / standard / "PmsmDrive.fmu",
        input_names=inputs,
        output_names=["speed"],
        initial_time=0.0,
        final_time=steps * DRIVE_STEP,
        time_step=DRIVE_STEP,
        **options,
    )


def test_drive(archives, experiment):
    if experiment.theta_e != 0.0:
        pytest.skip("plant.initial.theta_e is a fixed parameter")
    over_time = {name: lambda t, k=k: experiment.inputs(t)[k] for k, name in enumerate(INPUTS)}
    speed = drive(archives, len(experiment.entry["drive"]) - 1, INPUTS).execute(over_time)["speed"]
    experiment.check_drive(list(speed), 0.0)


# When one of these fails, gemseo-fmu has learned something: tell docs/import.md.


def test_fixed_parameters_stop_it(archives):
    with pytest.raises(Exception, match="fmi2SetReal failed"):
        drive(archives, 1, [*INPUTS, "plant.initial.theta_e"]).execute({"plant.initial.theta_e": np.array([1.0])})


def test_model_exchange_stops_it(archives):
    with pytest.raises(Exception, match="interface type must be 'CoSimulation'"):
        drive(archives, 1, INPUTS, use_co_simulation=False).execute()


def test_fmi_3_stops_it(archives):
    """FMPy before 0.3.24 reads no description of a type."""
    with pytest.raises(TypeError, match="unexpected keyword argument 'description'"):
        drive(archives, 1, INPUTS, "fmi3")
