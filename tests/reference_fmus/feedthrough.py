"""Feedthrough.fmu in FMPy: all start values, and the inputs of the original's Feedthrough_in.csv."""
import sys

import fmpy
from fmpy.util import read_csv
from fmpy.validation import validate_fmu

archive, inputs = sys.argv[1:]
assert validate_fmu(archive) == []
for fmi_type in ("CoSimulation", "ModelExchange"):
    result = fmpy.simulate_fmu(archive, stop_time=2, output_interval=0.1, fmi_type=fmi_type)
    assert len(result) == 21, len(result)
    for row in result:
        for name in result.dtype.names[1:]:
            expected = {"String_output": ["Set me!", b"Set me!"], "Binary_output": [b"foo", "666f6f"], "Enumeration_output": [1]}
            assert row[name] in expected.get(name, [0]), (fmi_type, name, row[name])

# One step later. FMPy holds discrete inputs as doubles: what is above 2^53 it rounds, or loses.
result = fmpy.simulate_fmu(archive, stop_time=2, output_interval=0.1, input=read_csv(inputs), fmi_type="CoSimulation")
for name, low, high in [("Int8", -128, 127), ("UInt8", 0, 255), ("Int16", -(2**15), 2**15 - 1), ("UInt16", 0, 2**16 - 1),
                        ("Int32", -(2**31), 2**31 - 1), ("UInt32", 0, 2**32 - 1)]:
    column = [int(x) for x in result[f"{name}_output"]]
    assert column[:11] == 11 * [low] and column[11:] == 10 * [high], (name, column)
