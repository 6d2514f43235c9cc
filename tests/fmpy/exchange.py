"""Plant and controller in Model Exchange, integrated by FMPy's CVode in a loop written by hand.

The plant gives the derivatives, the controller an event at every sample instant. At an event both enter Event Mode, and
voltages and currents pass before the controller samples: it reads the currents of this instant, and its voltages act from
the next one on.
"""

from pathlib import Path
from shutil import rmtree

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model
from fmpy.sundials import CVodeSolver

CURRENTS, VOLTAGES = ("i_a", "i_b", "i_c"), ("u_a", "u_b", "u_c")
RECORDED = ("i_d", "i_q", "speed")


class Model:
    """One FMU for Model Exchange: a thin layer over FMPy that makes FMI 2.0 and FMI 3.0 look the same."""

    def __init__(self, archive, parameters=None):
        self.description = read_model_description(archive)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.fmi2 = self.description.fmiVersion == "2.0"
        self.folder = extract(archive)
        self.fmu = (FMU2Model if self.fmi2 else FMU3Model)(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.modelExchange.modelIdentifier,
            instanceName=Path(archive).stem,
        )
        self.get_reals = self.fmu.getReal if self.fmi2 else self.fmu.getFloat64
        self.set_reals = self.fmu.setReal if self.fmi2 else self.fmu.setFloat64
        self.update = self.fmu.newDiscreteStates if self.fmi2 else self.fmu.updateDiscreteStates
        self.derivatives = self.fmu.getDerivatives if self.fmi2 else self.fmu.getContinuousStateDerivatives
        self.fmu.instantiate()
        for name, value in (parameters or {}).items():
            self.set_reals([self.references[name]], [value])
        if self.fmi2:
            self.fmu.setupExperiment(startTime=0.0)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def of(self, *names):
        """Value references."""
        return [self.references[name] for name in names]

    def settle(self):
        """Updates the discrete states until the event is over; returns the time of the next event, or infinity."""
        again = True
        while again:
            again, _, _, _, defined, next_time = self.update()
        return next_time if defined else np.inf

    def close(self):
        """Ends the simulation and removes the unpacked files."""
        self.fmu.terminate()
        self.fmu.freeInstance()
        rmtree(self.folder, ignore_errors=True)


class NoInput:
    """FMPy's solver applies inputs within a step; here they change at events only."""

    def apply(self, *_, **__):
        """Nothing."""


def simulate(folder, scenario, every, tolerance=1e-9):
    """Runs a scenario with the archives of `folder`; returns the plant's outputs at multiples of `every` (s)."""
    plant = Model(f"{folder}/PmsmPlant.fmu", scenario.plant)
    controller = Model(f"{folder}/SensorlessController.fmu", scenario.controller)
    to_plant, to_controller = plant.of(*VOLTAGES, "tau_load"), controller.of(*CURRENTS, "speed_ref")
    from_plant, from_controller = plant.of(*CURRENTS), controller.of(*VOLTAGES)
    recorded = plant.of(*RECORDED)

    def event(t):
        """Both are in Event Mode."""
        plant.set_reals(to_plant, [*controller.get_reals(from_controller), scenario.load(t)])
        controller.set_reals(to_controller, [*plant.get_reals(from_plant), scenario.speed_ref(t)])
        due = min(plant.settle(), controller.settle())
        for model in (plant, controller):
            model.fmu.enterContinuousTimeMode()
        return due

    due = event(0.0)
    solver = CVodeSolver(
        nx=4,
        nz=plant.description.numberOfEventIndicators,
        get_x=plant.fmu.getContinuousStates,
        set_x=plant.fmu.setContinuousStates,
        get_dx=plant.derivatives,
        get_z=plant.fmu.getEventIndicators,
        get_nominals=plant.fmu.getNominalsOfContinuousStates,
        set_time=plant.fmu.setTime,
        input=NoInput(),
        startTime=0.0,
        relativeTolerance=tolerance,
    )
    rows, t, k = [], 0.0, 1
    while k * every <= scenario.duration + 1e-9:
        found, _, t = solver.step(t, due)
        for model in (plant, controller):
            model.fmu.setTime(t)
            model.fmu.enterEventMode()
        due = event(t)
        assert not found, "the bridge never blocks here"
        solver.reset(t)
        if abs(t - k * every) < 1e-9:
            rows.append((t, *plant.get_reals(recorded)))
            k += 1
    plant.close()
    controller.close()
    return dict(zip(("t", *RECORDED), np.array(rows).T))
