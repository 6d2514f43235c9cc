"""What mypy checks: the public interface, used as it should be; each line with `# wrong` must be an error."""

import numpy as np

from fmurun import Batch, FmuError, Plan, simulate_fmu
from fmurun.fmpy import read_model_description

result = simulate_fmu("x.fmu", stop_time=1.0, start_values={"R": 3.0, "name": "text"}, output=["speed"])
speed: np.ndarray = result["speed"]
simulate_fmu("x.fmu", stop=1.0)  # wrong
plan = Plan({"p": "x.fmu"}, measures={"dip": ("p.speed", "min")}, input={"p.load": [(0.0, 1.0)]})
columns: dict[str, np.ndarray] = plan.run_many({"p.R": [1.0]}, threads=2)
Plan("x.fmu", connections="by hand")  # wrong
batch = Batch("x.fmu", 2, actions=["u"], observations=["i"], step_size=1e-4)
observations: np.ndarray = batch.step([[1.0], [2.0]], repeat=3)
warned: dict[int, str] = batch.warned
Batch("x.fmu", 2)  # wrong
try:
    steps, state = batch.save(0)
except FmuError as error:
    print(error.status, error.message.upper())
    error.reason  # wrong
names: list[str] = [v.name for v in read_model_description("x.fmu").modelVariables]
