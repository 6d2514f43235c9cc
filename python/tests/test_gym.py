"""Environments: Gymnasium's own checker, equal episodes, failures, the example."""

import runpy
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from fmurun.gym import Env, VectorEnv
from gymnasium.utils.env_checker import check_env

EXAMPLE = Path(__file__).parents[2] / "examples" / "gym_drive.py"


@pytest.fixture
def task(archives):
    return runpy.run_path(str(EXAMPLE))["task"](archives / "fmi3")


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_gymnasiums_checker(task):
    check_env(Env(**task), skip_render_check=True)


def test_a_vector_of_one_is_the_environment(task):
    one, many = Env(**task), VectorEnv(num_envs=1, **task)
    assert np.array_equal(one.reset(seed=3)[0], many.reset(seed=3)[0][0])
    one.action_space.seed(3)
    for _ in range(250):
        action = one.action_space.sample()
        seen, reward, terminated, truncated, _ = one.step(action)
        all_seen, rewards, all_terminated, all_truncated, _ = many.step(action[None])
        assert np.array_equal(seen, all_seen[0])
        assert (reward, terminated, truncated) == (rewards[0], all_terminated[0], all_truncated[0])
        if terminated or truncated:
            break
    assert terminated or truncated


def test_a_new_episode_begins_by_itself(task):
    many = VectorEnv(num_envs=3, **task | {"terminated": None, "max_steps": 4})
    begin, _ = many.reset(seed=1)
    zero = np.zeros((3, 3))
    ends = []
    for _ in range(10):
        seen, rewards, _, truncated, _ = many.step(zero)
        ends.append(truncated.tolist())
    assert [all(e) for e in ends] == [False, False, False, True, False, False, False, False, True, False]
    assert np.array_equal(seen[:, 2], begin[:, 2])


def test_one_that_fails_has_terminated(task):
    many = VectorEnv(num_envs=2, **task)
    many.reset(seed=1)
    u = np.zeros((2, 3))
    u[0] = np.nan
    seen, _, terminated, _, _ = many.step(u)
    assert terminated.tolist() == [True, False]
    assert np.isfinite(seen).all()
    seen, rewards, terminated, _, _ = many.step(np.zeros((2, 3)))
    assert terminated.tolist() == [False, False]
    assert rewards[0] == 0.0
    one = Env(**task)
    one.reset(seed=1)
    assert one.step(np.full(3, np.nan))[2] is True
    one.reset()
    assert one.step(np.zeros(3))[2] is False


def test_domains_differ_by_seed(task):
    env = VectorEnv(num_envs=8, **task)
    u = np.tile([50.0, -25.0, -25.0], (8, 1))

    def first(seed):
        env.reset(seed=seed)
        return env.step(u)[0][:, 0]

    assert np.array_equal(first(1), first(1))
    assert not np.array_equal(first(1), first(2))
    assert len(set(first(1))) == 8


def test_actions_need_bounds(task):
    with pytest.raises(ValueError, match="u_a has no bounds"):
        Env(**task | {"bounds": {}})


def test_the_example_runs(archives, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["gym_drive.py", str(archives / "fmi3")])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    assert capsys.readouterr().out.count("mean reward") == 2


def test_a_step_takes_microseconds(task):
    env = Env(**task | {"terminated": None, "max_steps": None})
    env.reset(seed=1)
    action, best = np.zeros(3), np.inf
    for _ in range(5):
        begin = time.process_time()
        for _ in range(1000):
            env.step(action)
        best = min(best, (time.process_time() - begin) / 1000)
    assert best < 100e-6, best
    print(f"Env.step: {best * 1e6:.1f} us")
