"""jaxonomy runs the whole drive from the archives of both standards.

Its block reads the outputs of the FMU, then sets the inputs and steps: another block gets what the FMU had at the communication
point before. In the pair that makes three samples from the currents to the voltage, two more than Jacobi and one more than
`timing.delay` can say, hence the drive.
"""

import numpy as np
import pytest
from jaxonomy import DiagramBuilder, SimulatorOptions, simulate
from jaxonomy.library import Constant, ModelicaFMU, Step
from reference import DRIVE_STEP


def source(schedule):
    """An input that steps once at most; half a step early: sums of steps may stay below the point they are for."""
    if not schedule:
        return Constant(0.0)
    [(time, value)] = schedule
    return Step(start_value=0.0, end_value=value, step_time=time - 0.5 * DRIVE_STEP)


@pytest.mark.parametrize("standard", ["fmi2", "fmi3"])
def test_drive(archives, experiment, standard):
    builder = DiagramBuilder()
    drive = builder.add(
        ModelicaFMU(
            str(archives / standard / "PmsmDrive.fmu"),
            DRIVE_STEP,
            input_names=["speed_ref", "tau_load"],
            output_names=["speed"],
            parameters={"plant_initial_theta_e": experiment.theta_e},
            first_step_at_zero=True,
        )
    )
    for k, name in enumerate(("speed_ref", "load")):
        block = builder.add(source(experiment.entry[name]))
        builder.connect(block.output_ports[0], drive.input_ports[k])
    diagram = builder.build()
    n = len(experiment.entry["drive"])
    options = SimulatorOptions(max_major_step_length=DRIVE_STEP)
    recorded = {"speed": drive.output_ports[0]}
    result = simulate(diagram, diagram.create_context(), (0.0, n * DRIVE_STEP), recorded_signals=recorded, options=options)
    # Besides the communication points the record has the step of the input.
    index = np.searchsorted(result.time, np.arange(n) * DRIVE_STEP + 1e-9, "right") - 1
    experiment.check_drive(np.asarray(result.outputs["speed"])[index].tolist(), 0.0)
