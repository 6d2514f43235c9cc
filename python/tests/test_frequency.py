"""`frequency_response` against equations, against `linearize`, and on a sampled drive."""

import subprocess
import warnings
import zipfile

import numpy as np
import pytest
from fmurun import FmuError, frequency_response, linearize

SERVO = {"motor.n_p": 4, "motor.R_s": 0.36, "motor.L_d": 0.2e-3, "motor.L_q": 0.2e-3, "motor.psi_M": 0.0064}
FREQUENCIES = [5.0, 30.0, 200.0, 1000.0]


@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
def test_the_plant_has_the_response_of_its_linear_model(standard, fmi_type):
    values = {**SERVO, "mechanics.J": 4e-6, "mechanics.B": 1e-6, "mechanics.tau_coulomb": 0.0, "u_a": 0.0}
    for name, output in (("tau_load", "speed"), ("tau_load", "tau_e")):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            measured = frequency_response(standard / "PmsmPlant.fmu", name, output, frequencies=FREQUENCIES, start_values=values,
                                          step_size=5e-5, settle_time=0.2, amplitude=1e-4, fmi_type=fmi_type)  # fmt: skip
            linear = linearize(standard / "PmsmPlant.fmu", values, inputs=[name], outputs=[output])
        s = 2j * np.pi * measured.frequency
        expected = np.array([(linear.C @ np.linalg.solve(x * np.eye(4) - linear.A, linear.B) + linear.D)[0, 0] for x in s])
        off = np.max(np.abs(measured.value / expected - 1.0))
        print(f"{standard.name} {fmi_type} {output} / {name}: within {off:.1e} of the linear model")
        assert off < 2e-3
        assert np.allclose(measured.decibels, 20 * np.log10(np.abs(measured.value)))
        assert (measured.nonlinear < 1e-3).all() and (measured.unsettled < 1e-3).all()


def test_the_drive_has_margins(standard):
    values = {f"{part}.{name}": value for part in ("plant", "controller") for name, value in SERVO.items()}
    values |= {"plant.mechanics.J": 4e-6, "plant.mechanics.B": 0.0, "plant.mechanics.tau_coulomb": 0.0, "controller.mechanics.J": 4e-6, "u_dc": 24.0,
               "controller.estimator": "Sensored", "controller.speed_loop.bandwidth": 250.0, "controller.zero_speed.i_0": 0.0}  # fmt: skip
    closed = frequency_response(standard / "PmsmDrive.fmu", "tau_load", "tau_e", start_values=values, step_size=1e-4, settle_time=0.1,
                                frequencies=np.geomspace(4.0, 1000.0, 20))  # fmt: skip
    found = closed.open_loop().margins()
    # L = K_p (s + w_s / 4) / (s^2 J), late by the current loop: crossover about w_s, phase margin below atan(4).
    assert 0.9 < found["crossover"] * 2 * np.pi / 250.0 < 1.1
    assert 60.0 < found["phase_margin"] < np.degrees(np.arctan(4.1))
    assert found["delay_margin"] == pytest.approx(found["phase_margin"] / 360.0 / found["crossover"])
    assert closed.band()["peak"] > 0.5 and closed.band()["bandwidth"] > found["crossover"]


def test_linearize_says_what_it_leaves_out(standard):
    with pytest.warns(UserWarning, match="SensorlessController: .*time events, the next at 0.0001 s.*no continuous state"):
        linear = linearize(standard / "SensorlessController.fmu")
    assert linear.states == [] and len(linear.left_out) == 3
    with pytest.warns(UserWarning, match="PmsmDrive: the linear model leaves out its time events.*discrete outputs.*speed_est"):
        assert linearize(standard / "PmsmDrive.fmu").states == ["psi_d", "psi_q", "speed", "angle", "u_cap"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert linearize(standard / "PmsmPlant.fmu").left_out == []


def test_what_is_doubtful_or_wrong_is_said(plant):
    with pytest.warns(UserWarning, match="20 Hz: changes by .* at half the amplitude"):
        frequency_response(plant, "tau_load", "speed", frequencies=20, step_size=1e-4, settle_time=0.1, amplitude=0.2)
    for arguments, error, part in (
        ({"input": "speed"}, FmuError, "not a real input or tunable parameter"),
        ({"input": "tau_lod"}, FmuError, "has no variable tau_lod"),
        ({"output": "sped"}, FmuError, "has no variable sped"),
        ({"frequencies": [1e5]}, FmuError, "frequency 100000 Hz: expected a number above 0, and at most"),
        ({"amplitude": -1.0}, FmuError, "amplitude -1"),
        ({"threads": 0}, ValueError, "threads must be at least 1"),
        ({"settle_time": float("nan")}, ValueError, "settle_time must be finite"),
    ):
        with pytest.raises(error, match=part) as caught:
            frequency_response(**{"fmus": plant, "input": "tau_load", "output": "speed", "frequencies": 20, "step_size": 1e-4, **arguments})
        assert "\n" not in str(caught.value)


def test_an_fmu_that_crashes_is_an_error(plant, tmp_path):
    source, library, archive = tmp_path / "crash.c", tmp_path / "crash.so", tmp_path / "Crash.fmu"
    source.write_text("#include <stdlib.h>\n__attribute__((constructor)) static void crash(void) { abort(); }\n")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source], check=True)
    with zipfile.ZipFile(plant) as old, zipfile.ZipFile(archive, "w") as new:
        for name in old.namelist():
            new.writestr(name, library.read_bytes() if name.endswith(".so") else old.read(name))
    with pytest.raises(FmuError, match="^frequency_response: the process of the FMUs was killed by SIGABRT$"):
        frequency_response(archive, "tau_load", "speed", frequencies=20, step_size=1e-4)


def test_a_process_of_its_own_changes_nothing(plant):
    request = {"frequencies": [10.0, 20.0], "step_size": 1e-4, "settle_time": 0.1, "amplitude": 0.2}
    with pytest.warns(UserWarning, match="at half the amplitude") as beside:
        response = frequency_response(plant, "tau_load", "speed", **request)
    with pytest.warns(UserWarning, match="at half the amplitude") as here:
        own = frequency_response(plant, "tau_load", "speed", **request, isolate=False)
    assert (response.value == own.value).all() and response.doubts == own.doubts
    assert [(str(w.message), w.filename) for w in beside] == [(str(w.message), w.filename) for w in here]


def test_doctests(run_doctests):
    assert run_doctests("fmurun._frequency") > 1
