"""What Model Exchange costs in FMPy 0.3.32: `python benches/model_exchange.py target/fmu/fmi3/PmsmDrive.fmu`.

The start to 1500 rpm with 1 N.m, 1 s: processor time as a multiple of that of Co-Simulation, the least of three rounds in turn;
then the calls and the counters of CVode per sample of the controller. Every run finds the archive unpacked and its description
read. With fmurun installed, its integrator runs beside FMPy's.

With a second argument it only integrates so many seconds: under `valgrind --tool=callgrind`, two of them give the instructions
per sample, and the share of the FMU's library.
"""

import sys
import time
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description, simulate_fmu

sys.path.insert(0, str(Path(__file__).parent.parent / "tests/fmpy"))
import counted

archive, SAMPLES, ROUNDS = sys.argv[1], 10_000, 3
START = {"stop_time": 1.0, "output_interval": 1e-3, "start_values": {"speed_ref": 157.0, "tau_load": 1.0}}
FEW = {**START, "output": ["i_d", "i_q", "speed"], "record_events": False}
EXCHANGE = {"fmi_type": "ModelExchange", "solver": "CVode"}

if len(sys.argv) > 2:
    simulate_fmu(archive, **EXCHANGE, **{**FEW, "stop_time": float(sys.argv[2])})
    sys.exit()
OPEN = {"filename": extract(archive), "model_description": read_model_description(archive)}
reference = simulate_fmu(**OPEN, **{**FEW, "output_interval": 1e-4})[::10]
runs = {
    "Co-Simulation at 1 ms": lambda: simulate_fmu(**OPEN, **FEW),
    "Co-Simulation at 0.1 ms": lambda: simulate_fmu(**OPEN, **{**FEW, "output_interval": 1e-4}),
    "CVode, all outputs at all events": lambda: simulate_fmu(**OPEN, **EXCHANGE, **START),
    "CVode, three outputs each 1 ms": lambda: simulate_fmu(**OPEN, **EXCHANGE, **FEW),
    "CVode, the same, tolerance 1e-6": lambda: simulate_fmu(**OPEN, **EXCHANGE, **FEW, relative_tolerance=1e-6),
}
try:
    import fmurun

    for tolerance in (1e-5, 1e-6):
        arguments = {"fmi_type": "ModelExchange", "solver": "Dopri", "relative_tolerance": tolerance}
        runs[f"fmurun, three outputs, {tolerance:.0e}"] = lambda a=arguments: fmurun.simulate_fmu(archive, **a, **FEW)
except ImportError:
    print("without fmurun")

least, apart = dict.fromkeys(runs, np.inf), {}
for _ in range(ROUNDS):
    for name, run in runs.items():
        begun = time.process_time()
        result = run()
        least[name] = min(least[name], time.process_time() - begun)
        rows = np.searchsorted(result["time"], reference["time"] + 1e-9) - 1
        apart[name] = np.abs(result["i_q"][rows] - reference["i_q"]).max()
for name, seconds in least.items():
    ratio = seconds / least["Co-Simulation at 1 ms"]
    print(f"{name:34} {seconds:7.3f} s {ratio:7.1f} times  i_q {apart[name]:.1e} A from Co-Simulation")

for exact in (False, True):
    _, counts = counted.simulate(archive, exact=exact, **FEW)
    print("directional derivatives:" if exact else "differences:")
    print("  " + ", ".join(f"{name} {number / SAMPLES:.2f}" for name, number in sorted(counts.items())))
