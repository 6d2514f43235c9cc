"""Minimum time from rest to 150 rad/s: an optimal control problem with the equations of `PmsmPlant`, in CasADi.

    cargo run --release -- build
    pip install casadi numpy
    python examples/casadi_minimum_time.py target/fmu/fmi3        (or target/fmu/fmi2)

Direct collocation (Radau, 3 points in each of 30 intervals). The controls are the voltages in rotor axes, constant in each
interval and inside the circle that fits into the hexagon; the current is at most 7.5 A. The FMU gives the equations and
their derivatives. It prints the number of iterations of IPOPT and the time, and checks the result with CVODES.
"""

import sys
import tempfile
import zipfile
from math import sqrt

import casadi as ca

INTERVALS, DEGREE = 30, 3
SPEED, I_MAX, U_DC = 150.0, 7.5, 325.0  # rad/s at the end, A, V
N_P, L, PSI_M = 3, 6e-3, 0.15  # the start values of motor.n_p, of motor.L_d and motor.L_q in H, of motor.psi_M in Wb
U_MAX = U_DC / sqrt(3)
SIZE = ca.DM([SPEED, 1.0, PSI_M, PSI_M])  # of the states speed, angle, psi_d, psi_q
REST = ca.DM([0.0, 0.0, PSI_M, 0.0])

folder = sys.argv[1] if len(sys.argv) > 1 else "target/fmu/fmi3"
unpacked = tempfile.TemporaryDirectory()
with zipfile.ZipFile(f"{folder}/PmsmPlant.fmu") as archive:
    archive.extractall(unpacked.name)
builder = ca.DaeBuilder("plant", unpacked.name, {})
# Without these options the derivatives of CasADi 3.8.2 are wrong: docs/import.md.
equations = builder.create("equations", ["x", "u"], ["ode"], {"enable_forward": False, "enable_reverse": False})


def slopes(x, u_dq):
    """Return the derivatives of the states at voltages in rotor axes; a column for each point."""
    cos, sin = ca.cos(N_P * x[1, :]), ca.sin(N_P * x[1, :])
    alpha, beta = cos * u_dq[0, :] - sin * u_dq[1, :], sin * u_dq[0, :] + cos * u_dq[1, :]
    set_here = {"u_a": alpha, "u_b": (sqrt(3) * beta - alpha) / 2, "u_c": -(sqrt(3) * beta + alpha) / 2}
    rows = [set_here.get(name, builder.start(name)[0] * ca.DM.ones(1, x.shape[1])) for name in builder.u()]
    return equations.map(x.shape[1])(x, ca.vertcat(*rows))


problem = ca.Opti()
T = problem.variable()
x_start = SIZE * problem.variable(4, INTERVALS)  # at the beginning of each interval
x = SIZE * problem.variable(4, INTERVALS * DEGREE)  # at the collocation points
u = U_MAX * problem.variable(2, INTERVALS)

differentiate, extrapolate, _ = ca.collocation_coeff(ca.collocation_points(DEGREE, "radau"))
f = slopes(x, ca.kron(u, ca.DM.ones(1, DEGREE)))
for k in range(INTERVALS):
    here = slice(k * DEGREE, (k + 1) * DEGREE)
    polynomial = ca.horzcat(x_start[:, k], x[:, here])
    problem.subject_to((polynomial @ differentiate - T / INTERVALS * f[:, here]) / SIZE == 0)
    end = polynomial @ extrapolate
    if k + 1 < INTERVALS:
        problem.subject_to((end - x_start[:, k + 1]) / SIZE == 0)
problem.subject_to((x_start[:, 0] - REST) / SIZE == 0)
problem.subject_to(end[0] / SPEED == 1)
problem.subject_to(ca.sum1((u / U_MAX) ** 2) <= 1)
problem.subject_to(((x[2, :] - PSI_M) / L / I_MAX) ** 2 + (x[3, :] / L / I_MAX) ** 2 <= 1)
problem.subject_to(T >= 1e-3)
problem.minimize(T)

problem.set_initial(T, 0.1)
problem.set_initial(x_start, ca.repmat(REST, 1, INTERVALS))
problem.set_initial(x, ca.repmat(REST, 1, INTERVALS * DEGREE))
problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
solution = problem.solve()
t_end, voltages = solution.value(T), ca.DM(solution.value(u))
print(f"{problem.stats()['iter_count']} iterations of IPOPT: {SPEED:.0f} rad/s after {t_end * 1e3:.3f} ms")

state, control = ca.MX.sym("x", 4), ca.MX.sym("u", 2)
dae = {"x": state, "u": control, "ode": slopes(state, control)}
run = ca.integrator("run", "cvodes", dae, 0.0, t_end / INTERVALS, {"abstol": 1e-10, "reltol": 1e-10})
end = REST
for k in range(INTERVALS):
    end = run(x0=end, u=voltages[:, k])["xf"]
i_d, i_q = float(end[2] - PSI_M) / L, float(end[3]) / L
print(f"CVODES with these voltages: {float(end[0]):.3f} rad/s, i_d {i_d:.2f} A, i_q {i_q:.2f} A")
