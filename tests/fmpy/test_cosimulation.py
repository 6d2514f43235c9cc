"""FMPy co-simulates plant and controller from the packed archives and reproduces the paper's results."""

from functools import cache

import numpy as np
import pytest

from pair import simulate
from scenarios import SCENARIOS, Window

T_S = 1e-4
STANDARDS = pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
STEPS = pytest.mark.parametrize("h", [T_S, T_S / 2], ids=["T_s", "half T_s"])


@pytest.fixture(scope="session")
def run(archives):
    """The trace, simulated once."""
    return cache(lambda standard, name, h: simulate(archives / f"fmi{standard}", SCENARIOS[name], h))


def near(value, tolerance):
    return pytest.approx(value, abs=tolerance, rel=0)


@STANDARDS
@STEPS
def test_start_from_180_degrees(run, standard, h):
    trace = run(standard, "start", h)
    first, second = Window(trace, 0.2, 1.2), Window(trace, 2.2, 3.2)
    assert abs(first.error[0]) == near(180.0, 0.1)
    assert first.speed.min() == near(-340.0, 15.0)
    lowest = first.speed_est.argmin()
    assert first.speed_est[:lowest].max() == near(152.0, 10.0)
    assert first.speed_est[lowest] == near(-99.0, 10.0)
    assert first.settled(first.error, 0.0, 5.0) == near(0.14, 0.03)
    assert first.settled(first.error, 0.0, 1.0) <= 0.30
    assert abs(first.steady(first.error)) < 0.05
    assert first.steady(first.speed) == near(500.0, 1.0)
    assert second.speed.min() >= -1.0
    assert np.abs(second.error).max() == near(3.9, 1.0)


@STANDARDS
@STEPS
def test_step_to_500_rpm(run, standard, h):
    window = Window(run(standard, "step 500", h), 0.1, 1.4)
    assert window.rise(500.0) == near(0.059, 0.0059)
    assert window.speed.max() <= 505.0
    assert np.abs(window.error).max() == near(3.9, 1.0)
    assert abs(window.steady(window.error)) < 0.02


@STANDARDS
@STEPS
def test_load_step_at_standstill(run, standard, h):
    check_load_step_at_standstill(Window(run(standard, "load 0", h), 0.5, 6.5))


def check_load_step_at_standstill(window):
    assert window.speed.min() == near(-127.0, 8.0)
    assert window.settled(window.speed, 0.0, 0.5) <= 3.5
    assert window.steady(window.i_d) == near(5.0, 0.02)
    assert abs(window.steady(window.i_q)) < 0.02
    assert window.steady(window.error) == near(36.34, 0.3)


@STANDARDS
@STEPS
def test_load_step_at_1000_rpm(run, standard, h):
    window = Window(run(standard, "load 1000", h), 1.0, 2.0)
    assert 1000.0 - window.speed.min() == near(118.0, 6.0)
    assert window.settled(window.speed, 1000.0, 20.0) == near(0.105, 0.0105)
    assert abs(window.steady(window.i_d)) < 0.01
    assert window.steady(window.error) == near(0.12, 0.03)


@STANDARDS
@pytest.mark.parametrize(("speed", "error"), [(500, 0.91), (1000, 1.83), (1500, 2.74)])
def test_three_samples_per_step(run, standard, speed, error):
    """A longer communication step holds the inputs over three samples: a known angle error, and no loss."""
    window = Window(run(standard, f"step {speed}", 3 * T_S), 0.1, 1.4)
    assert window.steady(window.speed) == near(speed, 0.01 * speed)
    assert window.steady(window.error) == near(error, 0.2)
    assert np.abs(window.error).max() < 11.0


@STANDARDS
def test_three_samples_per_step_at_standstill(run, standard):
    check_load_step_at_standstill(Window(run(standard, "load 0", 3 * T_S), 0.5, 6.5))


@STANDARDS
def test_three_samples_per_step_from_180_degrees(run, standard):
    window = Window(run(standard, "start", 3 * T_S), 0.2, 1.2)
    assert window.settled(window.error, 0.0, 5.0) == near(0.18, 0.03)


@pytest.mark.parametrize("name", ["start", "step 500", "load 0", "load 1000"])
@pytest.mark.parametrize("h", [T_S, T_S / 2, 3 * T_S], ids=["T_s", "half T_s", "3 T_s"])
def test_both_standards_agree(run, name, h):
    """Bit for bit: both use the same binary and the same model."""
    one, other = run(2, name, h), run(3, name, h)
    for column, values in one.items():
        assert values.tobytes() == other[column].tobytes(), column


@pytest.mark.parametrize("name", ["start", "step 500", "load 0", "load 1000"])
def test_half_a_sample_per_step_changes_nothing(run, name):
    """At the sample instants, apart from the error of an integration step of T_s: 1e-6 A, which the current controller
    makes 1e-5 V."""
    whole, half = run(2, name, T_S), run(2, name, T_S / 2)
    for column, values in whole.items():
        turn = 2 * np.pi if column.startswith("theta") else np.inf
        apart = np.abs(values - half[column])
        apart = np.minimum(apart, np.abs(turn - apart))
        assert apart.max() < (1e-5 if column.startswith("u_") else 1e-6), column
