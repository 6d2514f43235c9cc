"""gemseo-fmu runs PmsmDrive of FMI 2.0 in Co-Simulation, through the FMPy that it asks for, 0.3.19.

By default all parameters are its inputs, and a Boolean one stops it: pass `input_names`. It sets them again after the
initialization, with the same values, also fixed parameters.
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
    values = {name: lambda t, k=k: experiment.inputs(t)[k] for k, name in enumerate(INPUTS)}
    values["plant.initial.theta_e"] = np.array([experiment.theta_e])
    speed = drive(archives, len(experiment.entry["drive"]) - 1, list(values)).execute(values)["speed"]
    experiment.check_drive(list(speed), 0.0)


# When one of these fails, gemseo-fmu has learned something: tell docs/import.md.


def test_all_parameters_stop_it(archives):
    with pytest.raises(ValueError, match="could not convert string to float: 'true'"):
        drive(archives, 1, ()).execute()


def test_model_exchange_stops_it(archives):
    with pytest.raises(Exception, match="interface type must be 'CoSimulation'"):
        drive(archives, 1, INPUTS, use_co_simulation=False).execute()


def test_fmi_3_stops_it(archives):
    """FMPy before 0.3.24 reads no description of a type."""
    with pytest.raises(TypeError, match="unexpected keyword argument 'description'"):
        drive(archives, 1, INPUTS, "fmi3")
