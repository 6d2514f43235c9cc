"""`simulate_fmu` against FMPy 0.3.32: equal to the last bit, with better error messages."""

import fmpy
import fmurun.fmpy
import numpy as np
import pytest
from fmurun import FmuError, simulate_fmu

# Controllers without a motor warn of their lost rotor.
pytestmark = pytest.mark.filterwarnings("ignore:SensorlessController:UserWarning")

STEP = np.array([(0.0, 0.0), (0.01, 0.0), (0.01, 1.0), (0.03, 1.5)], dtype=[("time", float), ("tau_load", float)])
RAMP = np.array([(0.0, 0.1), (0.0137, 0.7), (0.1, 0.2)], dtype=[("time", float), ("tau_load", float)])
ONE = np.array([(0.0, 0.3)], dtype=[("time", float), ("tau_load", float)])
SPEED = np.array([(0.0, 0.0, 0.0), (0.005, 50.0, 0.0), (0.02, 50.0, 1.0)],
                 dtype=[("time", float), ("speed_ref", float), ("tau_load", float)])  # fmt: skip
GAIN = np.array([(0.0, 3.0), (0.004, 3.0), (0.00401, 3.5), (0.02, 3.5)], dtype=[("time", float), ("plant.motor.R_s", float)])
ENABLE = np.array([(0.0, False, 3.0), (0.0053, True, 3.0), (0.0123, False, 9.0), (0.02, True, 1.0)],
                  dtype=[("time", float), ("enable", bool), ("speed_ref", float)])  # fmt: skip
SETTINGS = {
    "the default experiment": ("PmsmPlant", {}),
    "the default experiment of the drive": ("PmsmDrive", {"stop_time": 0.05}),
    "every output": ("SensorlessController", {"stop_time": 0.02}),
    "an interval that is no decimal": ("PmsmPlant", {"stop_time": 0.05, "output_interval": 1 / 3e3}),
    "an interval that does not divide": ("PmsmPlant", {"stop_time": 0.0105, "output_interval": 1e-3}),
    "a start": ("PmsmDrive", {"start_time": 0.3, "stop_time": 0.33, "output_interval": 1e-3}),
    "a start that is no decimal": ("PmsmDrive", {"start_time": 1 / 3, "stop_time": 0.37, "output_interval": 7e-4}),
    "texts": ("PmsmPlant", {"start_time": "0", "stop_time": "0.01"}),
    "start values": ("PmsmPlant", {"stop_time": 0.02, "start_values": {"u_a": 10.0, "u_b": -5.0, "u_c": -5.0, "motor.R_s": 4}}),
    "a start value with its unit": ("PmsmPlant", {"stop_time": 0.02, "start_values": {"initial.speed": (300.0, "rpm")}}),
    "integers and Booleans": ("SensorlessController", {"stop_time": 0.02, "output": ["enabled", "u_a", "speed_est"],
                                                       "start_values": {"motor.n_p": 2, "enable": "false"}}),
    "parameters as outputs": ("PmsmPlant", {"stop_time": 0.02, "output": ["motor.n_p", "motor.R_s", "speed", "time"]}),
    "a step of the input": ("PmsmPlant", {"stop_time": 0.03, "output_interval": 7e-4, "input": STEP}),
    "lines of the input": ("PmsmPlant", {"stop_time": 0.11, "output_interval": 1.3e-3, "input": RAMP}),
    "one row of input": ("PmsmPlant", {"stop_time": 0.02, "input": ONE}),
    "two inputs": ("PmsmDrive", {"stop_time": 0.05, "output_interval": 3e-4, "input": SPEED}),
    "a tunable parameter as input": ("PmsmDrive", {"stop_time": 0.02, "output_interval": 1e-3, "input": GAIN}),
    "a discrete input": ("SensorlessController", {"stop_time": 0.02, "output_interval": 1e-3, "input": ENABLE}),
    "options without effect": ("PmsmPlant", {"stop_time": 0.01, "record_events": False, "solver": "Euler", "step_size": 1e-5,
                                             "apply_default_start_values": True, "set_stop_time": False}),
    "a tolerance": ("PmsmPlant", {"stop_time": 0.01, "relative_tolerance": 1e-6, "validate": False}),
    "a callback that ends it": ("PmsmDrive", {"stop_time": 0.05, "output_interval": 1e-3,
                                              "step_finished": lambda time, recorder: time < 0.02}),
}  # fmt: skip


@pytest.mark.parametrize("setting", SETTINGS)
def test_bits_of_fmpy(standard, setting):
    name, arguments = SETTINGS[setting]
    archive = standard / f"{name}.fmu"
    expected = fmpy.simulate_fmu(archive, **arguments)
    result = simulate_fmu(archive, **arguments)
    assert result.dtype == expected.dtype
    assert len(result) == len(expected) > 1
    for column in expected.dtype.names:
        assert np.array_equal(result[column], expected[column]), column
    assert result.tobytes() == expected.tobytes()


def test_the_result_is_like_fmpys(plant):
    result = simulate_fmu(plant, stop_time=0.01)
    assert result.dtype.names[0] == "time"
    assert result.modelDescription.modelName == "PmsmPlant"
    assert result["speed"].modelDescription is result.modelDescription
    assert result.flags.writeable


def test_an_extracted_folder(standard, tmp_path):
    archive = standard / "PmsmPlant.fmu"
    folder = fmurun.fmpy.extract(archive, tmp_path / "extracted")
    assert simulate_fmu(folder, stop_time=0.01).tobytes() == simulate_fmu(archive, stop_time=0.01).tobytes()


