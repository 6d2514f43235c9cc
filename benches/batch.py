"""Steps per second and core of `fmurun.Batch`, beside gym-electric-motor 3.0.3 and exciting-environments 0.2.4 if they are
installed: `python benches/batch.py target/fmu/fmi3`.

1000 instances, and one of gym-electric-motor, on one core: the least processor time of five rounds in turn. The actions are
random voltages, or torques of `PmsmDrive`. exciting-environments has a machine without a shaft, in single precision.
"""

import os
import sys
import time
import warnings

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})

import numpy as np
from fmurun import Batch

folder, N, STEPS, ROUNDS = sys.argv[1], 1000, 20, 5
draw = np.random.default_rng(1).uniform
voltages = ["u_a", "u_b", "u_c"]


def plant():
    batch = Batch(
        f"{folder}/PmsmPlant.fmu", N, actions=voltages, observations=["i_d", "i_q", "speed", "theta_e"], step_size=1e-4
    )
    batch.reset()
    actions = draw(-60.0, 60.0, (STEPS, N, 3))
    return N, lambda: [batch.step(action) for action in actions]


def drive():
    start = {"controller.speed_loop.torque_mode": True}
    batch = Batch(f"{folder}/PmsmDrive.fmu", N, actions=["tau_ref", "tau_load"], observations=["i_d", "i_q", "speed"],
                  step_size=1e-3, start_values=start)  # fmt: skip
    batch.reset()
    actions = draw(0.0, 1.0, (STEPS, N, 2))
    return N, lambda: [batch.step(action) for action in actions]


def gym_electric_motor():
    import gym_electric_motor

    env = gym_electric_motor.make("Cont-CC-PMSM-v0")
    env.reset(seed=1)
    actions = draw(-0.3, 0.3, (STEPS, *env.action_space.shape))

    def run():
        for action in actions:
            if env.step(action)[2]:
                env.reset()

    return 1, run


def exciting(method):
    def make():
        import diffrax
        import jax
        from exciting_environments.pmsm.pmsm_env import PMSM

        env = PMSM(batch_size=N, solver=getattr(diffrax, method)(), tau=1e-4)
        _, state = env.vmap_reset()
        actions = [jax.numpy.asarray(action) for action in draw(-0.3, 0.3, (STEPS, N, 2))]

        def run():
            at = state
            for action in actions:
                seen, at = env.vmap_step(at, action)
            seen.block_until_ready()

        return N, run

    return make


ways = {
    "fmurun.Batch, PmsmPlant, 0.1 ms": plant,
    "fmurun.Batch, PmsmDrive, 1 ms": drive,
    "gym-electric-motor, Cont-CC-PMSM-v0, 0.1 ms": gym_electric_motor,
    "exciting-environments, PMSM, Euler, 0.1 ms": exciting("Euler"),
    "exciting-environments, PMSM, Tsit5, 0.1 ms": exciting("Tsit5"),
}
warnings.filterwarnings("ignore")
ready = {}
for name, make in ways.items():
    try:
        ready[name] = make()
    except ImportError as missing:
        print(f"{name}: {missing.name} is not installed")
least = dict.fromkeys(ready, float("inf"))
for turn in range(ROUNDS + 1):
    for name, (_, run) in ready.items():
        begin = time.process_time()
        run()
        # The first round compiles.
        least[name] = min(least[name], time.process_time() - begin) if turn else float("inf")
for name, seconds in least.items():
    print(f"{name}: {ready[name][0] * STEPS / seconds:,.0f} steps a second and core")
