"""Arrays as inputs, start values and results: StateSpace, x' = A x + B u, y = C x + D u, with three of each."""

import fmurun.fmpy
import numpy as np
import pytest
from fmurun import simulate_fmu

# u_1 a constant, u_2 a ramp, u_3 a step at 0.5 s.
SIGNALS = np.array(
    [(0.0, (1.0, 0.0, 0.0)), (0.5, (1.0, 0.5, 0.0)), (0.5, (1.0, 0.5, 2.0)), (1.0, (1.0, 1.0, 2.0))],
    dtype=[("time", float), ("u", float, 3)],
)
START = {"A": -np.eye(3), "D": np.zeros((3, 3))}


def exact(t):
    """The three outputs: each a first-order lag of 1 s."""
    return np.stack([1.0 - np.exp(-t), t - 1.0 + np.exp(-t), 2.0 * np.where(t > 0.5, 1.0 - np.exp(0.5 - t), 0.0)], axis=1)


def rounded(values):
    return np.asarray(values).ravel().tolist()


@pytest.fixture
def archive(reference):
    return reference / "fmi3" / "StateSpace.fmu"


def test_model_exchange_has_the_solution(archive):
    result = simulate_fmu(archive, fmi_type="ModelExchange", relative_tolerance=1e-10, input=SIGNALS, start_values=START, stop_time=1.0,
                          output_interval=0.1, output=["u", "y"])  # fmt: skip
    assert result["y"].shape == (len(result), 3)
    assert np.max(np.abs(result["y"] - exact(result["time"]))) <= 1e-8
    # The step is an event: a row before it and one after it.
    assert result["u"][np.isclose(result["time"], 0.5)][:, 2].tolist() == [0.0, 2.0]


def test_co_simulation_is_a_loop_by_hand(archive):
    """Before each step, the inputs at its start, as one array."""
    result = simulate_fmu(archive, fmi_type="CoSimulation", input=SIGNALS, start_values=START, stop_time=1.0, output_interval=0.1, output=["y"])
    assert np.max(np.abs(result["y"][-1] - exact(np.array([1.0]))[0])) <= 0.1
    description = fmurun.fmpy.read_model_description(archive)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    fmu = fmurun.fmpy.instantiate_fmu(fmurun.fmpy.extract(archive), description, fmi_type="CoSimulation")
    for name, value in START.items():
        fmu.setFloat64([reference[name]], rounded(value))
    fmu.setFloat64([reference["u"]], [1.0, 0.0, 0.0])
    fmu.enterInitializationMode(startTime=0.0, stopTime=1.0)
    fmu.exitInitializationMode()
    rows = [fmu.getFloat64([reference["y"]], 3)]
    for k in range(10):
        t = k * 0.1
        fmu.setFloat64([reference["u"]], [1.0, t, 2.0 if t >= 0.5 else 0.0])
        fmu.doStep(currentCommunicationPoint=t, communicationStepSize=0.1)
        rows.append(fmu.getFloat64([reference["y"]], 3))
    fmu.terminate()
    fmu.freeInstance()
    assert np.max(np.abs(result["y"] - np.array(rows))) <= 1e-12


WRONG = {
    "a column of another shape": (np.array([(0.0, (1.0, 2.0))], [("time", float), ("u", float, 2)]), r"u has the shape \(3,\)"),
    "one number": (np.array([(0.0, 1.0)], [("time", float), ("u", float)]), r"u has the shape \(3,\), and its column \(\)"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_another_shape_is_one_line(archive, wrong):
    signals, part = WRONG[wrong]
    with pytest.raises(ValueError, match=part) as caught:
        simulate_fmu(archive, input=signals, stop_time=0.1)
    assert "\n" not in str(caught.value)


def test_pandas_has_a_column_for_each_element(archive):
    frame = simulate_fmu(archive, input=SIGNALS, start_values=START, stop_time=0.5, output_interval=0.1, output=["y"]).to_pandas()
    assert list(frame.columns) == ["y[1]", "y[2]", "y[3]"]
    assert frame.index.name == "time"
