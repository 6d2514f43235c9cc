"""Field weakening of the packed drive: torque far above base speed, on a shaft that is driven at constant speed.

The reference motor at 7.5 A and 325 V: the controller uses 0.95 of the voltage u_dc / sqrt 3. The limits follow from
|i| <= 7.5 A and |R_s i + j w psi| <= 0.95 u_dc / sqrt 3; base speed is 3330 rpm.
"""

import numpy as np
import pytest
from fmpy import simulate_fmu

from scenarios import RPM

STANDARDS = pytest.mark.parametrize("standard", [2, 3], ids=["fmi2", "fmi3"])
# Speed in rpm, maximum motoring and generating torque in N.m.
ENVELOPE = [(3000.0, 5.0625, -5.0625), (4000.0, 4.2045, -5.0493), (4500.0, 3.0945, -4.5584), (5000.0, 1.7105, -3.4982)]


def drive(archives, standard, speed, tau_ref, use=True, stop=0.5, log=None):
    """Torque requested at constant speed; everything else at its start value, with the shaft sensor. `log` collects
    the messages of the FMU."""
    w = speed * RPM
    inputs = np.array(
        [(0.0, w, 0.0, tau_ref), (stop, w, w * stop, tau_ref)],
        dtype=[(name, float) for name in ("time", "speed_shaft", "angle_shaft", "tau_ref")],
    )
    start = {
        "plant.mechanics.imposed": True,
        "controller.speed_loop.torque_mode": True,
        "controller.estimator": 13,  # Sensored
        "controller.motor.R_s": 2.0,  # the machine's; the start value is 10 % less
        "controller.limit.i": 7.5,
        "controller.limit.i_q": 7.5,
        "controller.limit.tau": 1000.0,
        "controller.weakening.use": use,
    }
    return simulate_fmu(
        archives / f"fmi{standard}" / "PmsmDrive.fmu",
        stop_time=stop,
        output_interval=1e-3,
        input=inputs,
        start_values=start,
        output=["tau_e", "tau_max", "tau_min", "u_share", "weakens", "i_d", "current_limited"],
        debug_logging=log is not None,
        logger=None if log is None else lambda *arguments: log.append(arguments[-1].decode()),
    )


@STANDARDS
@pytest.mark.parametrize(("speed", "motoring", "generating"), ENVELOPE)
def test_envelope(archives, standard, speed, motoring, generating):
    for tau_ref, limit in ((20.0, motoring), (-20.0, generating)):
        result = drive(archives, standard, speed, tau_ref)
        assert result["tau_max"][-1] == pytest.approx(motoring, rel=1e-3)
        assert result["tau_min"][-1] == pytest.approx(generating, rel=1e-3)
        assert result["tau_e"][-50:].mean() == pytest.approx(limit, rel=0.01)
        assert result["weakens"][-1] == (speed > 3400.0 or (tau_ref < 0.0 and speed > 3900.0))


@STANDARDS
def test_without_it_the_voltage_limits(archives, standard):
    result = drive(archives, standard, 4500.0, 20.0, use=False)
    assert result["tau_e"][-50:].mean() < 2.5
    assert not result["weakens"].any()


@STANDARDS
@pytest.mark.parametrize(("tau_ref", "limit"), [(20.0, 3.0945), (-20.0, -4.5584)])
def test_a_clipped_request_is_told_once_a_second(archives, standard, tau_ref, limit):
    log = []
    result = drive(archives, standard, 4500.0, tau_ref, stop=3.5, log=log)
    assert result["current_limited"][100:].all()
    assert result["tau_max" if tau_ref > 0.0 else "tau_min"][-1] == pytest.approx(limit, rel=1e-3)
    messages = [message for message in log if "clipped" in message]
    # After 1, 2 and 3 s, each with the request and what the drive gives.
    assert len(messages) == 3, log
    for message in messages:
        assert f"tau_ref = {tau_ref:.0f} N.m" in message and "(tau_min, tau_max)" in message
        given = [float(word) for word in message.split("gives ")[1].split(" N.m")[0].split(" to ")]
        assert given == pytest.approx([-4.5584, 3.0945], rel=1e-3)


@STANDARDS
def test_a_request_within_the_envelope_is_not_clipped(archives, standard):
    log = []
    result = drive(archives, standard, 4500.0, 2.9, stop=1.5, log=log)
    assert result["tau_e"][-50:].mean() == pytest.approx(2.9, rel=0.01)
    assert not result["current_limited"][100:].any()
    assert not [message for message in log if "clipped" in message]
