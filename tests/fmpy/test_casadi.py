"""PmsmPlant in CasADi: its equations, exact Jacobians (forward, in FMI 3.0 adjoint too), a run of its CVODES, an optimal
control problem.

The reference is the machine in rotor axes, written down here: d psi_d/dt = u_d - R_s i_d + w psi_q and so on.
"""

import re
import subprocess
import sys
from pathlib import Path

import casadi
import numpy as np
import pytest
from fmpy import extract, simulate_fmu

n_p, R_s, L, psi_M, J, B, tau_coulomb, w_coulomb = 3, 2.0, 6e-3, 0.15, 1.5e-3, 2e-4, 0.03, 0.3
STANDARDS = pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
STATES = ("speed", "angle", "psi_d", "psi_q")
INPUTS = {"u_a": 30.0, "u_b": -10.0, "u_c": -20.0, "u_dc": 325.0, "tau_load": 0.7, "speed_shaft": 0.0, "angle_shaft": 0.0}
# Read with other values of thermal.mode only.
INPUTS |= {f"T_{name}": 293.15 for name in ("coolant", *(f"{part}_imposed" for part in ("winding", "stator", "magnet", "inverter")))}
# CasADi 3.8.2 needs them: see the tests at the end.
OPTIONS = {"enable_forward": False, "enable_reverse": False}
EXAMPLE = Path(__file__).parents[2] / "examples" / "casadi_minimum_time.py"
POINTS = np.random.default_rng(1).uniform(
    [-150.0, -3.0, 0.1, -0.05], [150.0, 3.0, 0.2, 0.05], (20, 4)
)
POINTS[0] = (0.0, 0.4, psi_M, 0.0)  # at rest, without current


def derivatives(x, u):
    """Works with CasADi's symbols too."""
    speed, angle, psi_d, psi_q = (x[k] for k in range(4))
    alpha = (2.0 * u[0] - u[1] - u[2]) / 3.0
    beta = (u[1] - u[2]) / np.sqrt(3.0)
    cos, sin, w = casadi.cos(n_p * angle), casadi.sin(n_p * angle), n_p * speed
    i_d, i_q = (psi_d - psi_M) / L, psi_q / L
    tau = 1.5 * n_p * (psi_d * i_q - psi_q * i_d)
    friction = B * speed + tau_coulomb * casadi.tanh(speed / w_coulomb)
    return [
        (tau - u[4] - friction) / J,
        speed,
        cos * alpha + sin * beta - R_s * i_d + w * psi_q,
        cos * beta - sin * alpha - R_s * i_q - w * psi_d,
    ]


def reference():
    """The reference as a function of states and inputs, with its Jacobians."""
    x, u = casadi.SX.sym("x", 4), casadi.SX.sym("u", len(INPUTS))
    ode = casadi.vertcat(*derivatives(x, u))
    return casadi.Function("reference", [x, u], [ode, casadi.jacobian(ode, x), casadi.jacobian(ode, u)])


@pytest.fixture
def plant(archives, standard):
    builder = casadi.DaeBuilder("plant", str(extract(archives / f"fmi{standard}" / "PmsmPlant.fmu")), {})
    assert tuple(builder.x()) == STATES
    assert builder.u() == list(INPUTS)
    assert builder.der(builder.x()) == [f"der({name})" for name in STATES]
    return builder


def close(value, expected, relative):
    value, expected = np.array(value), np.array(expected)
    assert np.abs(value - expected).max() < relative * max(1.0, np.abs(expected).max())


@STANDARDS
def test_equations_and_jacobians(plant, standard):
    equations = plant.create("equations", ["x", "u"], ["ode", "y"])
    jacobian = equations.factory("jacobian", ["x", "u"], ["jac:ode:x", "jac:ode:u", "jac:y:x"])
    u, exact, y = list(INPUTS.values()), reference(), plant.y()
    for x in POINTS:
        ode, by_x, by_u = exact(x, u)
        close(equations(x, u)[0], ode, 1e-12)
        jac_x, jac_u, jac_y = jacobian(x, u)
        close(jac_x, by_x, 1e-9)
        close(jac_u, by_u, 1e-9)
        # Outputs that are states, and the currents, which are linear in the flux linkages.
        jac_y = np.array(jac_y)
        assert np.array_equal(jac_y[y.index("speed")], [1.0, 0.0, 0.0, 0.0])
        close(jac_y[y.index("i_d")], [0.0, 0.0, 1.0 / L, 0.0], 1e-12)
        close(jac_y[y.index("i_q")], [0.0, 0.0, 0.0, 1.0 / L], 1e-12)


@STANDARDS
def test_adjoint(plant, standard):
    """w'(J v) = (J'w)'v; CasADi takes the adjoint derivatives of FMI 3.0, and forward ones of FMI 2.0."""
    equations = plant.create("equations", ["x", "u"], ["ode"])
    backward = equations.factory("backward", ["x", "u", "adj:ode"], ["adj:x", "adj:u"])
    u, exact, w = list(INPUTS.values()), reference(), np.array([0.3, -1.0, 2.0, 0.7])
    for x in POINTS:
        _, by_x, by_u = exact(x, u)
        adj_x, adj_u = backward(x, u, w)
        close(adj_x, by_x.T @ w, 1e-9)
        close(adj_u, by_u.T @ w, 1e-9)


