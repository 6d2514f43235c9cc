"""Load step of 2 N.m at standstill in PyFMI (not in the tests: PyFMI comes from conda-forge).

    cargo run --release -- build --fmi 2
    conda install -c conda-forge pyfmi
    python examples/pyfmi_load_step.py target/fmu/fmi2

PyFMI imports co-simulation FMUs of FMI 2.0 only. Its master steps both FMUs and then exchanges all values, so
`timing.delay` stays 1.
"""

import sys
from math import degrees, pi, remainder

from pyfmi import load_fmu
from pyfmi.master import Master

folder = sys.argv[1] if len(sys.argv) > 1 else "target/fmu/fmi2"
plant = load_fmu(f"{folder}/PmsmPlant.fmu", kind="CS")
controller = load_fmu(f"{folder}/SensorlessController.fmu", kind="CS")
controller.set("motor.R_s", 1.8)

connections = [(controller, f"u_{p}", plant, f"u_{p}") for p in "abc"]
connections += [(plant, f"i_{p}", controller, f"i_{p}") for p in "abc"]
master = Master([plant, controller], connections)
options = master.simulate_options()
options["step_size"] = 1e-4  # s: the controller's sample period; the default of 0.01 s loses the drive


def load(time):
    """Return the load torque in N.m."""
    return 2.0 if time >= 0.5 - 1e-9 else 0.0


results = master.simulate(final_time=3.0, input=([(plant, "tau_load")], load), options=options)
motor, control = results[plant], results[controller]
error = degrees(remainder(control["theta_est"][-1] - motor["theta_e"][-1], 2 * pi))
print(f"at the end {motor['speed'][-1] * 30 / pi:.2f} rpm, i_sd {control['i_d'][-1]:.3f} A, angle error {error:.2f} deg")
print("expected: 0.00 rpm, 5.000 A, 36.34 deg")
