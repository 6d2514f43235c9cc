"""Gymnasium: current control of the machine as an environment; the agent chooses the voltages in d and q.

    pip install gymnasium
    python examples/gym_drive.py target/fmu/fmi3
"""

import sys
import time

import numpy as np
from fmurun.gym import Env, VectorEnv


def task(folder):
    actions, observations = ["u_a", "u_b", "u_c"], ["i_d", "i_q", "speed", "theta_e"]
    bounds = {name: (-200.0, 200.0) for name in actions} | {"i_d": (-100, 100), "i_q": (-100, 100)}
    reward = lambda seen, chosen: -np.abs(seen[:, 1] - 2.0) - 1e-4 * np.abs(chosen).sum(axis=1)
    return {"fmu": f"{folder}/PmsmPlant.fmu", "actions": actions, "observations": observations, "step_size": 1e-4,
            "reward": reward, "terminated": lambda seen: np.abs(seen[:, :2]).max(axis=1) > 50.0, "bounds": bounds,
            "max_steps": 200, "randomize": lambda generator, n: {"motor.R_s": generator.normal(2.0, 0.1, n)}}  # fmt: skip


if __name__ == "__main__":
    for env in (Env(**task(sys.argv[1])), VectorEnv(num_envs=64, **task(sys.argv[1]))):
        env.action_space.seed(1), env.reset(seed=1)
        begin, n = time.perf_counter(), 2000
        total = sum(np.mean(env.step(env.action_space.sample())[1]) for _ in range(n))
        print(f"{type(env).__name__}: mean reward {total / n:.3f}, {(time.perf_counter() - begin) / n * 1e6:.1f} us a step")
