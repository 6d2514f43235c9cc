"""`linearize` against equations written here, and against differences; `Plan.gradient` against a solution."""

import numpy as np
import pytest
from fmurun import FmuError, Plan, linearize


def park(theta):
    """Phase voltages or currents to dq, amplitude-invariant."""
    angles = theta - np.array([0.0, 2.0, 4.0]) * np.pi / 3
    return 2 / 3 * np.array([np.cos(angles), -np.sin(angles)])


def test_the_plant_is_the_equations_of_the_machine(standard):
    r, l_d, l_q, psi, n_p, j, b = 2.5, 0.02, 0.04, 0.3, 3, 2e-3, 1e-3
    i_d, i_q, w, theta = -2.0, 4.0, 90.0, 0.4
    point = {"motor.R_s": r, "motor.L_d": l_d, "motor.L_q": l_q, "motor.psi_M": psi, "motor.n_p": n_p, "mechanics.J": j,
             "mechanics.B": b, "mechanics.tau_coulomb": 0.0, "psi_d": psi + l_d * i_d, "psi_q": l_q * i_q, "speed": w,
             "angle": theta / n_p, "u_a": 20.0, "u_b": -30.0, "u_c": 10.0, "tau_load": 1.0}  # fmt: skip
    linear = linearize(standard / "PmsmPlant.fmu", point, inputs=["u_a", "u_b", "u_c", "tau_load"], outputs=["tau_e", "speed", "i_d"])
    u = np.array([20.0, -30.0, 10.0])
    h = n_p * (park(theta + np.pi / 2) @ u)  # d(u_dq)/d(angle): turning by a quarter differentiates cosines
    tau = 1.5 * n_p * np.array([i_q - l_q * i_q / l_d, (psi + l_d * i_d) / l_q - i_d])
    a = np.array([
        [-r / l_d, n_p * w, n_p * l_q * i_q, h[0]],
        [-n_p * w, -r / l_q, -n_p * (psi + l_d * i_d), h[1]],
        [tau[0] / j, tau[1] / j, -b / j, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ])  # fmt: skip
    b_ = np.zeros((4, 4))
    b_[:2, :3], b_[2, 3] = park(theta), -1 / j
    assert linear.states == ["psi_d", "psi_q", "speed", "angle"]
    for name, expected in (("A", a), ("B", b_), ("C", [[*tau, 0, 0], [0, 0, 1, 0], [1 / l_d, 0, 0, 0]]), ("D", np.zeros((3, 4)))):
        found, scale = getattr(linear, name), max(1.0, np.max(np.abs(expected)))
        apart = np.max(np.abs(found - expected)) / scale
        print(f"A..D {standard.name} {name}: within {apart:.1e}")
        assert apart <= 1e-9, (name, found, expected)


def test_derivatives_are_differences(standard):
    point = {"speed": 100.0, "psi_q": 0.1, "u_a": 50.0, "u_b": -30.0, "u_c": -20.0, "tau_load": 0.5}
    exact, near = (linearize(standard / "PmsmPlant.fmu", point, method=method) for method in ("derivatives", "differences"))
    assert exact.outputs == near.outputs
    for name in "ABCD":
        a, b = getattr(exact, name), getattr(near, name)
        assert np.max(np.abs(a - b)) <= 1e-5 * max(1.0, np.max(np.abs(a))), name


def test_van_der_pol(reference, standard):
    linear = linearize(reference / standard.name / "VanDerPol.fmu", {"x0": 1.5, "x1": -0.5, "mu": 2.0})
    assert np.max(np.abs(linear.A - [[0.0, 1.0], [-1.0 + 2 * 2.0 * 1.5 * 0.5, 2.0 * (1 - 1.5**2)]])) <= 1e-9
    assert linear.B.shape == (2, 0)


WRONG = {
    "a variable": ({"point": {"sped": 1.0}}, ValueError, "has no variable sped"),
    "NaN": ({"point": {"speed": float("nan")}}, ValueError, "speed is not finite"),
    "an input": ({"inputs": ["enable"]}, ValueError, "has no continuous input enable"),
    "a method": ({"method": "guess"}, ValueError, "method must be"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_bad_input_is_one_line(plant, wrong):
    arguments, kind, part = WRONG[wrong]
    with pytest.raises(kind, match=part) as caught:
        linearize(plant, **arguments)
    assert "\n" not in str(caught.value)


def test_a_gradient(reference, plant):
    """x' = k (0 - x): dx/dk at the end is -t x."""
    archive = reference / "fmi3" / "Dahlquist.fmu"
    plan = Plan(archive, fmi_type="ModelExchange", relative_tolerance=1e-11, stop_time=2.0, step_size=0.1,
                measures={"last": "x", "area": ("x", "integral")})  # fmt: skip
    value, gradient = plan.gradient({"k": 0.8})
    assert abs(value["last"] - np.exp(-1.6)) < 1e-9
    assert abs(gradient["last"]["k"] + 2.0 * np.exp(-1.6)) < 1e-6
    assert gradient["area"]["k"] < 0
    with pytest.raises(ValueError, match="at least one variable"):
        plan.gradient({})
    with pytest.raises(ValueError, match="k must be finite"):
        plan.gradient({"k": float("nan")})
    with pytest.raises(FmuError, match="has no variable q"):
        plan.gradient({"q": 1.0})


def test_doctests(run_doctests):
    assert run_doctests("fmurun._linearize") > 2
