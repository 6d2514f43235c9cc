"""Load step of 2 N.m at standstill in OMSimulator (not in the tests: installing its package downloads the program).

    cargo run --release -- build --fmi 2
    pip install OMSimulator
    python examples/omsimulator.py target/fmu/fmi2

This script uses the `SSP` class of OMSimulator 3. Older versions have `OMSimulator()`, `newModel`,
`addSystem(..., system_wc)`, `addSubModel`, `addConnection`, `setFixedStepSize`, `setReal` and `simulate` for the same
steps. The fixed-step master `oms_ma` steps all FMUs and then exchanges all values, so `timing.delay` stays 1.
"""

import sys

from OMSimulator import SSP, CRef

folder = sys.argv[1] if len(sys.argv) > 1 else "target/fmu/fmi2"
FMUS = {"plant": "PmsmPlant", "controller": "SensorlessController"}
T_S = 1e-4  # s: the controller's sample period

model = SSP()
for name, fmu in FMUS.items():
    model.addResource(f"{folder}/{fmu}.fmu", new_name=f"resources/{fmu}.fmu")
    model.addComponent(CRef("default", name), f"resources/{fmu}.fmu")
for phase in "abc":
    model.addConnection(CRef("default", "controller", f"u_{phase}"), CRef("default", "plant", f"u_{phase}"))
    model.addConnection(CRef("default", "plant", f"i_{phase}"), CRef("default", "controller", f"i_{phase}"))
model.newSolver({"name": "master", "method": "oms_ma", "fixedStepSize": T_S})
for name in FMUS:
    model.setSolver(CRef("default", name), "master")

run = model.instantiate()
run.setStopTime(3.0)
run.setResultFile("load_step.mat")
run.setValue(CRef("default", "controller", "motor.R_s"), 1.8)
run.initialize()
run.stepUntil(0.5)
run.setValue(CRef("default", "plant", "tau_load"), 2.0)
run.stepUntil(3.0)
speed, i_d = (run.getValue(CRef("default", *name)) for name in (("plant", "speed"), ("controller", "i_d")))
print(f"at the end {speed * 9.5493:.2f} rpm, i_sd {i_d:.3f} A; expected: 0.00 rpm and 5.000 A")
run.terminate()
run.delete()
