"""A sweep on a Dask cluster, here one of two processes: parts as Parquet files, every row once.

    python examples/sweep_dask.py target/fmu/fmi3 results          again: resumes
"""

import sys

import numpy as np
import pyarrow.parquet as pq
from distributed import Client, LocalCluster
from fmurun import Plan
from fmurun.dask import sweep


def main(folder, out, n=1000):
    generator = np.random.default_rng(7)
    plan = Plan(f"{folder}/PmsmDrive.fmu", input={"speed_ref": [(0.0, 0.0), (0.05, 20.0)]}, stop_time=0.2, step_size=1e-3,
                measures={"dip": ("speed", "min"), "lost": ("lock_lost", "max"), "speed": "speed"})  # fmt: skip
    rows = {"plant.motor.R_s": generator.normal(3.0, 0.1, n), "tau_load": generator.uniform(0.0, 1.0, n)}
    with LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        print(sweep(plan, rows, out, client))
    table = pq.read_table(out)
    print(f"{table.num_rows} rows, speed {np.mean(table['speed']):.3f} rad/s, {np.sum(table['lost']):.0f} lost")


if __name__ == "__main__":
    main(*sys.argv[1:3])
