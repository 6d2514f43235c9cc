"""The paper's experiments, and how their figures are computed from a trace.

Units here: rpm, degrees, N.m, A, s. Expected values hold for the reference motor with the start values of the FMUs.
"""

from dataclasses import dataclass, field

import numpy as np

RPM = np.pi / 30.0


def schedule(*steps):
    """A function of time that holds each value from its time on, and 0 before the first."""

    def value(t):
        found = 0.0
        for since, new in steps:
            if t >= since - 1e-9:
                found = new
        return found

    return value


@dataclass(frozen=True)
class Scenario:
    """Settings and inputs over time; speeds in rad/s, as in the FMUs."""

    duration: float
    speed_ref: object = field(default_factory=schedule)
    load: object = field(default_factory=schedule)
    plant: dict = field(default_factory=dict)
    controller: dict = field(default_factory=dict)
    T_s: float = 1e-4


def step_to(speed):
    """Speed step at t = 0.1 s."""
    return Scenario(duration=1.4, speed_ref=schedule((0.1, speed * RPM)))


SCENARIOS = {
    # First start from the worst angle, stop, second start.
    "start": Scenario(
        duration=3.2,
        plant={"initial.theta_e": np.pi},
        speed_ref=schedule((0.2, 500 * RPM), (1.2, 0.0), (2.2, 500 * RPM)),
    ),
    "step 500": step_to(500.0),
    "step 1000": step_to(1000.0),
    "step 1500": step_to(1500.0),
    "load 0": Scenario(duration=6.5, load=schedule((0.5, 2.0))),
    "load 1000": Scenario(duration=2.0, speed_ref=schedule((0.0, 1000 * RPM)), load=schedule((1.0, 2.0))),
}


class Window:
    """A trace between two times."""

    def __init__(self, trace, since, until):
        inside = (trace["t"] > since - 1e-9) & (trace["t"] < until + 1e-9)
        self.t = trace["t"][inside] - since
        self.speed = trace["speed"][inside] / RPM
        self.speed_est = trace["speed_est"][inside] / RPM
        error = np.degrees(trace["theta_est"][inside] - trace["theta_e"][inside])
        self.error = error - 360.0 * np.ceil((error - 180.0) / 360.0)
        self.i_d, self.i_q = trace["i_d"][inside], trace["i_q"][inside]

    def settled(self, values, target, band):
        """Time from which on the values stay within the band; infinite if they do not."""
        outside = np.flatnonzero(~(np.abs(values - target) < band))
        if not outside.size:
            return 0.0
        return self.t[outside[-1] + 1] if outside[-1] + 1 < self.t.size else np.inf

    def rise(self, speed):
        """10-90 % rise time to a speed, both passages interpolated."""
        passages = []
        for level in (0.1 * speed, 0.9 * speed):
            k = int(np.argmax(self.speed >= level))
            passages.append(np.interp(level, self.speed[k - 1 : k + 1], self.t[k - 1 : k + 1]))
        return passages[1] - passages[0]

    def steady(self, values):
        """Mean of the last tenth of a second."""
        return values[self.t > self.t[-1] - 0.1].mean()
