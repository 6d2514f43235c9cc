"""FMPy's functions and classes for one FMU, by the same names: scripts change their import.

    from fmurun.fmpy import extract, instantiate_fmu, read_model_description

`read_model_description` returns objects with FMPy's attributes; `instantiate_fmu` returns an `FMU2Slave`, `FMU3Slave`,
`FMU2Model` or `FMU3Model` with FMPy's methods. An `FmuError` (also `FMICallException` here) names the failed call and the
cause. Scheduled Execution, intermediate update and functions of clocks are not supported.
"""

from ._description import (
    CoSimulation,
    DefaultExperiment,
    ModelDescription,
    ModelVariable,
    ScalarVariable,
)
from ._error import FmuError
from ._instance import (
    FMU2Model,
    FMU2Slave,
    FMU3Model,
    FMU3Slave,
    dump,
    extract,
    instantiate_fmu,
    read_model_description,
)
from ._simulate import SimulationResult, simulate_fmu

FMICallException = FmuError

__all__ = [
    "CoSimulation", "DefaultExperiment", "FMICallException", "FMU2Model", "FMU2Slave", "FMU3Model", "FMU3Slave", "FmuError",
    "ModelDescription", "ModelVariable", "ScalarVariable", "SimulationResult", "dump", "extract", "instantiate_fmu", "read_model_description",
    "simulate_fmu",
]  # fmt: skip
