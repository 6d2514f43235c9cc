"""A sweep by joblib: separate processes, chunks of rows; one dictionary of arrays at the end.

    python examples/sweep_joblib.py target/fmu/fmi3
"""

import sys

import numpy as np
from fmurun import Plan
from joblib import Parallel, delayed


def main(folder, n=1000, chunk=100):
    plan = Plan(f"{folder}/PmsmDrive.fmu", start_values={"speed_ref": 20.0}, stop_time=0.2, step_size=1e-3,
                measures={"dip": ("speed", "min"), "speed": "speed"})  # fmt: skip
    r_s = np.random.default_rng(7).normal(3.0, 0.1, n)

    def work(first):
        return plan.run_many({"plant.motor.R_s": r_s[first : first + chunk]}, threads=1, first_run=first)

    parts = Parallel(n_jobs=2)(delayed(work)(first) for first in range(0, n, chunk))
    results = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    print(f"{len(results['run'])} rows, {sum(map(bool, results['error']))} failed, speed {results['speed'].mean():.3f} rad/s")
    return results


if __name__ == "__main__":
    main(sys.argv[1])
