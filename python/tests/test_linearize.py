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
    "a misspelled input": ({"inputs": ["u_dcc"]}, ValueError, "did you mean u_dc"),
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


@pytest.mark.parametrize("rtol", [1e-4, 1e-9])
def test_a_gradient_is_as_exact_as_the_run(reference, rtol):
    """The solver's tolerance is not divided by the step of the difference: one step for both runs."""
    plan = Plan(reference / "fmi3" / "Dahlquist.fmu", fmi_type="ModelExchange", relative_tolerance=rtol, stop_time=2.0, step_size=2.0,
                measures={"last": "x"})  # fmt: skip
    value, gradient = plan.gradient({"k": 0.8})
    errors = abs(value["last"] / np.exp(-1.6) - 1.0), abs(gradient["last"]["k"] / (-2.0 * np.exp(-1.6)) - 1.0)
    print(f"gradient at rtol {rtol:.0e}: value {errors[0]:.1e}, derivative {errors[1]:.1e}")
    assert value["last"] == plan.run_many({"k": [0.8]})["last"][0]
    assert errors[1] <= max(10.0 * rtol, 1e-8)


def test_a_gradient_beside_runs_with_steps_of_their_own(reference, standard):
    """Where the solver adapts its steps to the values, two separate runs differ by its tolerance, divided by a step of
    1e-4."""

    def plan(rtol):
        return Plan(reference / standard.name / "VanDerPol.fmu", fmi_type="ModelExchange", relative_tolerance=rtol, stop_time=20.0,
                    step_size=20.0, measures={"x": "x0"})  # fmt: skip

    exact = plan(1e-12).gradient({"mu": 1.0})[1]["x"]["mu"]
    for rtol, goal in ((1e-4, 0.2), (1e-5, 2e-3)):
        together = abs(plan(rtol).gradient({"mu": 1.0})[1]["x"]["mu"] / exact - 1.0)
        runs = plan(rtol).run_many({"mu": [1.0 + 1e-4, 1.0 - 1e-4]})["x"]
        apart = abs((runs[0] - runs[1]) / 2e-4 / exact - 1.0)
        print(f"gradient of VanDerPol at rtol {rtol:.0e}: {together:.1e}, of two runs apart {apart:.1e}")
        assert together <= goal < apart


def test_a_gradient_across_a_bounce(reference, standard):
    """h = e g t_1 (t - t_1) - g (t - t_1)^2 / 2 after the first bounce at t_1 = sqrt(2 h_0 / g)."""
    plan = Plan(reference / standard.name / "BouncingBall.fmu", fmi_type="ModelExchange", relative_tolerance=1e-9, stop_time=0.8,
                step_size=0.1, measures={"h": "h"})  # fmt: skip
    height = lambda e, g: (t := np.sqrt(2.0 / g)) and e * g * t * (0.8 - t) - g * (0.8 - t) ** 2 / 2.0
    value, gradient = plan.gradient({"e": 0.7, "g": -9.81})
    assert abs(value["h"] - height(0.7, 9.81)) < 1e-8
    assert abs(gradient["h"]["e"] - (height(0.7 + 1e-6, 9.81) - height(0.7 - 1e-6, 9.81)) / 2e-6) < 1e-5
    assert abs(-gradient["h"]["g"] - (height(0.7, 9.81 + 1e-5) - height(0.7, 9.81 - 1e-5)) / 2e-5) < 1e-5


def test_the_gradient_of_a_locked_rotor_and_of_the_coupled_pair(standard):
    """i = u / R (1 - exp(-R t / L)) by R, which is fixed or tunable; a sampled drive at two tolerances, and in Co-Simulation."""
    r, l, u, t = 2.0, 6e-3, 10.0, 4e-3
    plan = Plan(standard / "PmsmPlant.fmu", fmi_type="ModelExchange", relative_tolerance=1e-5, stop_time=t, step_size=t,
                start_values={"u_a": u, "u_b": -u / 2, "u_c": -u / 2, "mechanics.J": 1e9}, measures={"i": "i_a"})  # fmt: skip
    _, gradient = plan.gradient({"motor.R_s": r, "motor.L_d": l})
    decay = np.exp(-r * t / l)
    by_r, by_l = -u / r**2 * (1.0 - decay) + u * t / (r * l) * decay, -u * t / l**2 * decay
    assert abs(gradient["i"]["motor.R_s"] / by_r - 1.0) < 1e-3
    assert abs(gradient["i"]["motor.L_d"] / by_l - 1.0) < 1e-3
    fmus = {"p": standard / "PmsmPlant.fmu", "c": standard / "SensorlessController.fmu"}
    arguments = {"input": {"c.speed_ref": [(0.0, 0.0), (0.005, 50.0)]}, "stop_time": 0.02, "step_size": 1e-4, "measures": {"w": "p.speed"}}
    loose, tight = (Plan(fmus, fmi_type="ModelExchange", relative_tolerance=rtol, **arguments).gradient({"p.motor.psi_M": 0.15})
                    for rtol in (1e-6, 1e-11))  # fmt: skip
    stepped = Plan(fmus, **arguments).gradient({"p.motor.psi_M": 0.15})
    slopes = [gradient["w"]["p.motor.psi_M"] for _, gradient in (loose, tight, stepped)]
    print(f"gradient of the pair {standard.name}: {slopes}")
    assert abs(slopes[0] / slopes[1] - 1.0) < 1e-4
    assert abs(slopes[2] / slopes[1] - 1.0) < 1e-3


def test_doctests(run_doctests):
    assert run_doctests("fmurun._linearize") > 2
