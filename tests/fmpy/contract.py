"""What scripts outside the project rely on: names, causalities, units, display units and start values.

They are repeated here on purpose, so that a change of the tables in Rust cannot go unnoticed. More variables may
join; none of these may be renamed, dropped or given another start value.
"""

import math
from typing import NamedTuple

RPM, DEG = 30.0 / math.pi, 180.0 / math.pi
DISPLAY = {"rpm": ("rad/s", RPM), "deg": ("rad", DEG)}
ESTIMATORS = (
    "Rasmussen DirectEmf EmfObserver ExtendedEmf VoltageModel CurrentModel VoltageFeedback RotatingInjection "
    "PulsatingInjection SquareWaveInjection NearPwmInjection Hybrid Sensored KalmanFilter "
    "FluxObserver GradientObserver SlidingMode"
).split()


class Row(NamedTuple):
    """A variable; no start value for an output, no unit for a number without one."""

    name: str
    causality: str
    unit: str | None
    start: float | int | bool | None = None
    display: str | None = None
    type: str = "Real"


def inputs(unit, *names, start=0.0, display=None):
    return [Row(name, "input", unit, start, display) for name in names]


def outputs(unit, *names, display=None):
    return [Row(name, "output", unit, None, display) for name in names]


def parameter(name, unit, start, display=None, type="Real"):
    return Row(name, "parameter", unit, start, display, type)


def motor(R_s):
    return [
        parameter("motor.n_p", None, 3, type="Integer"),
        parameter("motor.R_s", "Ohm", R_s),
        parameter("motor.L_d", "H", 6e-3),
        parameter("motor.L_q", "H", 6e-3),
        parameter("motor.psi_M", "Wb", 0.15),
    ]


PLANT = [
    *inputs("V", "u_a", "u_b", "u_c"),
    *inputs("V", "u_dc", start=325.0),
    *inputs("N.m", "tau_load"),
    *outputs("A", "i_a", "i_b", "i_c", "i_d", "i_q"),
    *outputs("rad/s", "speed", display="rpm"),
    *outputs("rad", "angle", "theta_e", display="deg"),
    *outputs("N.m", "tau_e"),
    *inputs("rad/s", "speed_shaft", display="rpm"),
    *inputs("rad", "angle_shaft", display="deg"),
    Row("enable", "input", None, True, None, "Boolean"),
    *outputs("A", "i_dc"),
    *outputs("W", "p_in", "p_mech", "p_loss"),
    *outputs("N.m", "tau_shaft"),
    *outputs("J", "energy_in", "energy_mech", "energy_loss"),
    *motor(2.0),
    parameter("mechanics.J", "kg.m2", 1.5e-3),
    parameter("mechanics.B", "N.m.s/rad", 2e-4),
    parameter("mechanics.tau_coulomb", "N.m", 0.03),
    parameter("mechanics.w_coulomb", "rad/s", 0.3, "rpm"),
    parameter("mechanics.imposed", None, False, type="Boolean"),
    parameter("initial.theta_e", "rad", 0.0, "deg"),
    parameter("initial.speed", "rad/s", 0.0, "rpm"),
]

CONTROLLER = [
    *inputs("A", "i_a", "i_b", "i_c"),
    *inputs("V", "u_dc", start=325.0),
    *inputs("rad/s", "speed_ref", "speed_meas", display="rpm"),
    *inputs("rad", "theta_meas", display="deg"),
    *inputs("N.m", "tau_ref"),
    Row("enable", "input", None, True, None, "Boolean"),
    Row("enabled", "output", None, None, None, "Boolean"),
    Row("voltage_limited", "output", None, None, None, "Boolean"),
    Row("current_limited", "output", None, None, None, "Boolean"),
    *outputs("V", "u_a", "u_b", "u_c"),
    *outputs("rad/s", "speed_est", display="rpm"),
    *outputs("rad", "theta_est", display="deg"),
    *outputs("A", "i_d", "i_q", "i_d_ref", "i_q_ref"),
    parameter("T_s", "s", 1e-4),
    parameter("timing.delay", None, 1, type="Integer"),
    parameter("estimator", None, 1, type="Enumeration"),
    *motor(1.8),
    parameter("rasmussen.c_1", "1/s", 50.0),
    parameter("rasmussen.c_2", "1/s", 1.0),
    parameter("rasmussen.w_n", "rad/s", 300.0),
    parameter("rasmussen.zeta", None, 1.0),
    parameter("current.bandwidth", "rad/s", 2 * math.pi * 250.0),
    parameter("current.active_resistance", None, False, type="Boolean"),
    parameter("speed_loop.bandwidth", "rad/s", 80.0),
    parameter("speed_loop.t_is", None, 4.0),
    parameter("speed_loop.b", None, 0.5),
    parameter("speed_loop.ramp", "rad/s2", 0.0),
    parameter("speed_loop.torque_mode", None, False, type="Boolean"),
    parameter("mechanics.J", "kg.m2", 1.5e-3),
    parameter("limit.i_q", "A", 6.0),
    parameter("limit.i", "A", 7.5),
    parameter("zero_speed.i_0", "A", 5.0),
    parameter("zero_speed.w_0", "rad/s", 10.0, "rpm"),
    parameter("initial.theta_est", "rad", 0.0, "deg"),
]

CONTRACT = {"PmsmPlant": PLANT, "SensorlessController": CONTROLLER}
VARIABILITY = {"PmsmPlant": "continuous", "SensorlessController": "discrete"}  # of the outputs
