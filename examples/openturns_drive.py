"""OpenTURNS: the drive as a function of its parameters, and Sobol indices of its speed.

    pip install openturns
    python examples/openturns_drive.py target/fmu/fmi3
"""

import sys

import numpy as np
import openturns as ot
from fmurun import Plan

names, measures = ["plant.motor.R_s", "tau_load"], ["dip", "speed"]
plan = Plan(f"{sys.argv[1]}/PmsmDrive.fmu", input={"speed_ref": [(0.0, 0.0), (0.05, 20.0)]}, stop_time=0.2, step_size=1e-3,
            measures={"dip": ("speed", "min"), "speed": "speed"})  # fmt: skip


def many(points):
    results = plan.run_many(dict(zip(names, np.asarray(points).T)))
    return np.column_stack([results[name] for name in measures])


drive = ot.PythonFunction(len(names), len(measures), func_sample=many)
inputs = ot.JointDistribution([ot.Normal(3.0, 0.1), ot.Uniform(0.0, 1.0)])
indices = ot.SaltelliSensitivityAlgorithm(inputs, 500, drive)
for k, measure in enumerate(measures):
    print(measure, ", ".join(f"{name} {index:.2f}" for name, index in zip(names, indices.getFirstOrderIndices(k))))