@STANDARDS
def test_cvodes(plant, archives, standard):
    """20 ms at constant voltages, with FMU Jacobians inside CVODES, against co-simulation."""
    equations = plant.create("equations", ["x", "u"], ["ode"])
    x, u = casadi.MX.sym("x", 4), casadi.MX.sym("u", len(INPUTS))
    options = {"abstol": 1e-11, "reltol": 1e-11}
    dae = {"x": x, "u": u, "ode": equations(x, u)}
    run = casadi.integrator("run", "cvodes", dae, 0.0, 0.02, options)
    end = np.array(run(x0=[0.0, 0.0, psi_M, 0.0], u=list(INPUTS.values()))["xf"]).ravel()
    result = simulate_fmu(
        archives / f"fmi{standard}" / "PmsmPlant.fmu",
        fmi_type="CoSimulation",
        stop_time=0.02,
        step_size=1e-4,
        start_values=INPUTS,
        output=["speed", "angle", "psi_d", "psi_q"],
    )
    assert abs(result["speed"][-1]) > 1.0
    for name, value in zip(STATES, end):
        assert value == pytest.approx(result[name][-1], rel=1e-6), name


def defects(equations, n):
    """The Jacobian of the trapezoidal rule over n points with steps of 1 ms, by states and voltages."""
    x, u = casadi.MX.sym("x", 4, n), casadi.MX.sym("u", 3, n)
    slopes = equations.map(n)(x, casadi.vertcat(u, casadi.repmat(list(INPUTS.values())[3:], 1, n)))
    rest = x[:, 1:] - x[:, :-1] - 0.5e-3 * (slopes[:, 1:] + slopes[:, :-1])
    return casadi.Function("defects", [x, u], [casadi.jacobian(casadi.vec(rest), casadi.veccat(x, u))])


@STANDARDS
def test_mapped_equations(plant, standard):
    """The function that direct transcription differentiates."""
    x, u = casadi.SX.sym("x", 4), casadi.SX.sym("u", len(INPUTS))
    by_hand = casadi.Function("by_hand", [x, u], [casadi.vertcat(*derivatives(x, u))])
    point = POINTS.T, np.random.default_rng(2).uniform(-30.0, 30.0, (3, len(POINTS)))
    exact = np.array(defects(by_hand, len(POINTS))(*point))
    close(defects(plant.create("equations", ["x", "u"], ["ode"], OPTIONS), len(POINTS))(*point), exact, 1e-12)
    # When this fails, CasADi no longer needs the options: update docs/import.md.
    wrong = np.array(defects(plant.create("equations", ["x", "u"], ["ode"]), len(POINTS))(*point))
    assert np.abs(wrong - exact).max() > 0.1


@STANDARDS
def test_why_casadi_needs_options(plant, standard):
    """With a seed of zero it does not call the FMU, and returns the derivative of its last call (eval_ad in its fmu.cpp); with
    adjoint derivatives it writes those of every direction of `reverse(n)` to the first (eval_task in its fmu_function.cpp).
    """
    x, u, zero, seeds = POINTS[3], list(INPUTS.values()), np.zeros(len(INPUTS)), np.eye(4)[:, :2]
    by_x = np.array(reference()(x, u)[1])
    right = plant.create("right", ["x", "u"], ["ode"], OPTIONS)
    wrong = plant.create("wrong", ["x", "u"], ["ode"])
    for equations in (right, wrong):
        ode, forward = equations(x, u), equations.forward(1)
        close(forward(x, u, ode, np.eye(4)[0], zero), by_x[:, :1], 1e-9)
        close(forward(x, u, ode, np.zeros(4), zero), by_x[:, :1] * (equations is wrong), 1e-9)
    backward = [np.array(equations.reverse(2)(x, u, ode, seeds)[0]) for equations in (right, wrong)]
    close(backward[0], by_x.T @ seeds, 1e-9)
    assert np.abs(backward[1] - by_x.T @ seeds).max() > 1.0 or standard == 2


def test_the_example(archives):
    """With 7.5 A the torque is at most 1.5 n_p psi_M 7.5 A; the start takes little longer than with this torque
    throughout. In FMI 3.0 alone: the tests above have both standards."""
    done = subprocess.run([sys.executable, EXAMPLE, archives / "fmi3"], capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    iterations, t_end = re.search(r"(\d+) iterations of IPOPT: 150 rad/s after ([\d.]+) ms", done.stdout).groups()
    speed = np.linspace(0.0, 150.0, 10_001)
    slowness = J / (1.5 * n_p * psi_M * 7.5 - B * speed - tau_coulomb * np.tanh(speed / w_coulomb))
    least = 1e3 * np.sum((slowness[1:] + slowness[:-1]) / 2.0) * (speed[1] - speed[0])
    assert least < float(t_end) < 1.02 * least
    assert int(iterations) < 100
    assert "CVODES with these voltages: 150.000 rad/s" in done.stdout
