"""`Batch`: equal to single instances, resets, failures, threads."""

import os
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest
from fmurun import Batch, FmuError
from fmurun.fmpy import instantiate_fmu, read_model_description

ACTIONS, OBSERVATIONS = ["u_a", "u_b", "u_c"], ["i_a", "speed", "theta_e"]


def batch(archive, n, **more):
    return Batch(archive, n, actions=ACTIONS, observations=OBSERVATIONS, step_size=1e-4, **more)


def voltages(n, k):
    turn = 2 * np.pi * (np.arange(n)[:, None] / n + k / 20 + np.array([0, -1 / 3, 1 / 3]))
    return 20.0 * np.cos(turn)


@pytest.mark.parametrize("threads", [1, 3])
def test_as_single_instances(standard, threads):
    n, archive = 7, standard / "PmsmPlant.fmu"
    resistances = np.linspace(2.5, 3.5, n)
    many = batch(archive, n, start_values={"motor.R_s": resistances}, threads=threads)
    description = read_model_description(archive)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    alone = []
    for resistance in resistances:
        instance = instantiate_fmu(archive, description)
        write = instance.setReal if standard.name == "fmi2" else instance.setFloat64
        write([reference["motor.R_s"]], [resistance])
        if standard.name == "fmi2":
            instance.setupExperiment()
        instance.enterInitializationMode()
        instance.exitInitializationMode()
        alone.append((instance, write, instance.getReal if standard.name == "fmi2" else instance.getFloat64))
    for k in range(20):
        u = voltages(n, k)
        seen = many.step(u, repeat=2)
        for i, (instance, write, read) in enumerate(alone):
            write([reference[a] for a in ACTIONS], u[i].tolist())
            for j in (2 * k, 2 * k + 1):
                instance.doStep(j * 1e-4, 1e-4)
            assert read([reference[o] for o in OBSERVATIONS]) == seen[i].tolist()


def test_a_reset_is_a_new_start(standard):
    many = batch(standard / "PmsmPlant.fmu", 4, start_values={"initial.speed": [1.0, 2.0, 3.0, 4.0]})
    first = many.reset()
    assert first[:, 1].tolist() == [1.0, 2.0, 3.0, 4.0]
    run = [many.step(voltages(4, k)) for k in range(10)]
    some = many.reset([True, False, True, False])
    assert np.array_equal(some[[0, 2]], first[[0, 2]])
    assert np.array_equal(some[[1, 3]], run[-1][[1, 3]])
    assert np.array_equal(many.reset(), first)
    assert all(np.array_equal(many.step(voltages(4, k)), run[k]) for k in range(10))
    other = many.reset(start_values={"initial.speed": 9.0})
    assert other[:, 1].tolist() == [9.0] * 4
    many.step(voltages(4, 0))
    assert np.array_equal(many.reset(), other)


def test_save_and_restore(standard):
    many = batch(standard / "PmsmPlant.fmu", 2)
    for k in range(5):
        many.step(voltages(2, k))
    saved = many.save(0)
    ahead = [many.step(voltages(2, k))[0].tolist() for k in range(5, 8)]
    many.restore(1, saved)
    again = [many.step(voltages(2, k)[[1, 0]])[1].tolist() for k in range(5, 8)]
    assert ahead == again
    with pytest.raises(FmuError):
        many.restore(0, (0, b"nothing"))
    with pytest.raises(FmuError, match="is not an instance"):
        many.save(2)


def test_shapes_and_out(plant):
    many, out = batch(plant, 3), np.empty((3, 3))
    assert many.step(np.zeros((3, 3)), out=out) is out
    assert batch(plant, 1).step([1.0, 0.0, 0.0]).shape == (1, 3)
    assert many.step(np.zeros((3, 3), dtype=np.float32)).dtype == np.float64
    for wrong in (np.zeros((3, 2)), np.zeros(9), np.zeros((9, 1)), [["x"] * 3] * 3, None):
        with pytest.raises((ValueError, TypeError)):
            many.step(wrong)
    with pytest.raises(ValueError, match="shape"):
        many.step(np.zeros((3, 3)), out=np.empty((2, 3)))
    with pytest.raises(ValueError, match="mask"):
        many.reset([True])


def test_bad_input(plant):
    for arguments, part in (
        ({"actions": ["u"], "observations": ["speed"], "step_size": 1e-4}, "has no variable u"),
        ({"actions": [], "observations": [], "step_size": 1e-4}, "at least 1"),
        ({"actions": [], "observations": ["speed"], "step_size": 0.0}, "step_size must be positive"),
        ({"actions": [], "observations": ["speed"], "step_size": 1e-4, "start_values": {"R": 1}}, "has no variable R"),
        ({"actions": [], "observations": ["speed"], "step_size": 1e-4, "start_values": {"motor.R_s": [1, 2]}}, "2 start values"),
        ({"actions": [], "observations": ["speed"], "step_size": 1e-4, "start_values": {"motor.R_s": -1}}, "greater than 0"),
    ):
        with pytest.raises((FmuError, ValueError), match=part):
            Batch(plant, 3, **arguments)


def test_one_that_fails_does_not_stop_the_others(plant):
    many = batch(plant, 3)
    u = np.zeros((3, 3))
    u[1, 0] = np.nan
    seen = many.step(u)
    assert np.isnan(seen[1]).all()
    assert np.isfinite(seen[[0, 2]]).all()
    (k, error), = many.failed.items()
    assert k == 1
    assert isinstance(error, FmuError)
    assert np.isnan(many.step(np.zeros((3, 3)))[1]).all()
    many.reset([False, True, False])
    assert not many.failed
    assert np.isfinite(many.step(np.zeros((3, 3)))).all()
    with pytest.raises(FmuError):
        many.step(np.full((3, 3), np.nan))


def test_no_pickle(plant):
    """Instances stay in their process: one clear error, not a copy that shares them."""
    with pytest.raises(TypeError, match="cannot pickle 'Batch'"):
        pickle.dumps(batch(plant, 1))


def test_in_another_thread(plant):
    many, seen = batch(plant, 2), []
    thread = threading.Thread(target=lambda: seen.append(many.step(voltages(2, 0))))
    thread.start()
    thread.join()
    assert np.array_equal(batch(plant, 2).step(voltages(2, 0)), seen[0])


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="another user has such a limit; root chooses one")
def test_a_system_without_room_for_threads(plant):
    """The calling thread does the work of threads that cannot be started."""
    script = """
import os, resource, sys
import numpy as np
from fmurun import Batch
names = {"actions": ["u_a", "u_b", "u_c"], "observations": ["i_a", "speed"], "step_size": 1e-4}
alone, many = (Batch(sys.argv[1], 5, threads=threads, **names) for threads in (1, 4))
os.setuid(0x60000000 + os.getpid())
resource.setrlimit(resource.RLIMIT_NPROC, (1, 1))
actions = np.outer(np.arange(5.0), [10, -4, -6])
for _ in range(3):
    assert np.array_equal(alone.step(actions), many.step(actions))
print("equal")
"""
    done = subprocess.run([sys.executable, "-c", script, plant], capture_output=True, text=True)
    assert done.stdout == "equal\n", done.stderr
