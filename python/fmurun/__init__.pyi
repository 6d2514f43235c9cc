"""Types of the public interface."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import drives as drives
from . import fmpy as fmpy

__all__ = ["Batch", "FmuError", "FrequencyResponse", "Linearization", "Plan", "Trip", "Vehicle", "drives", "frequency_response", "identify", "linearize", "plot", "simulate_fmu", "vehicle"]

_Path = str | PathLike[str]
_Value = bool | int | float | str
_Interface = Literal["CoSimulation", "ModelExchange"]
_Table = Any  # a dictionary of columns, a structured array, a DataFrame of pandas or polars, a Table of pyarrow

class FmuError(Exception):
    function: str | None
    status: str | None
    instance: str | None
    message: str
    def __init__(self, function: str | None, status: str | None, instance: str | None, message: str) -> None: ...

def simulate_fmu(
    filename: _Path,
    validate: bool = True,
    start_time: float | str | None = None,
    stop_time: float | str | None = None,
    solver: Literal["Dopri", "RK4", "Euler", "CVode"] | None = None,
    step_size: float | str | None = None,
    relative_tolerance: float | str | None = None,
    output_interval: float | str | None = None,
    record_events: bool = True,
    fmi_type: _Interface | None = None,
    start_values: Mapping[str, Any] = {},
    apply_default_start_values: bool = False,
    input: NDArray[Any] | None = None,
    output: Sequence[str] | None = None,
    timeout: float | str | None = None,
    debug_logging: bool = False,
    visible: bool = False,
    logger: Callable[..., Any] | None = None,
    fmi_call_logger: Callable[[str], None] | None = None,
    step_finished: Callable[[float, Any], bool] | None = None,
    model_description: fmpy.ModelDescription | None = None,
    fmu_instance: fmpy.FMU2Slave | fmpy.FMU3Slave | fmpy.FMU2Model | fmpy.FMU3Model | None = None,
    set_input_derivatives: bool = False,
    remote_platform: str | None = "auto",
    early_return_allowed: bool = False,
    use_event_mode: bool = False,
    initialize: bool = True,
    terminate: bool = True,
    fmu_state: Any = None,
    set_stop_time: bool = True,
) -> fmpy.SimulationResult: ...

class Plan:
    def __init__(
        self,
        fmus: _Path | Mapping[str, _Path] | Sequence[_Path],
        *,
        connections: Literal["by_name"] | Sequence[tuple[str, str]] = "by_name",
        terminals: Sequence[tuple[str, str]] = (),
        start_values: Mapping[str, _Value] | None = None,
        input: Mapping[str, float | str | Sequence[tuple[float, float]]] | None = None,
        start_time: float | None = None,
        stop_time: float | None = None,
        step_size: float | None = None,
        output: Sequence[str] | None = None,
        measures: Mapping[str, str | tuple[str, str] | Mapping[str, Any]] | None = None,
        sequential: bool = False,
        embed: bool = False,
        fmi_type: _Interface | Mapping[str, _Interface] | None = None,
        solver: Literal["Dopri", "RK4"] | None = None,
        relative_tolerance: float | None = None,
        unit_conversion: bool = True,
    ) -> None: ...
    @staticmethod
    def from_toml(path: _Path, *, output: Sequence[str] | None = None, embed: bool = False) -> Plan: ...
    def simulate(self, start_values: Mapping[str, _Value] | None = None) -> fmpy.SimulationResult: ...
    def run_many(
        self,
        table: _Table,
        *,
        threads: int | None = None,
        first_run: int = 0,
        progress: bool | Callable[[int, int], object] | None = None,
    ) -> dict[str, NDArray[Any]]: ...
    def gradient(
        self, at: Mapping[str, float], *, step: float = 1e-4, threads: int | None = None
    ) -> tuple[dict[str, float], dict[str, dict[str, float]]]: ...
    def rows(self, first: int, count: int) -> dict[str, NDArray[Any]]: ...
    def meta(self, columns: Iterable[str] | None = None) -> dict[str, NDArray[Any]]: ...
    @property
    def measures(self) -> list[str]: ...
    def __len__(self) -> int: ...

def plot(result: NDArray[Any], columns: str | Sequence[str] | None = None, *, figure: Any = None) -> Any: ...

def vehicle(
    mass: float,
    cda: float,
    c_rr: float,
    radius: float,
    gear: float,
    *,
    gear_efficiency: float = 1.0,
    inertia: float = 0.0,
    rho: float = 1.2,
    g: float = 9.81,
) -> Vehicle: ...

class Vehicle:
    mass: float
    cda: float
    c_rr: float
    radius: float
    gear: float
    gear_efficiency: float
    inertia: float
    rho: float
    g: float
    def __init__(
        self,
        mass: float,
        cda: float,
        c_rr: float,
        radius: float,
        gear: float,
        *,
        gear_efficiency: float = 1.0,
        inertia: float = 0.0,
        rho: float = 1.2,
        g: float = 9.81,
    ) -> None: ...
    def resistance(self, v: float) -> float: ...
    def run(
        self,
        fmu: _Path,
        cycle: _Path | ArrayLike,
        *,
        start_values: Mapping[str, Any] | None = None,
        slope: float | ArrayLike = 0.0,
        driver: tuple[float, float] = (2.3, 0.6),
        sensor: bool = True,
        step_size: float = 0.02,
        stop_time: float | None = None,
        outputs: Sequence[str] = (),
    ) -> Trip: ...

class Trip:
    name: str
    result: NDArray[Any]
    distance: float
    energy: dict[str, float]
    losses: dict[str, float]
    temperatures: dict[str, float]
    efficiency: float
    def power(self, counter: str = "energy_in") -> NDArray[np.float64]: ...
    @property
    def wh_per_km(self) -> float: ...
    @property
    def balance(self) -> float: ...
    @property
    def error(self) -> float: ...
    def plot(self, *others: Trip, figure: Any = None) -> Any: ...

class Linearization:
    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    states: list[str]
    inputs: list[str]
    outputs: list[str]
    x: NDArray[np.float64]
    u: NDArray[np.float64]
    y: NDArray[np.float64]
    dx: NDArray[np.float64]
    method: str
    left_out: list[str]

class FrequencyResponse:
    frequency: NDArray[np.float64]
    value: NDArray[np.complex128]
    amplitude: NDArray[np.float64]
    nonlinear: NDArray[np.float64]
    unsettled: NDArray[np.float64]
    stepped: NDArray[np.float64]
    doubts: list[str]
    @property
    def decibels(self) -> NDArray[np.float64]: ...
    @property
    def phase(self) -> NDArray[np.float64]: ...
    def band(self) -> dict[str, float | None]: ...
    def open_loop(self) -> FrequencyResponse: ...
    def margins(self) -> dict[str, float | None]: ...

def frequency_response(
    fmus: _Path | Mapping[str, _Path] | Sequence[_Path],
    input: str,
    output: str,
    *,
    over: str | None = None,
    frequencies: ArrayLike | None = None,
    amplitude: float | None = None,
    settle_time: float | None = None,
    step_size: float | None = None,
    start_values: Mapping[str, _Value] | None = None,
    inputs: Mapping[str, float | str | Sequence[tuple[float, float]]] | None = None,
    connections: Literal["by_name"] | Sequence[tuple[str, str]] = "by_name",
    fmi_type: _Interface | Mapping[str, _Interface] | None = None,
    relative_tolerance: float | None = None,
    threads: int | None = None,
    isolate: bool = True,
) -> FrequencyResponse: ...

def identify(
    frame: Any,
    *,
    n_p: int,
    current: float | None = None,
    speed: float | None = None,
    torque: float | None = None,
    u_dc: float | None = None,
    delay: float | None = None,
    every: int | None = None,
    rate: float | None = None,
    zero: tuple[float, float] | None = None,
    load: str | None = None,
    map: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> dict[str, Any]: ...
def linearize(
    fmu: _Path,
    point: Mapping[str, _Value] | None = None,
    *,
    time: float = 0.0,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    method: Literal["derivatives", "differences"] | None = None,
) -> Linearization: ...

class Batch:
    n: int
    actions: tuple[str, ...]
    observations: tuple[str, ...]
    step_size: float
    def __new__(
        cls,
        fmu: _Path,
        n: int = 1,
        *,
        actions: Sequence[str],
        observations: Sequence[str],
        step_size: float,
        start_values: Mapping[str, ArrayLike | str] | None = None,
        threads: int = 1,
    ) -> Batch: ...
    def reset(
        self, mask: ArrayLike | None = None, start_values: Mapping[str, ArrayLike | str] | None = None
    ) -> NDArray[np.float64]: ...
    def step(
        self, actions: ArrayLike, repeat: int = 1, out: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]: ...
    def observe(self) -> NDArray[np.float64]: ...
    def save(self, k: int) -> tuple[int, bytes]: ...
    def restore(self, k: int, state: tuple[int, bytes]) -> None: ...
    @property
    def failed(self) -> dict[int, FmuError]: ...
    @property
    def warned(self) -> dict[int, str]: ...
