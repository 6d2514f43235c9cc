"""Fits resistance and flux linkage of a machine to a recorded run with SciPy: Plan runs the FMU, `Plan.gradient` gives derivatives.

    pip install scipy
    python examples/fit_scipy.py target/fmu/fmi3/PmsmPlant.fmu
"""

import sys

import numpy as np
from fmurun import Plan
from scipy.optimize import least_squares

archive = sys.argv[1] if len(sys.argv) > 1 else "target/fmu/fmi3/PmsmPlant.fmu"
VOLTAGES = {"u_a": [(0.0, 8.0), (0.04, 16.0)], "u_b": [(0.0, -4.0), (0.04, -8.0)], "u_c": [(0.0, -4.0), (0.04, -8.0)]}
TIMES = np.arange(1, 17) * 5e-3
TRUE = {"motor.R_s": 3.3, "motor.psi_M": 0.33}


def main():
    measures = {f"{name} {t:.3f}": {"of": name, "is": "at", "time": float(t)} for name in ("i_a", "speed") for t in TIMES}
    plan = Plan(archive, fmi_type="ModelExchange", relative_tolerance=1e-10, input=VOLTAGES, start_values={"initial.speed": 60.0},
                stop_time=0.08, step_size=5e-3, measures=measures)  # fmt: skip
    runs = plan.run_many({name: [value] for name, value in TRUE.items()})
    recorded = np.array([runs[name][0] for name in measures])
    recorded = recorded + np.random.default_rng(1).normal(0.0, 1e-3, recorded.size)

    names = list(TRUE)
    point = lambda x: dict(zip(names, x.tolist()))

    def residual(x):
        runs = plan.run_many({name: [value] for name, value in point(x).items()})
        return np.array([runs[name][0] for name in measures]) - recorded

    def jacobian(x):
        _, gradient = plan.gradient(point(x))
        return np.array([[gradient[measure][name] for name in names] for measure in measures])

    fit = least_squares(residual, [3.0, 0.4], jac=jacobian, x_scale=[1.0, 0.1])
    spread = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)) * 2 * fit.cost / (recorded.size - len(names)))
    for name, value, sigma in zip(names, fit.x, spread):
        print(f"{name} = {value:.5f} +- {1.96 * sigma:.5f}, true {TRUE[name]}")
    return point(fit.x)


if __name__ == "__main__":
    main()
