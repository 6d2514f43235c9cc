"""Every function that runs an FMU passes on its warnings."""

import warnings

import numpy as np
import pytest
from fmurun import Batch, Plan, frequency_response, linearize

# The controller's resistance is nine times that of its machine.
WRONG = {"controller.motor.R_s": 18.0}
NAMES = r"controller\.motor\.R_s = 18 Ohm is 9 times plant\.motor\.R_s"
RUN = {"speed_ref": 80.0, "tau_load": 0.5}


@pytest.fixture
def drive(standard):
    """Path of the drive's archive."""
    return standard / "PmsmDrive.fmu"


def heard(function):
    """Texts of the warnings raised by a function."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        function()
    return [str(warning.message) for warning in caught]


def test_a_plan_warns_of_one_run_and_counts_many(drive):
    plan = Plan(drive, start_values=RUN, stop_time=0.02, step_size=1e-3, measures={"last": "speed"})
    with pytest.warns(UserWarning, match=f"^PmsmDrive: at 0.001 s: {NAMES}"):
        plan.simulate(WRONG)
    assert not heard(plan.simulate)
    table = {"controller.motor.R_s": [1.8, 18.0, 1.8, 18.0]}
    with pytest.warns(UserWarning, match=f"^2 of 4 rows have warnings; the first, in row 1: PmsmDrive: .*{NAMES}"):
        plan.run_many(table)
    with pytest.warns(UserWarning, match="the first, in row 11: "):
        plan.run_many(table, first_run=10)
    with pytest.warns(UserWarning, match="the first, in row 7: "):
        plan.run_many({"run": [5, 7, 8, 9], **table})
    assert not heard(lambda: plan.run_many({"controller.motor.R_s": [1.8, 1.9]}))
    many = np.full(1600, 1.8)
    many[[1, 32]] = 18.0
    with pytest.warns(UserWarning, match="^1 of the 100 checked rows have warnings; the first, in row 32: "):
        Plan(drive, start_values=RUN, stop_time=0.002, step_size=1e-3, measures={"last": "speed"}).run_many(
            {"controller.motor.R_s": many}
        )


@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
def test_a_gradient_warns(drive, fmi_type):
    plan = Plan(drive, start_values=RUN, stop_time=0.02, step_size=1e-3, measures={"last": "speed"}, fmi_type=fmi_type)
    with pytest.warns(UserWarning, match=NAMES):
        plan.gradient(WRONG)
    assert not heard(lambda: plan.gradient({"controller.motor.R_s": 1.8}))


def test_a_batch_warns_once_and_keeps_all(drive):
    resistances = np.full(40, 1.8)
    resistances[[3, 20]] = 18.0
    batch = Batch(drive, 40, actions=["speed_ref"], observations=["speed"], step_size=1e-3,
                  start_values={"controller.motor.R_s": resistances, "tau_load": 0.5})  # fmt: skip
    actions = np.full((40, 1), 80.0)
    texts = heard(lambda: [batch.reset(), *(batch.step(actions) for _ in range(20))])
    assert len(texts) == 1 and texts[0].startswith("PmsmDrive[3]: at 0.001 s: controller.motor.R_s = 18 Ohm is 9 times")
    assert texts[0].endswith("; and 1 of the other instances: `warned` has their warnings")
    assert list(batch.warned) == [3, 20] and batch.warned[20].startswith("PmsmDrive[20]: ")
    # A reset without start values keeps the parameters: the warnings remain and are not reported again.
    assert not heard(lambda: batch.reset([k == 3 for k in range(40)])) and list(batch.warned) == [3, 20]
    assert not heard(lambda: batch.reset(start_values={"tau_load": 0.5})) and not batch.warned
    # Instances 0 and 16 are checked in all steps: a load beyond the torque, applied later, is reported.
    late = Batch(drive, 17, actions=["tau_load"], observations=["speed"], step_size=1e-3)
    late.reset()
    assert not heard(lambda: [late.step(np.zeros((17, 1))) for _ in range(5)])
    with pytest.warns(UserWarning, match=r"PmsmDrive\[0\]: .*; and 1 of the other instances"):
        [late.step(np.full((17, 1), 500.0)) for _ in range(50)]
    assert list(late.warned) == [0, 16]


def test_a_batch_of_one_warns_while_it_runs(drive):
    batch = Batch(drive, actions=["tau_load"], observations=["speed"], step_size=1e-3)
    batch.reset()
    with pytest.warns(UserWarning, match="^PmsmDrive: at 0.*tau_load = 500 N.m"):
        [batch.step(np.array([500.0])) for _ in range(50)]
    # Python can turn the warning into an error; the batch can still step after it.
    batch.reset(start_values={})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(UserWarning, match="tau_load"):
            [batch.step(np.array([500.0])) for _ in range(50)]
        assert np.isfinite(batch.step(np.array([0.0]))).all()


def test_a_frequency_response_warns(drive):
    with pytest.warns(UserWarning, match=NAMES):
        frequency_response(drive, "speed_ref", "speed", frequencies=[50.0], start_values={"speed_ref": 80.0, **WRONG},
                           step_size=1e-3, settle_time=0.2)  # fmt: skip


def test_a_linearization_warns(standard):
    with pytest.warns(UserWarning, match="PmsmPlant: .*inverter.i_zero"):
        linearize(standard / "PmsmPlant.fmu", {"inverter.i_zero": 0.2}, inputs=["tau_load"], outputs=["speed"])
