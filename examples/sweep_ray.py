"""A sweep by Ray: chunks of rows as tasks; Ray repeats them when a worker dies.

    pip install ray
    python examples/sweep_ray.py target/fmu/fmi3
"""

import sys

import numpy as np
import ray
from fmurun import Plan

N, CHUNK = 1000, 100
plan = Plan(f"{sys.argv[1]}/PmsmDrive.fmu", start_values={"speed_ref": 20.0}, stop_time=0.2, step_size=1e-3,
            measures={"dip": ("speed", "min"), "speed": "speed"})  # fmt: skip
r_s = np.random.default_rng(7).normal(3.0, 0.1, N)


@ray.remote(max_retries=3)
def work(first, rows):
    return plan.run_many({"plant.motor.R_s": rows}, threads=1, first_run=first)


ray.init(num_cpus=2, include_dashboard=False)
parts = ray.get([work.remote(first, r_s[first : first + CHUNK]) for first in range(0, N, CHUNK)])
speed = np.concatenate([part["speed"] for part in parts])
same = np.array_equal(speed, plan.run_many({"plant.motor.R_s": r_s})["speed"])
print(f"{len(speed)} rows, speed {speed.mean():.3f} rad/s, equal to one process: {same}")
