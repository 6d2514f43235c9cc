"""Tunable parameters set between steps of the packed FMUs: at the next sample, without a bump; a fixed one is refused."""

import pytest
from fmpy.fmi1 import FMICallException

from pair import Unit

T_S, H = 1e-4, 1e-3
SPEED = 50.0
OUT = ("speed", "u_a", "u_b", "u_c", "i_q_ref", "theta_est", "speed_est")


class Drive(Unit):
    """PmsmDrive at 50 rad/s, a load of 1 N.m just applied, stepped at the sample period."""

    def __init__(self, archives, standard):
        super().__init__(archives / f"fmi{standard}" / "PmsmDrive.fmu", {"plant.initial.speed": 0.0})
        self.k = 0
        self.run(5000, SPEED, 0.0)
        self.run(30, SPEED + 5.0, 1.0)

    def run(self, samples, speed_ref=SPEED + 5.0, tau_load=1.0):
        self.set_reals(self.of("speed_ref", "tau_load"), [speed_ref, tau_load])
        for _ in range(samples):
            self.slave.doStep(currentCommunicationPoint=self.k * T_S, communicationStepSize=T_S)
            self.k += 1
        return self.get_reals(self.of(*OUT))

    def tune(self, **values):
        names = [name.replace("__", ".") for name in values]
        self.set_reals(self.of(*names), list(values.values()))


def states(drive):
    """How an FMU's state is saved and restored."""
    if drive.fmi2:
        return drive.slave.getFMUstate, drive.slave.setFMUstate
    return drive.slave.getFMUState, drive.slave.setFMUState


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def drives(request, archives):
    pair = Drive(archives, request.param), Drive(archives, request.param)
    yield pair
    for drive in pair:
        drive.close()


@pytest.mark.parametrize(
    "name, value",
    [
        ("speed_loop.bandwidth", 40.0),
        ("speed_loop.t_is", 8.0),
        ("current.bandwidth", 800.0),
        ("rasmussen.w_n", 200.0),
        ("rasmussen.c_1", 100.0),
        ("motor.R_s", 1.6),
    ],
)
def test_a_tuned_gain_makes_no_bump_and_takes_effect(drives, name, value):
    tuned, untuned = drives
    tuned.tune(**{f"controller.{name}": value})
    assert tuned.get_reals(tuned.of(f"controller.{name}")) == [value]
    assert tuned.run(1) == pytest.approx(untuned.run(1), abs=1e-9), "the sample at which it changes"
    assert tuned.run(100) != pytest.approx(untuned.run(100), abs=1e-5), "10 ms later"


def test_a_limit_acts_at_the_next_sample(drives):
    drive, other = drives
    assert other.run(1)[4] > 0.6
    drive.tune(**{"controller.limit.i_q": 0.5})
    assert drive.run(1)[4] == pytest.approx(0.5, abs=1e-12)


def test_the_plants_resistance_acts_in_the_next_step(drives):
    drive, other = drives
    drive.tune(**{"plant.motor.R_s": 4.0})
    drive.run(1), other.run(1)
    loss, before = (unit.get_reals(unit.of("p_loss"))[0] for unit in drives)
    friction = 2e-4 * SPEED**2 + 0.03 * SPEED
    # Twice the resistance, and a current that has fallen by less than 2 Ohm T_s / L by the end of that step.
    assert 2.0 * (1.0 - 2.0 * T_S / 6e-3) ** 2 < (loss - friction) / (before - friction) < 2.0


def test_what_does_not_fit_is_refused_by_the_next_step(drives):
    """zero_speed.i_0 = 5 A does not fit into limit.i = 4 A: the step returns an error, and the previous state is
    kept."""
    drive, other = drives
    save, restore = states(drive)
    state, k = save(), drive.k
    drive.tune(**{"controller.limit.i": 4.0})
    with pytest.raises(FMICallException) as refused:
        drive.run(1)
    assert refused.value.status == 3
    restore(state)
    drive.k = k
    assert drive.get_reals(drive.of("controller.limit.i")) == [7.5]
    assert drive.run(100) == other.run(100)
    # In any order, if they fit together when the next step begins.
    drive.tune(**{"controller.limit.i": 4.0})
    drive.tune(**{"controller.zero_speed.i_0": 3.0})
    drive.run(1)
    assert drive.get_reals(drive.of("controller.limit.i")) == [4.0]


def test_a_fixed_parameter_is_refused(drives):
    for drive, name in zip(drives, ("plant.mechanics.J", "controller.T_s")):
        with pytest.raises(FMICallException) as refused:
            drive.set_reals(drive.of(name), [1e-3])
        assert refused.value.status == 3
        drive.slave.reset()
        if drive.fmi2:
            drive.slave.setupExperiment(startTime=0.0)
        drive.slave.enterInitializationMode()
        drive.slave.exitInitializationMode()


def test_saving_restoring_and_reset(drives):
    drive, _ = drives
    save, restore = states(drive)
    name = drive.of("controller.speed_loop.bandwidth")
    drive.tune(**{"controller.speed_loop.bandwidth": 40.0})
    state, k = save(), drive.k
    first = drive.run(50)
    drive.tune(**{"controller.speed_loop.bandwidth": 20.0})
    drive.run(50)
    restore(state)
    drive.k = k
    assert drive.get_reals(name) == [40.0]
    assert drive.run(50) == first
    drive.slave.reset()
    if drive.fmi2:
        drive.slave.setupExperiment(startTime=0.0)
    drive.slave.enterInitializationMode()
    assert drive.get_reals(name) == [80.0]
    drive.slave.exitInitializationMode()


def test_enable_coasts_and_power_is_what_the_current_says(drives):
    drive, other = drives
    speed, *_ = drive.run(1)
    i_dc, p_in = other.get_reals(other.of("i_dc", "p_in"))
    assert p_in == pytest.approx(325.0 * i_dc, rel=1e-12) and p_in > 10.0
    enable, enabled = drive.of("enable"), drive.of("enabled")
    assert [bool(x) for x in drive.slave.getBoolean(enabled)] == [True]
    drive.slave.setBoolean(enable, [False])
    drive.run(200)
    assert [bool(x) for x in drive.slave.getBoolean(enabled)] == [False]
    assert drive.get_reals(drive.of("i_a", "i_b", "i_c", "i_dc", "u_a")) == [0.0] * 5
    assert drive.get_reals(drive.of("speed"))[0] < speed - 5.0
