"""PmsmDrive with a flux map: the table of a saturating machine, the result of `fmu tune` for it, and the currents of
the drive.

`FMU_COMMAND` names the command. The table is reciprocal: i_d = x / L_d + c (x^3 + x q^2), i_q = q / L_q + c (q^3 + x^2 q), with
x = psi_d - psi_M and q = psi_q.
"""

import os
import re
import subprocess
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from fmpy import extract, instantiate_fmu, read_model_description
from fmpy.simulation import apply_start_values

N_P, R, L_D, L_Q, PSI_M, C = 3, 18e-3, 0.4e-3, 0.4e-3, 66e-3, 1e5
SPEED, H = 100.0, 1e-3  # rad/s, s
MOTOR = f"""name = "saturating"
source = "made for a test"
[machine]
n_p = {N_P}
R_s = {R}
L_d = {L_D}
L_q = {L_Q}
psi_M = {PSI_M}
[mechanics]
J = 0.005
[rating]
speed = 200.0
torque = 10.0
current = 240.0
[dc_link]
u_dc = 400.0
[flux_map]
file = "map.csv"
"""
# Torque control with a sensor on an imposed shaft.
SENSORED = {"controller.estimator": 13, "controller.start.mode": 1, "controller.emf.hold_reversal": False}
SENSORED |= {"controller.speed_loop.torque_mode": True, "plant.mechanics.imposed": True}
OUTPUTS = ["i_d", "i_q", "i_a", "tau_e", "p_in", "u_a", "u_b", "u_c"]
STEPS = 1000


def current(x, q):
    """Currents (A) at the flux linkages (Wb)."""
    return x / L_D + C * (x**3 + x * q**2), q / L_Q + C * (q**3 + x**2 * q)


def solve(equations, x, q):
    """x and q at which both equations are 0, by Newton's method with differences."""
    at = np.array([x, q])
    for _ in range(30):
        value = np.array(equations(*at))
        slopes = [(np.array(equations(*(at + step))) - value) / 1e-7 for step in 1e-7 * np.eye(2)]
        at = at - np.linalg.solve(np.array(slopes).T, value)
    return at


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    """The values of `fmu tune` for a motor file with the table."""
    folder = tmp_path_factory.mktemp("tuned")
    x, q = np.meshgrid(np.linspace(-0.13, 0.08, 15), np.linspace(-0.1, 0.1, 15))
    columns = [column.ravel() for column in (*current(x, q), x + PSI_M, q)]
    np.savetxt(folder / "map.csv", np.transpose(columns), delimiter=",", header="i_d,i_q,psi_d,psi_q", comments="")
    (folder / "m.toml").write_text(MOTOR)
    command = [os.environ["FMU_COMMAND"], "tune", folder / "m.toml", "--integers", "--out", folder]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    root = ET.parse(next(folder.glob("*.PmsmDrive.ssv"))).getroot()
    return {one.get("name"): one[0].get("value") for one in root.iter() if one.tag.endswith("}Parameter")}


def run(archive, values, torque, short):
    """The outputs on a shaft at SPEED, under this torque reference (N.m) or with the machine's terminals short."""
    values = values | SENSORED
    folder = extract(archive)
    description = read_model_description(folder)
    three = description.fmiVersion != "2.0"
    if three:
        # FMI 2.0 has a scalar for each element of the array: flux_map.w[1] and so on.
        elements = sorted((int(re.search(r"\d+", name)[0]), name) for name in values if ".flux_map.w[" in name)
        values["plant.flux_map.w"] = [values.pop(name) for _, name in elements]
    drive = instantiate_fmu(folder, description, fmi_type="CoSimulation")
    assert not apply_start_values(drive, description, values)
    reference = {v.name: v.valueReference for v in description.modelVariables}

    def of(*names):
        return [reference[name] for name in names]

    read, write = (drive.getFloat64, drive.setFloat64) if three else (drive.getReal, drive.setReal)
    drive.setBoolean(of("asc"), [short])
    if not three:
        drive.setupExperiment(startTime=0.0)
    drive.enterInitializationMode()
    drive.exitInitializationMode()
    rows = []
    for k in range(STEPS):
        write(of("speed_shaft", "angle_shaft", "tau_ref"), [SPEED, SPEED * k * H, torque])
        drive.doStep(currentCommunicationPoint=k * H, communicationStepSize=H)
        rows.append(read(of(*OUTPUTS)))
    drive.freeInstance()
    return np.array(rows)


def both(archives, values, torque, short=False):
    """The run, which is the same in both standards, bit for bit."""
    two, three = (run(archives / f"fmi{n}" / "PmsmDrive.fmu", values, torque, short) for n in (2, 3))
    assert (two == three).all()
    return dict(zip(OUTPUTS, two.T))


def test_torque(archives, tuned):
    """In steady state, the torque is that of the table at the currents of the drive."""
    result = both(archives, tuned, 60.0)
    i_d, i_q, tau = (result[name][-100:].mean() for name in ("i_d", "i_q", "tau_e"))
    x, q = solve(lambda x, q: np.subtract(current(x, q), (i_d, i_q)), 0.0, 0.0)
    assert tau == pytest.approx(1.5 * N_P * ((PSI_M + x) * i_q - q * i_d), rel=3e-3)
    # The power of the terminals: no other losses than copper's.
    assert result["p_in"][-100:].mean() == pytest.approx(tau * SPEED + 1.5 * R * (i_d**2 + i_q**2), rel=1e-3)
    # The voltage belongs to the table's flux linkage, not to constant inductances.
    phases = np.array([result[name] for name in ("u_a", "u_b", "u_c")])
    u = np.sqrt((2 / 3 * (phases - phases.mean(axis=0)) ** 2).sum(axis=0))[-100:].mean()

    def of(psi_d, psi_q):
        return np.hypot(R * i_d - N_P * SPEED * psi_q, R * i_q + N_P * SPEED * psi_d)

    assert u == pytest.approx(of(PSI_M + x, q), rel=5e-3)
    assert of(PSI_M + L_D * i_d, L_Q * i_q) > 1.05 * u


def test_short_circuit(archives, tuned):
    """The current of a short circuit, which does not depend on the controller: 0 = R i + j w psi with the currents of
    the table."""
    w = N_P * SPEED

    def equations(x, q):
        i_d, i_q = current(x, q)
        return R * i_d - w * q, R * i_q + w * (PSI_M + x)

    expected = current(*solve(equations, -PSI_M, 0.0))
    result = both(archives, tuned, 0.0, short=True)
    assert [result[name][-1] for name in ("i_d", "i_q")] == pytest.approx(expected, rel=0.01, abs=0.5)
    # Without the saturation, the current would be smaller.
    assert np.hypot(*expected) > 1.1 * PSI_M / L_D
