"""Ecos runs the pair from the archives of both standards.

Its fixed-step algorithm steps all instances with the inputs of the communication point, then carries all outputs over:
Jacobi, so that `timing.delay` is 1, the start value.
"""

import pytest
from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure
from reference import LINKS, NAMES, RECORDED, T_S

EcosLib.set_log_level("err")


@pytest.mark.parametrize("standard", ["fmi2", "fmi3"])
def test_pair(archives, experiment, standard):
    with EcosSimulationStructure() as structure:
        for instance, name in NAMES.items():
            structure.add_model(instance, archives / standard / f"{name}.fmu")
        for source, output, target, variable in LINKS:
            structure.make_real_connection(f"{source}::{output}", f"{target}::{variable}")
        start = {"plant::initial.theta_e": experiment.theta_e, "controller::timing.delay": experiment.delay("jacobi")}
        structure.add_parameter_set("start", start)
        with EcosSimulation(T_S, structure=structure) as simulation:
            simulation.init(parameter_set="start")
            rows = []
            for k in range(experiment.steps):
                if k % experiment.every == 0:
                    rows.append([simulation.get_real(f"{instance}::{name}") for instance, name in RECORDED])
                for instance, variable, value in experiment.changes(k):
                    simulation.set_real(f"{instance}::{variable}", value)
                simulation.step(1)
            simulation.terminate()
    experiment.check(rows, "jacobi")
