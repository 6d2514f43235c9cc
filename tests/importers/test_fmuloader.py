"""fmuloader calls the FMUs, fmureader reads their descriptions: drive and pair in Co-Simulation, the drive in Model Exchange.

Both need Python 3.11.
"""

import pytest
from reference import DRIVE_STEP, LINKS, NAMES, RECORDED, T_S

pytest.importorskip("fmuloader")
import fmureader.fmi2
import fmureader.fmi3
from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
from fmuloader.fmi3 import Fmi3Slave

# Of PmsmDrive.
STATES = 5

STANDARDS = pytest.mark.parametrize("standard", ["fmi2", "fmi3"])


class Instance:
    """An instance of either standard with variables by name."""

    def __init__(self, folder, standard, name, model_exchange=False, **start):
        archive = folder / standard / f"{name}.fmu"
        self.two = standard == "fmi2"
        reader, loader = (fmureader.fmi2, Fmi2Slave) if self.two else (fmureader.fmi3, Fmi3Slave)
        description = reader.read_model_description(archive)
        variables = description.model_variables
        if self.two:
            self.reference = {v.name: v.value_reference for v in variables}
        else:
            typed = (next(t for t in v.__dict__.values() if t is not None) for v in variables)
            self.reference = {v.name: v.value_reference for v in typed}
        self.fmu = loader(archive, model_identifier=name)
        if self.two:
            kind = Fmi2Type.MODEL_EXCHANGE if model_exchange else Fmi2Type.CO_SIMULATION
            self.fmu.instantiate("instance", kind, guid=description.guid)
            self.fmu.setup_experiment(0.0)
            self.read, self.write = self.fmu.get_real, self.fmu.set_real
            self.derivatives = self.fmu.get_derivatives
        else:
            make = self.fmu.instantiate_model_exchange if model_exchange else self.fmu.instantiate_co_simulation
            make("instance", instantiation_token=description.instantiation_token)
            self.read, self.write = self.fmu.get_float64, self.fmu.set_float64
            self.derivatives = self.fmu.get_continuous_state_derivatives
        self.set(**start)
        self.fmu.enter_initialization_mode()
        self.fmu.exit_initialization_mode()
        if model_exchange:
            self.next = self.update()
            self.fmu.enter_continuous_time_mode()

    def get(self, *names):
        return self.read([self.reference[name] for name in names])

    def set(self, **values):
        names = [name.replace("__", ".") for name in values]
        if values:
            self.write([self.reference[name] for name in names], list(values.values()))

    def update(self):
        """Event iteration; the time of the next event."""
        while True:
            if self.two:
                said = self.fmu.new_discrete_states()
                again, following = said.newDiscreteStatesNeeded, said.nextEventTime
            else:
                said = self.fmu.update_discrete_states()
                again, following = said.discrete_states_need_update, said.next_event_time
            if not again:
                return following

    def event(self, **inputs):
        self.fmu.enter_event_mode()
        self.set(**inputs)
        self.next = self.update()
        self.fmu.enter_continuous_time_mode()

    def integrate(self, t, h):
        """One step of the classical Runge-Kutta method."""
        x = self.fmu.get_continuous_states(STATES)

        def slopes(share, k):
            self.fmu.set_time(t + share * h)
            self.fmu.set_continuous_states([a + share * h * b for a, b in zip(x, k)])
            return self.derivatives(STATES)

        k_1 = slopes(0.0, [0.0] * STATES)
        k_2 = slopes(0.5, k_1)
        k_3 = slopes(0.5, k_2)
        k_4 = slopes(1.0, k_3)
        slopes(1.0, [(a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(k_1, k_2, k_3, k_4)])
        assert self.fmu.completed_integrator_step() == (False, False)


@STANDARDS
def test_pair(archives, experiment, standard):
    start = {"plant": {"initial__theta_e": experiment.theta_e}, "controller": {}}
    pair = {name: Instance(archives, standard, NAMES[name], **start[name]) for name in NAMES}
    rows = []
    for k in range(experiment.steps):
        if k % experiment.every == 0:
            rows.append([pair[a].get(name)[0] for a, name in RECORDED])
        values = {a: pair[a].get(*(x for b, x, *_ in LINKS if b == a)) for a in pair}
        for name, other in (("plant", "controller"), ("controller", "plant")):
            inputs = [y for a, _, b, y in LINKS if b == name]
            pair[name].set(**dict(zip(inputs, values[other])))
        pair["controller"].set(speed_ref=experiment.speed_ref(k))
        pair["plant"].set(tau_load=experiment.load(k))
        for instance in pair.values():
            instance.fmu.do_step(k * T_S, T_S)
    experiment.check(rows, "jacobi")


@STANDARDS
def test_drive(archives, experiment, standard):
    drive = Instance(archives, standard, "PmsmDrive", plant__initial__theta_e=experiment.theta_e)
    speed = drive.get("speed")
    for k in range(len(experiment.entry["drive"]) - 1):
        speed_ref, tau_load = experiment.inputs(k * DRIVE_STEP)
        drive.set(speed_ref=speed_ref, tau_load=tau_load)
        drive.fmu.do_step(k * DRIVE_STEP, DRIVE_STEP)
        speed += drive.get("speed")
    experiment.check_drive(speed, 0.0)


@STANDARDS
def test_drive_in_model_exchange(archives, experiment, standard):
    """A Runge-Kutta step from sample to sample; the plant of Co-Simulation takes the same step in stator axes."""
    drive = Instance(archives, standard, "PmsmDrive", model_exchange=True, plant__initial__theta_e=experiment.theta_e)
    samples = round(DRIVE_STEP / T_S)
    speed = drive.get("speed")
    for k in range((len(experiment.entry["drive"]) - 1) * samples):
        assert drive.next == pytest.approx((k + 1) * T_S)
        drive.integrate(k * T_S, T_S)
        speed_ref, tau_load = experiment.inputs((k + 1) * T_S)
        drive.event(speed_ref=speed_ref, tau_load=tau_load)
        if (k + 1) % samples == 0:
            speed += drive.get("speed")
    experiment.check_drive(speed, 1e-6)