def test_an_instance_that_goes_on(standard):
    """Half a run, its state, and the other half from there: in the same instance, and in another from bytes."""
    archive = standard / "PmsmDrive.fmu"
    arguments = {"output_interval": 1e-3, "output": ["speed", "theta_e"]}
    whole = simulate_fmu(archive, stop_time=0.02, start_values={"speed_ref": 5.0}, **arguments)
    description = fmurun.fmpy.read_model_description(archive)
    instance = fmurun.fmpy.instantiate_fmu(archive, description)
    first = simulate_fmu(archive, fmu_instance=instance, model_description=description, start_values={"speed_ref": 5.0},
                         stop_time=0.01, terminate=False, set_stop_time=False, **arguments)  # fmt: skip
    state = instance.getFMUState()
    second = simulate_fmu(archive, fmu_instance=instance, fmu_state=state, start_time=0.01, stop_time=0.02, terminate=False,
                          **arguments)  # fmt: skip
    stored = instance.serializeFMUState(state)
    elsewhere = simulate_fmu(archive, fmu_state=stored, start_time=0.01, stop_time=0.02, **arguments)
    joined = np.concatenate([first, second[1:]])
    assert np.allclose(joined["time"], whole["time"], rtol=0, atol=1e-12)
    assert joined["speed"].tobytes() == whole["speed"].tobytes()
    assert second.tobytes() == elsewhere.tobytes()


def test_a_callback_sees_the_rows_and_the_instance(plant):
    seen = []

    def callback(time, recorder):
        seen.append((time, recorder.lastSampleTime, len(recorder.rows), recorder.fmu.getFloat64([0])[0]))
        return True

    result = simulate_fmu(plant, stop_time=0.01, output_interval=1e-3, step_finished=callback, output=["speed"])
    assert len(seen) == len(result) - 1
    assert all(time == last == own for time, last, _, own in seen)
    assert [rows for _, _, rows, _ in seen] == list(range(2, 12))


def test_a_timeout_ends_it(plant):
    assert len(simulate_fmu(plant, stop_time=1e4, output_interval=1e-4, timeout=0.2)) > 1


WRONG = {
    "a variable of start_values": ({"start_values": {"motor.R": 3.0}}, "start_values: PmsmPlant has no variable motor.R; did you mean motor.R_s"),
    "a variable of output": ({"output": ["speed", "sped"]}, "output: PmsmPlant has no variable sped; did you mean speed"),
    "a variable of input": ({"input": np.array([(0.0, 1.0)], dtype=[("t", float), ("load", float)])}, "input: PmsmPlant has no variable load"),
    "an output as input": ({"input": np.array([(0.0, 1.0)], dtype=[("t", float), ("speed", float)])}, "neither an input nor"),
    "a start value for an output": ({"start_values": {"speed": 3.0}}, "start_values: speed (output, continuous"),
    "a type": ({"start_values": {"motor.n_p": "two"}}, "start value 'two' of motor.n_p is not of the type Int32; expected a whole number"),
    "the range of a type": ({"start_values": {"motor.n_p": 2**40}}, "start value 1099511627776 of motor.n_p is not of the type Int32"),
    "a text": ({"start_values": {"motor.R_s": "much"}}, "motor.R_s = much is not a number"),
    "the unit of a text": ({"start_values": {"initial.speed": "1krpm"}}, "initial.speed = 1krpm is not a number in rad/s or rpm"),
    "a unit": ({"start_values": {"motor.R_s": (3.0, "rpm")}}, "unit 'rpm' of the start value of motor.R_s is not one of"),
    "an interval of zero": ({"output_interval": 0.0}, "output_interval must be positive"),
    "a stop that is no number": ({"stop_time": float("nan")}, "must be finite"),
    "a variable instead of the time": ({"input": np.array([(1.0, 0.0)], dtype=[("tau_load", float), ("time", float)])}, "input: the first column must be the time in s, not tau_load"),
    "times that fall": ({"input": STEP[::-1]}, "must not decrease"),
}


def test_a_text_may_have_a_unit_as_for_the_command(plant):
    runs = [
        simulate_fmu(plant, stop_time=0.01, start_values={"initial.speed": speed}, output=["speed"])["speed"]
        for speed in ((300.0, "rpm"), "300rpm", "3.0e2 rpm", f"{300 * np.pi / 30} rad/s")
    ]
    assert runs[0][0] == pytest.approx(300 * np.pi / 30) and all(np.array_equal(runs[0], other) for other in runs[1:3])
    assert runs[3] == pytest.approx(runs[0])


@pytest.mark.parametrize("case", WRONG)
def test_bad_input_is_told_before_the_run(plant, case):
    arguments, part = WRONG[case]
    with pytest.raises(ValueError, match=part.replace("(", r"\(")):
        simulate_fmu(plant, **arguments)


def test_what_belongs_to_model_exchange_is_told(plant):
    with pytest.warns(UserWarning, match="solver and step_size: no effect in CoSimulation"):
        simulate_fmu(plant, stop_time=0.01, fmi_type="CoSimulation", solver="RK4", step_size=1e-4)


def test_an_error_names_variable_value_and_range(standard):
    number = standard.name[-1]
    setter = {"2": "fmi2SetReal", "3": "fmi3SetFloat64"}[number]
    with pytest.raises(FmuError, match=r"motor\.R_s = -1 is not allowed: greater than 0") as caught:
        simulate_fmu(standard / "PmsmPlant.fmu", start_values={"motor.R_s": -1.0})
    error = caught.value
    assert (error.function, error.status, error.instance) == (setter, "Error", "PmsmPlant")


def test_a_file_that_is_no_fmu(tmp_path):
    (tmp_path / "x.fmu").write_text("no archive")
    for path in (tmp_path / "x.fmu", tmp_path / "missing.fmu", tmp_path):
        with pytest.raises(FmuError, match=str(path)):
            simulate_fmu(path)
