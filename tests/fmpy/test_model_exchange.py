"""Model Exchange in FMPy: its CVode and Euler integrate the plant and the whole drive, and run the controller's events.

The reference is co-simulation at T_s. Both hold the voltages over a sample period, so they solve the same equations: what
differs is the error of the integrators, 2e-7 A and 6e-7 rad/s with CVode at a relative tolerance of 1e-12. CVode
restarts at every event; a start from 180 deg amplifies its errors, at 1e-9 to 4e-5 A, at 1e-10 to 4e-6 A.
"""

import numpy as np
import pytest
from fmpy import simulate_fmu

import counted
import exchange
import pair
from scenarios import RPM, Scenario, schedule

STANDARDS = pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
CURRENTS = ("i_a", "i_b", "i_c", "i_d", "i_q")
ENERGIES = ("energy_in", "energy_mech", "energy_loss")
MEANS = ("p_in_mean", "p_mech_mean", "p_loss_mean", "tau_shaft_mean")
# From the worst angle to 1500 rpm; then half of the rated load.
START = Scenario(
    duration=0.6,
    plant={"initial.theta_e": np.pi},
    speed_ref=schedule((0.05, 1500 * RPM)),
    load=schedule((0.45, 1.0)),
)


def steps(*columns, until):
    """An input table of steps: each is a duplicate row, because FMPy interpolates continuous inputs."""
    times = sorted({0.0, until, *(t for _, changes in columns for t, _ in changes)})
    rows = []
    for t in times:
        for after in (False, True):
            rows.append((t, *(value(changes, t, after) for _, changes in columns)))
    names = [("time", float), *((name, float) for name, _ in columns)]
    return np.array([row for k, row in enumerate(rows) if k == 0 or row != rows[k - 1]], dtype=names)


def value(changes, t, after):
    found = 0.0
    for since, new in changes:
        if since < t or (after and since == t):
            found = new
    return found


DRIVE_INPUTS = steps(("speed_ref", [(0.05, 1500 * RPM)]), ("tau_load", [(0.45, 1.0)]), until=0.6)


def drive(folder, **arguments):
    return simulate_fmu(
        folder / "PmsmDrive.fmu",
        stop_time=START.duration,
        input=DRIVE_INPUTS,
        start_values={"plant.initial.theta_e": np.pi},
        output=["speed", *CURRENTS, *ENERGIES, *MEANS],
        record_events=False,
        **arguments,
    )


def at_same_times(reference, result):
    """The rows of the reference at the times of the result."""
    rows = np.searchsorted(reference["time"], result["time"] - 1e-9)
    assert np.abs(reference["time"][rows] - result["time"]).max() < 1e-9
    return reference[rows]


@STANDARDS
@pytest.mark.parametrize("solver", ["CVode", "Euler"])
def test_plant(archives, standard, solver):
    """Voltages, a load step and the gates off at half of the time."""
    stop, step = (0.1, 1e-3) if solver == "CVode" else (0.02, 1e-6)  # Euler's step is the output interval
    inputs = np.array(
        [
            (0.0, 20.0, -10.0, -10.0, 0.0, True),
            (0.3 * stop, 20.0, -10.0, -10.0, 0.0, True),
            (0.3 * stop, -5.0, 20.0, -15.0, 1.0, True),
            (stop, -5.0, 20.0, -15.0, 1.0, True),
        ],
        dtype=[*((name, float) for name in ("time", "u_a", "u_b", "u_c", "tau_load")), ("enable", bool)],
    )
    output = ["speed", "angle", *CURRENTS, *ENERGIES]
    arguments = {"stop_time": stop, "input": inputs, "output": output, "record_events": False}
    archive = archives / f"fmi{standard}" / "PmsmPlant.fmu"
    result = simulate_fmu(
        archive,
        fmi_type="ModelExchange",
        solver=solver,
        step_size=step,
        output_interval=step,
        relative_tolerance=1e-9,
        **arguments,
    )
    result = result[:: round(1e-3 / step)]
    reference = at_same_times(
        simulate_fmu(archive, fmi_type="CoSimulation", step_size=1e-4, output_interval=1e-4, **arguments), result
    )
    # Euler's error is h/2 times the second derivative: at 1 us and 1e6 A/s2, 1e-2 A at most.
    bound = 1e-5 if solver == "CVode" else 1e-2
    assert np.abs(reference["i_q"]).max() > 1.0
    for name in ("speed", "angle", *CURRENTS):
        assert np.abs(result[name] - reference[name]).max() < bound, name
    # A completed step of FMPy is an output interval, however CVode divides it: 1 ms here.
    for name in ENERGIES:
        passed = np.abs(reference[name]).max()
        assert passed > 1e-4 and np.abs(result[name] - reference[name]).max() < max(1e-5, bound) * passed, name


