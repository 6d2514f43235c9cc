"""sofirpy steps all models and then passes values on: Jacobi, `timing.delay` = 1. It reads FMI 2.0 alone."""

import pytest
from reference import DRIVE_STEP, LINKS, NAMES, RECORDED, T_S
from sofirpy import SimulationEntity, simulate


def source(experiment, h):
    """What feeds the inputs: its outputs are those of the step to come."""

    class Source(SimulationEntity):
        def __init__(self):
            self.do_step(-h)

        def do_step(self, time):
            speed_ref, load = experiment.inputs(time + h)
            self.values = {"speed_ref": speed_ref, "tau_load": load}

        def get_parameter_value(self, name):
            return self.values[name]

        def set_parameter(self, name, value):
            raise NotImplementedError

    return Source


def run(experiment, archives, start, links, recorded, h, steps, every):
    connections = {}
    for a, x, b, y in links:
        link = {"parameter_name": y, "connect_to_system": a, "connect_to_external_parameter": x}
        connections.setdefault(b, []).append(link)
    log = {}
    for name, variable in recorded:
        log.setdefault(name, []).append(variable)
    result = simulate(
        stop_time=steps * h,
        step_size=h,
        logging_step_size=every * h,
        fmu_paths=archives,
        model_classes={"source": source(experiment, h)},
        connections_config=connections,
        start_values=start,
        parameters_to_log=log,
    )
    return [[row[f"{a}.{x}"] for a, x in recorded] for _, row in result.iterrows()]


def test_pair(archives, experiment):
    fmus = {name: archives / "fmi2" / f"{NAMES[name]}.fmu" for name in NAMES}
    links = [*LINKS, ("source", "speed_ref", "controller", "speed_ref"), ("source", "tau_load", "plant", "tau_load")]
    start = {"plant": {"initial.theta_e": experiment.theta_e}}
    rows = run(experiment, fmus, start, links, RECORDED, T_S, experiment.steps, experiment.every)
    experiment.check(rows[: len(experiment.entry["jacobi"]["speed"])], "jacobi")


def test_drive(archives, experiment):
    fmus = {"drive": archives / "fmi2" / "PmsmDrive.fmu"}
    links = [("source", name, "drive", name) for name in ("speed_ref", "tau_load")]
    start = {"drive": {"plant.initial.theta_e": experiment.theta_e}}
    steps = len(experiment.entry["drive"]) - 1
    rows = run(experiment, fmus, start, links, [("drive", "speed")], DRIVE_STEP, steps, 1)
    experiment.check_drive([row[0] for row in rows], 0.0)


def test_fmi_3_stops_it(archives, experiment):
    """When this fails, sofirpy has learned FMI 3.0: run it above and tell docs/import.md."""
    fmus = {"drive": archives / "fmi3" / "PmsmDrive.fmu"}
    with pytest.raises(Exception, match="Cannot find shared library"):
        run(experiment, fmus, {}, [], [("drive", "speed")], DRIVE_STEP, 10, 1)
