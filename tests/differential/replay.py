"""Repeats runs of our importer in FMPy, and compares every value to the last bit. The argument is a file with the runs."""

import json
import struct
import sys
from shutil import rmtree

from fmpy import extract, instantiate_fmu, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave


def bits(x):
    """The bits of a number in double precision, as a text."""
    return str(struct.unpack("<Q", struct.pack("<d", x))[0])


def number(text):
    """The number with these bits."""
    return struct.unpack("<d", struct.pack("<Q", int(text)))[0]


def functions(fmu, base, two):
    """Getter and setter of a type."""
    kind = base
    if two:
        kind = {"Float64": "Real", "Int32": "Integer", "Enumeration": "Integer"}.get(base, base)
    elif base == "Enumeration":
        kind = "Int64"
    return getattr(fmu, f"get{kind}"), getattr(fmu, f"set{kind}")


def assign(fmu, entries, two):
    for base, reference, values, _ in entries:
        _, setter = functions(fmu, base, two)
        if base.startswith("Float"):
            values = [number(x) for x in values]
        elif base not in ("Boolean", "String"):
            values = [int(x) for x in values]
        setter([reference], values)


def compare(fmu, entries, two, place):
    for base, reference, values, name in entries:
        getter, _ = functions(fmu, base, two)
        found = getter([reference]) if two else getter([reference], len(values))
        if base.startswith("Float"):
            found = [bits(x) for x in found]
        elif base == "Boolean":
            found = [bool(x) for x in found]
        elif base == "String":
            found = [x.decode() if isinstance(x, bytes) else x for x in found]
        else:
            found = [str(x) for x in found]
        assert found == values, f"{place}: {name} is {found} in FMPy and {values} here"
    return sum(len(entry[2]) for entry in entries)


def run(job):
    """The number of values compared."""
    archive, compared = job["fmu"], 0
    description = read_model_description(archive)
    two = description.fmiVersion == "2.0"
    folder = extract(archive)
    if "clocked" in job:
        clocked = job["clocked"]
        fmu = instantiate_fmu(folder, description, "ScheduledExecution")
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        clock = next(v.valueReference for v in description.modelVariables if v.type == "Clock")
        for k, expected in enumerate(clocked["ticks"]):
            fmu.activateModelPartition(clock, clocked["shift"] + k * clocked["interval"])
            compared += compare(fmu, expected, False, f"{archive}, tick {k}")
    else:
        fmu = (FMU2Slave if two else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="it",
        )
        fmu.instantiate()
        if job["sizes"]:
            fmu.enterConfigurationMode()
            assign(fmu, job["sizes"], two)
            fmu.exitConfigurationMode()
        assign(fmu, job["parameters"], two)
        if two:
            fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        for k, step in enumerate(job["steps"]):
            assign(fmu, step["set"], two)
            fmu.doStep(currentCommunicationPoint=k * job["step"], communicationStepSize=job["step"])
            compared += compare(fmu, step["expected"], two, f"{archive}, step {k}")
    fmu.terminate()
    fmu.freeInstance()
    rmtree(folder)
    return compared


with open(sys.argv[1], encoding="utf-8") as file:
    print(sum(run(job) for job in json.load(file)))
