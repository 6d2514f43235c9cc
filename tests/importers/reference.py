"""The experiments that every importer runs, and what the native run of the same exchange order gave."""

import json
import os
from bisect import bisect_right
from pathlib import Path

T_S = 1e-4  # s: communication step of the pair
DRIVE_STEP = 1e-3  # s: communication step of the whole drive
PHASES = "abc"
LINKS = [("plant", f"i_{p}", "controller", f"i_{p}") for p in PHASES] + [("controller", f"u_{p}", "plant", f"u_{p}") for p in PHASES]
RECORDED = [("plant", "speed"), ("plant", "i_q"), ("controller", "theta_est"), ("controller", "i_q_ref")]
NAMES = {"plant": "PmsmPlant", "controller": "SensorlessController"}


class Experiment:
    """Inputs over time, and native traces by exchange order."""

    def __init__(self, entry):
        self.entry = entry
        self.name = entry["name"]
        self.theta_e, self.steps, self.every = entry["theta_e"], entry["steps"], entry["every"]

    def speed_ref(self, k):
        """Speed reference in rad/s during step k."""
        return at(self.entry["speed_ref"], k * T_S)

    def load(self, k):
        """Load torque in N.m during step k."""
        return at(self.entry["load"], k * T_S)

    def inputs(self, t):
        """Speed reference in rad/s and load torque in N.m at t in s."""
        return at(self.entry["speed_ref"], t), at(self.entry["load"], t)

    def changes(self, k):
        """Inputs that change at the beginning of step k: instance, variable, value."""
        for instance, variable, value in (("controller", "speed_ref", self.speed_ref), ("plant", "tau_load", self.load)):
            if k and value(k) != value(k - 1):
                yield instance, variable, value(k)

    def delay(self, order):
        """`timing.delay` that belongs to the order."""
        return self.entry[order]["delay"]

    def check(self, rows, order, rounding=0.0):
        """Every row (in the order of RECORDED) is the native one, bit for bit if no rounding is allowed."""
        native = [self.entry[order][name] for _, name in RECORDED]
        assert len(rows) == len(native[0])
        for k, row in enumerate(rows):
            for (_, name), value, expected in zip(RECORDED, row, (column[k] for column in native)):
                assert abs(value - expected) <= rounding, f"{name} at {k * self.every * T_S:.3f} s: {value}, native {expected}"
        speed = [row[0] for row in rows]
        assert max(map(abs, speed)) > 10.0, "the rotor moved"

    def check_drive(self, speed, rounding):
        """The drive's speed at every communication point is the native one, within the rounding (rad/s)."""
        native = self.entry["drive"]
        assert len(speed) == len(native)
        off = [abs(a - b) for a, b in zip(speed, native)]
        assert max(off) <= rounding, f"{max(off)} rad/s at {off.index(max(off)) * DRIVE_STEP:.3f} s"
        assert max(map(abs, speed)) > 10.0, "the rotor moved"


def at(schedule, t):
    """Value of an input that holds each entry from its time on."""
    index = bisect_right([start - 1e-9 for start, _ in schedule], t)
    return schedule[index - 1][1] if index else 0.0


FILE = os.environ.get("FMU_REFERENCE")
EXPERIMENTS = [Experiment(entry) for entry in json.loads(Path(FILE).read_text())] if FILE else []
