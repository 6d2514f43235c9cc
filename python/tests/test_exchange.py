"""Model Exchange, event mode, early return and callbacks of `simulate_fmu`, against FMPy 0.3.32 and by themselves."""

import re
import warnings

import fmpy
import fmurun.fmpy
import numpy as np
import pytest
from fmurun import FmuError, simulate_fmu
from test_figures import LONG, SLACK, ratio, report

# Controllers without a motor warn of their lost rotor.
pytestmark = pytest.mark.filterwarnings("ignore:SensorlessController:UserWarning")

VOLTAGES = {"u_a": 10.0, "u_b": -5.0, "u_c": -5.0}
LOAD = np.array([(0.0, 0.0), (0.0057, 0.0), (0.0057, 1.0), (0.02, 1.5)], dtype=[("time", float), ("tau_load", float)])
SPEED = np.array([(0.0, 0.0), (0.00513, 30.0), (0.00513, 50.0), (0.02, 50.0)], dtype=[("time", float), ("speed_ref", float)])
DRIVES = {
    "PmsmPlant": {"stop_time": 0.02, "start_values": VOLTAGES, "input": LOAD},
    "SensorlessController": {"stop_time": 0.02, "input": SPEED, "output": ["u_a", "speed_est", "enabled"]},
    "PmsmDrive": {"stop_time": 0.02, "output_interval": 1e-3, "step_size": 1e-3, "input": SPEED},
}
REFERENCE = {"BouncingBall": {}, "VanDerPol": {"stop_time": 5.0}, "Stair": {}}


@pytest.fixture(params=[*DRIVES, *REFERENCE])
def case(request, standard, reference):
    """Path and arguments of a simulation of each FMU."""
    name = request.param
    folder = standard if name in DRIVES else reference / standard.name
    return folder / f"{name}.fmu", {"fmi_type": "ModelExchange", **(DRIVES | REFERENCE)[name]}


def test_euler_has_fmpys_bits(case):
    archive, arguments = case
    for more in ({}, {"record_events": False}):
        theirs = fmpy.simulate_fmu(archive, solver="Euler", **arguments | more)
        ours = simulate_fmu(archive, solver="Euler", **arguments | more)
        assert ours.dtype == theirs.dtype
        assert ours.tobytes() == theirs.tobytes()
        assert len(ours) > 10


def test_dopri_is_near_cvode(case):
    """At a relative tolerance of 1e-9, within 1e-6 of FMPy's CVode at 1e-11, with the same rows."""
    archive, arguments = case
    if archive.stem == "PmsmPlant":
        # FMPy sets the inputs of CVode's derivatives only where there are event indicators: no ramp for this FMU.
        held = LOAD.copy()
        held["tau_load"][-1] = held["tau_load"][-2]
        arguments = arguments | {"input": held}
    theirs = fmpy.simulate_fmu(archive, solver="CVode", relative_tolerance=1e-11, **arguments)
    ours = simulate_fmu(archive, relative_tolerance=1e-9, **arguments)
    assert len(ours) == len(theirs) > 10
    apart = 0.0
    for name in theirs.dtype.names:
        x, y = ours[name].astype(float), theirs[name].astype(float)
        apart = max(apart, np.max(np.abs(x - y)) / max(1.0, np.max(np.abs(y))))
    report("ME", f"{archive.parent.name}/{archive.stem}: within {apart:.1e} of CVode")
    assert apart <= 1e-6


def test_rk4_converges_with_order_4(reference):
    archive, arguments = reference / "fmi3" / "VanDerPol.fmu", {"stop_time": 2.0, "output_interval": 0.1, "fmi_type": "ModelExchange"}
    exact = simulate_fmu(archive, relative_tolerance=1e-12, **arguments)["x0"][-1]
    errors = [abs(simulate_fmu(archive, solver="RK4", step_size=h, **arguments)["x0"][-1] - exact) for h in (0.1, 0.05, 0.025)]
    assert all(10.0 < a / b < 25.0 for a, b in zip(errors, errors[1:])), errors


def test_events_are_located_and_recorded(reference):
    """The ball meets the ground at sqrt(2 h / g): two rows at that time, before and after the jump of its speed."""
    archive = reference / "fmi3" / "BouncingBall.fmu"
    result = simulate_fmu(archive, fmi_type="ModelExchange", stop_time=1.0, output_interval=0.1, relative_tolerance=1e-10)
    twice = result[:-1][np.diff(result["time"]) == 0]
    assert abs(twice["time"][0] - np.sqrt(2 / 9.81)) < 1e-8
    assert twice["v"][0] < 0 < result["v"][np.flatnonzero(np.diff(result["time"]) == 0)[0] + 1]
    without = simulate_fmu(archive, fmi_type="ModelExchange", stop_time=1.0, output_interval=0.1, record_events=False)
    assert np.allclose(without["time"], np.arange(11) * 0.1)