@STANDARDS
def test_plant_with_the_gates_off(archives, standard):
    """The diodes block at an event that CVode locates: from there on there is no current."""
    inputs = np.array(
        [(0.0, 30.0, -15.0, -15.0, True), (0.02, 30.0, -15.0, -15.0, True), (0.02, 0.0, 0.0, 0.0, False)],
        dtype=[*((name, float) for name in ("time", "u_a", "u_b", "u_c")), ("enable", bool)],
    )
    result = simulate_fmu(
        archives / f"fmi{standard}" / "PmsmPlant.fmu",
        fmi_type="ModelExchange",
        relative_tolerance=1e-9,
        stop_time=0.04,
        output_interval=1e-4,
        input=inputs,
        output=["i_a", "i_b", "i_c", "speed"],
    )
    before, after = result["time"] < 0.02 - 1e-9, result["time"] > 0.021
    assert np.abs(result["i_a"][before]).max() > 5.0
    for name in ("i_a", "i_b", "i_c"):
        assert np.abs(result[name][after]).max() == 0.0, name


@STANDARDS
def test_drive(archives, standard):
    """The whole drive, without a step size to choose."""
    folder = archives / f"fmi{standard}"
    result = drive(folder, fmi_type="ModelExchange", output_interval=1e-3, relative_tolerance=1e-10)
    reference = drive(folder, fmi_type="CoSimulation", output_interval=1e-4, step_size=1e-4)
    reference = at_same_times(reference, result)
    assert result["speed"][-1] == pytest.approx(1500 * RPM, rel=0.02)
    assert np.abs(result["speed"] - reference["speed"]).max() < 1e-4
    for name in CURRENTS:
        assert np.abs(result[name] - reference[name]).max() < 1e-5, name
    for name in ENERGIES:
        assert np.abs(result[name] - reference[name]).max() < 1e-4 * reference[name][-1], name
    steady = result["time"] > 0.55
    for name in MEANS:
        assert result[name][0] == 0.0, "before the first T_s is over"
        assert np.abs(result[name] / reference[name] - 1.0)[steady].max() < 1e-3, name


@STANDARDS
def test_calls_of_the_drive(archives, standard):
    """CVode restarts at samples only, and its Jacobian by differences is that of the directional derivatives.

    The counts are of CVode: 5.1 steps and 12.1 evaluations per sample, one step of them refused, and one Jacobian.
    """
    arguments = {"stop_time": 0.1, "output_interval": 1e-3, "output": ["i_d", "i_q"], "record_events": False}
    arguments["start_values"] = {"speed_ref": 1500 * RPM, "tau_load": 1.0}
    archive, samples = archives / f"fmi{standard}" / "PmsmDrive.fmu", 1000
    by_differences, counts = counted.simulate(archive, **arguments)
    exact, others = counted.simulate(archive, exact=True, **arguments)
    assert counts["restarts"] == counts["CompletedIntegratorStep"] == counts["JacEvals"] == samples
    assert counts["NewDiscreteStates" if standard == 2 else "UpdateDiscreteStates"] == samples + 1, "one update for each"
    for never in ("state events", "states changed", "nominals changed", "NonlinSolvConvFails"):
        assert counts[never] == 0, never
    assert counts["Steps"] < 5.5 * samples and counts["RhsEvals"] < 13 * samples and counts["LinRhsEvals"] == 5 * samples
    assert others["GetDirectionalDerivative"] == 5 * samples and others["LinRhsEvals"] == 0
    for name in ("Steps", "RhsEvals", "NonlinSolvIters", "ErrTestFails", "GEvals"):
        assert others[name] == pytest.approx(counts[name], rel=0.01), name
    for name in ("i_d", "i_q"):
        assert np.abs(by_differences[name] - exact[name]).max() < 1e-6, name


