"""Frequency responses of running FMUs."""

import warnings
from dataclasses import dataclass, field

import numpy as np

from . import _core
from ._error import FmuError
from ._isolated import isolated
from ._plan import Plan, _number


@dataclass
class FrequencyResponse:
    """The response G of an output to an input, or to another variable, at each frequency.

    Attributes:
        frequency: in Hz; those asked for, moved to the grid of the communication steps
        value: complex: gain and phase of the output against the input
        amplitude: of the input
        nonlinear, unsettled, stepped: relative change of the value at half the amplitude, from the last period to this, and with half
            the communication step (the value is extrapolated from both)
        doubts: a text for each frequency, empty where nothing is doubtful
    """

    frequency: np.ndarray
    value: np.ndarray
    amplitude: np.ndarray = field(repr=False)
    nonlinear: np.ndarray = field(repr=False)
    unsettled: np.ndarray = field(repr=False)
    stepped: np.ndarray = field(repr=False)
    doubts: list = field(repr=False)

    @property
    def decibels(self):
        """Gain in dB."""
        return 20.0 * np.log10(np.abs(self.value))

    @property
    def phase(self):
        """Phase in degrees, without jumps."""
        return _core.phases(self.frequency, self.value)

    def band(self):
        """Of a closed loop: `bandwidth` (Hz, None if not reached) at -3 dB below the lowest frequency, `peak` (dB) and `peak_at` (Hz)."""
        return _core.loop_properties(self.frequency, self.value, False)

    def open_loop(self):
        """The open loop L = G / (1 - G) of a closed one, as another response."""
        return FrequencyResponse(self.frequency, self.value / (1.0 - self.value), self.amplitude, self.nonlinear,
                                 self.unsettled, self.stepped, self.doubts)  # fmt: skip

    def margins(self):
        """Of an open loop with the feedback -L, interpolated between the frequencies; None without a crossing.

        Returns:
            `crossover` (Hz), `phase_margin` (deg) and `delay_margin` (s); `phase_crossover` (Hz) and `gain_margin` (dB); `sensitivity`
            (dB), the largest, and `sensitivity_at` (Hz)
        """
        return _core.loop_properties(self.frequency, self.value, True)


def frequency_response(fmus, input, output, *, over=None, frequencies=None, amplitude=None, settle_time=None,
                       step_size=None, start_values=None, inputs=None, connections="by_name", fmi_type=None,
                       relative_tolerance=None, threads=None, isolate=True):  # fmt: skip
    """The frequency response of running FMUs by a swept sine, as `fmu bode` measures it: a sampled controller is in it.

    At each frequency, runs reach the operating point, then whole periods are measured. A warning names frequencies at which the system
    is not linear, has not settled, or needs a shorter step.

    Args:
        fmus: as for `Plan`
        input: the input, or tunable parameter, that gets the sine; its operating point is that of `inputs`, `start_values` or the FMU
        output: the variable that responds
        over: a variable whose response is the reference, instead of the input
        frequencies: in Hz; by default 10 a decade from 2e-4 to 0.2 times 1 / step_size
        amplitude: of the input; by default a hundredth of its size, reduced until the FMUs are linear
        settle_time: from the start to the operating point (s); by default the duration of the default experiments
        step_size: communication step (s), preferably the sample period of a controller; high frequencies use fractions of it
        start_values, inputs: name -> value, and name -> values over time, as `start_values` and `input` of `Plan`
        connections, fmi_type, relative_tolerance: as for `Plan`
        threads: by default all processors
        isolate: the FMUs run in a process of their own, so one that crashes raises an `FmuError`; False: in this process

    >>> response = frequency_response(PLANT, "tau_load", "speed", frequencies=[10.0, 100.0], step_size=1e-4, settle_time=0.1,
    ...                               start_values={"mechanics.tau_coulomb": 0.0, "motor.psi_M": 1e-6})
    >>> bool(np.allclose(response.value * (2e-4 + 2j * np.pi * response.frequency * 1.5e-3), -1.0, rtol=1e-3))
    True
    """
    if isolate:
        return isolated("_frequency", "frequency_response", {**locals(), "isolate": False})
    plan = Plan(fmus, connections=connections, start_values=start_values, input=inputs, step_size=step_size,
                fmi_type=fmi_type, relative_tolerance=relative_tolerance)  # fmt: skip
    if threads is not None and threads < 1:
        raise ValueError(f"threads must be at least 1, not {threads}")
    frequencies = [] if frequencies is None else np.atleast_1d(np.asarray(frequencies, float)).ravel().tolist()
    frequency, value, amplitudes, checks, doubts, text = _core.frequency_response(
        plan._core, plan._name(input), plan._name(output), None if over is None else plan._name(over), frequencies,
        None if amplitude is None else float(amplitude), _number("settle_time", settle_time), threads or 0)  # fmt: skip
    if not np.isfinite(value).any():
        raise FmuError(None, None, None, f"frequency_response: {doubts[0]}")
    if text:
        warnings.warn(text, stacklevel=2)
    bad = [f"{f:.4g} Hz: {doubt}" for f, doubt in zip(frequency, doubts) if doubt]
    if bad:
        more = f", and {len(bad) - 1} other frequencies" if len(bad) > 1 else ""
        warnings.warn(f"{bad[0]}{more}", stacklevel=2)
    return FrequencyResponse(frequency, value, amplitudes, *checks, doubts)