def test_a_callback_ends_it(reference):
    archive, seen = reference / "fmi2" / "VanDerPol.fmu", []

    def step_finished(time, recorder):
        seen.append((time, recorder.fmu.getReal([1])[0], len(recorder.rows)))
        return time < 0.5

    result = simulate_fmu(archive, fmi_type="ModelExchange", output_interval=0.1, stop_time=1.0, step_finished=step_finished)
    assert [round(t, 9) for t, *_ in seen] == [0.1, 0.2, 0.3, 0.4, 0.5]
    assert len(result) == 5


def test_an_fmu_without_co_simulation_needs_no_type(reference, standard, tmp_path):
    import zipfile

    archive, copy = reference / standard.name / "VanDerPol.fmu", tmp_path / "alone.fmu"
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(copy, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "modelDescription.xml":
                data = re.sub(rb"<CoSimulation(?:[^>]*/>|.*?</CoSimulation>)", b"", data, flags=re.DOTALL)
            new.writestr(name, data)
    expected = simulate_fmu(archive, fmi_type="ModelExchange", stop_time=1.0)
    assert simulate_fmu(copy, stop_time=1.0).tobytes() == expected.tobytes()
    with pytest.raises(FmuError, match="VanDerPol: has no CoSimulation"):
        simulate_fmu(copy, fmi_type="CoSimulation")


@pytest.mark.parametrize("early", [False, True])
@pytest.mark.parametrize("events", [False, True])
@pytest.mark.parametrize("h", [1e-4, 0.7e-4, 1e-3])
def test_event_mode_and_early_return_have_fmpys_bits(archives, events, early, h):
    arguments = {"stop_time": 0.02, "output_interval": h, "use_event_mode": events, "early_return_allowed": early, "input": SPEED}
    archive = archives / "fmi3" / "SensorlessController.fmu"
    assert simulate_fmu(archive, **arguments).tobytes() == fmpy.simulate_fmu(archive, **arguments).tobytes()


def test_input_derivatives(archives, reference):
    """A ramp passed with its slope to a step of 10 ms is as accurate as one in steps of 0.1 ms."""
    ramp = np.array([(0.0, 0.0), (0.1, 2.0)], dtype=[("time", float), ("tau_load", float)])
    arguments = {"stop_time": 0.1, "input": ramp, "output": ["speed"], "start_values": VOLTAGES}
    archive = archives / "fmi2" / "PmsmPlant.fmu"
    fine = simulate_fmu(archive, output_interval=1e-4, set_input_derivatives=True, **arguments)["speed"][-1]
    held, sloped = (
        simulate_fmu(archive, output_interval=1e-2, set_input_derivatives=slope, **arguments)["speed"][-1] for slope in (False, True)
    )
    assert abs(sloped - fine) < 1e-2 * abs(held - fine)
    with pytest.raises(ValueError, match="PmsmPlant does not interpolate inputs"):
        simulate_fmu(archives / "fmi3" / "PmsmPlant.fmu", set_input_derivatives=True)


def test_loggers(standard, capsys):
    archive, calls = standard / "PmsmPlant.fmu", []
    simulate_fmu(archive, stop_time=2e-3, output_interval=1e-3, fmi_call_logger=calls.append, visible=True)
    n = standard.name[-1]
    assert calls[0] == f"fmi{n}Instantiate{'' if n == '2' else 'CoSimulation'} -> an instance"
    assert calls.count(f"fmi{n}DoStep -> OK") == 2
    assert calls[-2].startswith(f"fmi{n}Terminate")
    assert calls[-1].startswith(f"fmi{n}FreeInstance")
    said = []
    with pytest.raises(FmuError):
        simulate_fmu(archive, start_values={"motor.R_s": -1.0}, logger=lambda *message: said.append(message))
    assert len(said[0]) == (5 if n == "2" else 4)
    assert said[0][-3] == 3
    assert b"motor.R_s" in said[0][-1]
    simulate_fmu(archive, stop_time=1e-3, debug_logging=True)
    assert "PmsmPlant" in capsys.readouterr().out


def test_instances_for_model_exchange(reference, standard):
    """A loop by hand with FMPy's methods, its vectors as NumPy arrays and as ctypes."""
    import ctypes

    archive, final = reference / standard.name / "VanDerPol.fmu", []
    for module in (fmpy, fmurun.fmpy):
        description = module.read_model_description(archive)
        unpacked = module.extract(archive)
        fmu = module.instantiate_fmu(unpacked, description, fmi_type="ModelExchange")
        if standard.name == "fmi2":
            fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        update = fmu.newDiscreteStates if standard.name == "fmi2" else fmu.updateDiscreteStates
        derivatives = fmu.getDerivatives if standard.name == "fmi2" else fmu.getContinuousStateDerivatives
        while update()[0]:
            pass
        fmu.enterContinuousTimeMode()
        x, dx = np.zeros(2), np.zeros(2)
        pointers = [array.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for array in (x, dx)]
        fmu.getContinuousStates(pointers[0], 2)
        for k in range(100):
            fmu.setTime(k * 0.01)
            derivatives(pointers[1], 2)
            x += 0.01 * dx
            fmu.setContinuousStates(pointers[0], 2)
            fmu.completedIntegratorStep()
        states, rates = ([v.valueReference for v in description.modelVariables if v.name in names] for names in
                         (("x0", "x1"), ("der(x0)", "der(x1)")))  # fmt: skip
        final.append((x.tolist(), fmu.getDirectionalDerivative(rates, states, [1.0, 0.5])))
        fmu.terminate()
    assert final[0] == final[1]
    more = np.zeros(2)
    fmu.getContinuousStates(more, 2)
    assert more.tolist() == final[1][0]


WRONG = {
    "a solver": ({"solver": "RK45"}, ValueError, "solver = 'RK45': there is no such solver; expected one of Dopri, RK4, Euler, CVode"),
    "a tolerance": ({"relative_tolerance": 2.0}, ValueError, "relative_tolerance must be between"),
    "NaN for a tolerance": ({"relative_tolerance": float("nan")}, ValueError, "relative_tolerance must be between"),
    "a step": ({"solver": "RK4", "step_size": 0.03, "output_interval": 0.1}, ValueError, "must be a multiple of step_size 0.03"),
    "a step of zero": ({"step_size": 0.0, "output_interval": 0.1}, ValueError, "step_size must be positive"),
    "a type": ({"fmi_type": "Exchange"}, ValueError, "fmi_type must be CoSimulation or ModelExchange, not 'Exchange'"),
    "a platform": ({"remote_platform": "win32"}, ValueError, "remote_platform = 'win32'"),
    "a state": ({"fmu_state": b"x"}, ValueError, "begins with an initialization"),
    "a name": ({"start_values": {"mü": 1.0}}, ValueError, "has no variable mü"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_bad_input_is_one_line(reference, wrong):
    arguments, kind, part = WRONG[wrong]
    with pytest.raises(kind, match=re.escape(part)) as caught:
        simulate_fmu(reference / "fmi3" / "VanDerPol.fmu", **{"fmi_type": "ModelExchange"} | arguments)
    assert "\n" not in str(caught.value)


def test_warnings_of_the_fmu(standard):
    archive, arguments = standard / "PmsmDrive.fmu", {"start_values": {"u_dc": 0.0}, "stop_time": 0.1, "output_interval": 1e-3}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = simulate_fmu(archive, **arguments)
        said = [str(w.message) for w in caught]
        assert sum("the DC link has no voltage" in text for text in said) == 1, said
        assert all(text.startswith("PmsmDrive: at ") for text in said) and caught[0].filename == __file__
        # Whoever takes the messages, or asks for none, gets no Python warning.
        others = [simulate_fmu(archive, logger=lambda *_: None, **arguments), simulate_fmu(archive, fmi_call_logger=print, **arguments)]
        assert len(caught) == len(said) and all(one.tobytes() == result.tobytes() for one in others)


def test_cvode_warns_once(reference):
    from fmurun import _simulate

    _simulate._told.clear()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        results = [simulate_fmu(reference / "fmi3" / "VanDerPol.fmu", fmi_type="ModelExchange", solver=s, stop_time=1.0).tobytes()
                   for s in ("CVode", "CVode", "Dopri", None)]  # fmt: skip
    assert [str(w.message)[:14] for w in caught] == ["solver='CVode'"]
    assert len(set(results)) == 1


def test_stiff_equations_are_reported(reference):
    """Van der Pol's equations with mu = 1000: beyond the transient, steps of 1 ms."""
    for stop, expected in ((20.0, []), (300.0, ["the equations are stiff"])):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            simulate_fmu(reference / "fmi3" / "VanDerPol.fmu", fmi_type="ModelExchange", start_values={"mu": 1000.0},
                         stop_time=stop, output_interval=stop / 2)  # fmt: skip
        assert [str(w.message)[:23] for w in caught if w.category is RuntimeWarning] == expected


def test_the_drive_in_model_exchange_is_fast(standard):
    archive = standard / "PmsmDrive.fmu"
    arguments = {"fmi_type": "ModelExchange", "stop_time": 0.6 if LONG else 0.1, "output_interval": 1e-3, "output": ["speed"],
                 "start_values": {"speed_ref": 20.0}}  # fmt: skip
    theirs = fmpy.simulate_fmu(archive, solver="CVode", **arguments)
    ours = simulate_fmu(archive, **arguments)
    faster, slow, fast = ratio(lambda: fmpy.simulate_fmu(archive, solver="CVode", **arguments), lambda: simulate_fmu(archive, **arguments))
    report("ME", f"{standard.name} PmsmDrive, {len(ours)} rows: CVode {slow:.2f} s, ours {fast * 1e3:.1f} ms ({faster:.0f}x; goal 50x)")
    assert len(ours) == len(theirs)
    assert faster >= 50.0 / SLACK