@STANDARDS
@pytest.mark.parametrize("solver", ["CVode", "Euler"])
def test_switched_inverter(archives, standard, solver):
    """Time events of the carrier, state events of the diodes, energy lost in each commutation."""
    losses = {"r_transistor": 0.06, "u_transistor": 0.9, "r_diode": 0.05, "u_diode": 0.7, "E_sw": 2.5e-3}
    inverter = {"mode": 2, "dead_time": 2e-6, **losses}
    stop, step = (0.05, 1e-4) if solver == "CVode" else (0.01, 1e-6)  # Euler's step is the output interval
    start = {f"plant.inverter.{name}": value for name, value in inverter.items()}
    arguments = {"start_values": {"speed_ref": 50.0, "tau_load": 1.0, **start}, "stop_time": stop, "record_events": False}
    archive = archives / f"fmi{standard}" / "PmsmDrive.fmu"
    exchange = {"solver": solver, "step_size": step, "output_interval": step, "relative_tolerance": 1e-8}
    output = ["speed", *CURRENTS, *MEANS]
    result = simulate_fmu(archive, fmi_type="ModelExchange", output=output, **exchange, **arguments)
    reference = simulate_fmu(archive, fmi_type="CoSimulation", output=output, step_size=1e-4, output_interval=1e-4, **arguments)
    result = result[:: round(1e-4 / step)]
    bound = 1e-3 if solver == "CVode" else 2e-2
    for name in ("speed", *CURRENTS):
        assert np.abs(result[name] - reference[name]).max() < bound, name
    assert np.abs(reference["i_q"]).max() > 2.0
    for name in MEANS:
        assert np.abs(result[name] - reference[name]).max() < max(2e-4, bound) * np.abs(reference[name]).max(), name


@STANDARDS
def test_pair(archives, standard):
    """Plant and controller connected: the same."""
    folder = archives / f"fmi{standard}"
    result = exchange.simulate(folder, START, 1e-3, 1e-10)
    reference = pair.simulate(folder, START, 1e-4)
    rows = np.searchsorted(reference["t"], result["t"] - 1e-9)
    assert np.abs(result["speed"] - reference["speed"][rows]).max() < 1e-4
    whole = drive(folder, fmi_type="CoSimulation", output_interval=1e-4, step_size=1e-4)
    rows = np.searchsorted(whole["time"], result["t"] - 1e-9)
    for name in ("i_d", "i_q"):
        assert np.abs(result[name] - whole[name][rows]).max() < 1e-5, name


def controller(folder, ramp=False, **arguments):
    """Alone, with currents that step between its samples and a speed reference that steps or, with `ramp`, rises.

    The steps are powers of 2, which FMPy's interpolation keeps to the last bit.
    """
    changes = [(k * 2.37e-3 + 5e-5, (-1.0) ** k * 2.0 ** (k % 3)) for k in range(40)]
    opposite = [(t, -0.5 * i) for t, i in changes]
    inputs = steps(("i_a", changes), ("i_b", opposite), ("speed_ref", [(5e-5, 16.0)]), until=0.1)
    if ramp:
        inputs["speed_ref"] = 200.0 * inputs["time"]
    return simulate_fmu(
        folder / "SensorlessController.fmu",
        stop_time=0.1,
        input=inputs,
        output=["u_a", "u_b", "u_c", "theta_est", "speed_est", "i_q_ref"],
        **arguments,
    )


def after_events(result):
    """The last row of each time: the values that are visible once the event is over."""
    time = result["time"]
    return result[np.append(np.diff(time) > 1e-9, True)]


@STANDARDS
@pytest.mark.parametrize("solver", ["CVode", "Euler"])
def test_controller(archives, standard, solver):
    """It has no state, only events, which read the inputs at their instants: equal to co-simulation at T_s, bit for
    bit."""
    folder = archives / f"fmi{standard}"
    result = after_events(controller(folder, fmi_type="ModelExchange", solver=solver, output_interval=1e-4))
    reference = controller(folder, fmi_type="CoSimulation", step_size=1e-4, output_interval=1e-4)
    held = np.searchsorted(reference["time"], result["time"] + 1e-9) - 1
    assert np.abs(result["u_a"]).max() > 1.0
    for name in result.dtype.names[1:]:
        assert np.array_equal(result[name], reference[name][held]), name


@pytest.mark.parametrize("early", [False, True], ids=["whole", "early"])
@pytest.mark.parametrize("h", [1e-4, 0.7e-4, 1e-3, 7.3e-3])
def test_controller_with_event_mode(archives, early, h):
    """Co-simulation with Event Mode: every sample reads the inputs at its instant, bit for bit.

    FMPy enters Event Mode at steps of inputs; on a ramp, the samples inside a step need early return.
    """
    folder = archives / "fmi3"
    arguments = {"step_size": h, "output_interval": h, "use_event_mode": True, "early_return_allowed": early}
    for ramp in (False, True):
        result = after_events(controller(folder, ramp, fmi_type="CoSimulation", **arguments))
        reference = controller(folder, ramp, fmi_type="CoSimulation", step_size=1e-4, output_interval=1e-4)
        held = np.searchsorted(reference["time"], result["time"] + 1e-9) - 1
        apart = max(np.abs(result[name] - reference[name][held]).max() for name in result.dtype.names[1:])
        if not ramp:
            assert apart == 0.0
        elif early or h == 1e-4:
            assert apart < 1e-9  # FMPy's own times of instants differ in the last bit
        else:
            assert apart > 1e-3
