"""Model descriptions as objects with FMPy's attributes."""

from dataclasses import dataclass, field


@dataclass(eq=False)
class DefaultExperiment:
    """Times (s) as in the file; None if missing."""

    startTime: str | None = None
    stopTime: str | None = None
    tolerance: str | None = None
    stepSize: str | None = None


@dataclass(eq=False)
class InterfaceType:
    """An interface that the FMU has."""

    modelIdentifier: str
    needsExecutionTool: bool = False
    canBeInstantiatedOnlyOncePerProcess: bool = False
    canGetAndSetFMUstate: bool = False
    canSerializeFMUstate: bool = False


@dataclass(eq=False)
class ModelExchange(InterfaceType):
    """The Model Exchange interface and its capabilities."""

    providesDirectionalDerivatives: bool = False
    providesAdjointDerivatives: bool = False

    @property
    def providesDirectionalDerivative(self):
        """The capability by its name of FMI 2.0."""
        return self.providesDirectionalDerivatives


class ScheduledExecution(InterfaceType):
    """Scheduled execution; this package does not run it."""


@dataclass(eq=False)
class CoSimulation(InterfaceType):
    """The co-simulation interface and its capabilities."""

    canHandleVariableCommunicationStepSize: bool = False
    fixedInternalStepSize: float | None = None
    canInterpolateInputs: bool = False
    hasEventMode: bool = False
    mightReturnEarlyFromDoStep: bool = False


@dataclass(eq=False)
class Item:
    """One value of an enumeration."""

    name: str
    value: str
    description: str | None = None


@dataclass(eq=False)
class DisplayUnit:
    """A display unit: shown = factor * value + offset."""

    name: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(eq=False)
class BaseUnit:
    """Exponents of the SI base units, factor and offset to them."""

    kg: int = 0
    m: int = 0
    s: int = 0
    A: int = 0
    K: int = 0
    mol: int = 0
    cd: int = 0
    rad: int = 0
    factor: float = 1.0
    offset: float = 0.0


@dataclass(eq=False)
class Unit:
    """A unit with its display units."""

    name: str
    baseUnit: BaseUnit | None = None
    displayUnits: list = field(default_factory=list)


@dataclass(eq=False)
class SimpleType:
    """A type definition."""

    name: str
    type: str
    description: str | None = None
    quantity: str | None = None
    unit: str | None = None
    displayUnit: str | None = None
    min: str | None = None
    max: str | None = None
    nominal: str | None = None
    items: list = field(default_factory=list)
    relativeQuantity: bool = False


@dataclass(eq=False)
class ModelVariable:
    """A variable. Properties that the file leaves to the type definition or to the standard are filled in."""

    name: str
    valueReference: int
    type: str
    description: str | None = field(default=None, repr=False)
    causality: str | None = field(default=None, repr=False)
    variability: str | None = field(default=None, repr=False)
    initial: str | None = field(default=None, repr=False)
    declaredType: SimpleType | None = field(default=None, repr=False)
    quantity: str | None = field(default=None, repr=False)
    unit: str | None = field(default=None, repr=False)
    displayUnit: str | None = field(default=None, repr=False)
    min: str | None = field(default=None, repr=False)
    max: str | None = field(default=None, repr=False)
    nominal: str | None = field(default=None, repr=False)
    start: str | None = field(default=None, repr=False)
    shape: tuple = field(default=(), repr=False)
    derivative: "ModelVariable | None" = field(default=None, repr=False)
    sourceline: int | None = field(default=None, repr=False)
    alias: "ModelVariable | None" = field(default=None, repr=False)
    relativeQuantity: bool | None = field(default=None, repr=False)


ScalarVariable = ModelVariable


@dataclass(eq=False)
class Unknown:
    """An entry of the model structure."""

    variable: ModelVariable | None
    dependencies: list | None = None
    dependenciesKind: list | None = None
    sourceline: int = 0


@dataclass(eq=False)
class ModelDescription:
    """The contents of modelDescription.xml."""

    fmiVersion: str
    modelName: str
    instantiationToken: str
    description: str | None = field(default=None, repr=False)
    author: str | None = field(default=None, repr=False)
    version: str | None = field(default=None, repr=False)
    copyright: str | None = field(default=None, repr=False)
    license: str | None = field(default=None, repr=False)
    generationTool: str | None = field(default=None, repr=False)
    generationDateAndTime: str | None = field(default=None, repr=False)
    variableNamingConvention: str = field(default="flat", repr=False)
    defaultExperiment: DefaultExperiment | None = None
    coSimulation: CoSimulation | None = None
    modelExchange: ModelExchange | None = None
    scheduledExecution: ScheduledExecution | None = None
    unitDefinitions: list = field(default_factory=list, repr=False)
    typeDefinitions: list = field(default_factory=list, repr=False)
    modelVariables: list = field(default_factory=list, repr=False)
    outputs: list = field(default_factory=list, repr=False)
    derivatives: list = field(default_factory=list, repr=False)
    initialUnknowns: list = field(default_factory=list, repr=False)

    @property
    def guid(self):
        """The instantiation token, by its name of FMI 2.0."""
        return self.instantiationToken

    @property
    def fmiMajorVersion(self):
        """2 or 3."""
        return int(self.fmiVersion.split(".")[0])


def _co_simulation(identifier, attributes):
    """Capabilities of FMI 3.0 under FMPy's names."""
    # FMI 3.0 writes State where FMI 2.0 writes state.
    attributes = {name.replace("FMUState", "FMUstate"): text.strip() for name, text in attributes}
    step = attributes.pop("fixedInternalStepSize", None)
    known = CoSimulation.__dataclass_fields__
    flags = {name: text in ("true", "1") for name, text in attributes.items() if name in known}
    return CoSimulation(identifier, fixedInternalStepSize=None if step is None else float(step), **flags)


def _model_exchange(identifier, attributes):
    """Capabilities of FMI 2.0 and FMI 3.0 under FMPy's names."""
    attributes = {name.replace("FMUState", "FMUstate"): text.strip() in ("true", "1") for name, text in attributes}
    attributes["providesDirectionalDerivatives"] = (
        attributes.get("providesDirectionalDerivatives") or attributes.get("providesDirectionalDerivative") or False
    )
    known = ModelExchange.__dataclass_fields__
    return ModelExchange(identifier, **{name: value for name, value in attributes.items() if name in known and name != "modelIdentifier"})


def _build(d):
    """Objects from the dictionary of `Fmu.describe`."""
    types = {t["name"]: SimpleType(**t | {"items": [Item(*i) for i in t["items"]]}) for t in d["types"]}
    variables, names = [], {}
    for v in d["variables"]:
        aliases = v.pop("aliases")
        v |= {"declaredType": types.get(v["declaredType"]), "shape": tuple(v["shape"])}
        variable = ModelVariable(**v)
        variables.append(variable)
        names[variable.name] = variable
        for name, description, unit in aliases:
            more = {"name": name, "alias": variable}
            more |= {"description": description} if description else {}
            more |= {"displayUnit": unit} if unit else {}
            names[name] = ModelVariable(**v | more)
    for variable in names.values():
        variable.derivative = names.get(variable.derivative)
    variables += [v for v in names.values() if v.alias]

    def unknowns(entries):
        resolve = lambda list_: None if list_ is None else [names.get(n) for n in list_]
        return [Unknown(names.get(name), resolve(deps), kinds, line) for name, deps, kinds, line in entries]

    units = [
        Unit(name, base and BaseUnit(*base[0], *base[1:]), [DisplayUnit(*shown) for shown in all_shown])
        for name, base, all_shown in d["units"]
    ]
    plain = ("fmiVersion", "modelName", "instantiationToken", "description", "author", "version", "copyright", "license")
    return ModelDescription(
        **{name: d[name] for name in (*plain, "generationTool", "generationDateAndTime")},
        variableNamingConvention="structured" if d["structured"] else "flat",
        defaultExperiment=DefaultExperiment(**d["defaultExperiment"]),
        coSimulation=d["coSimulation"] and _co_simulation(*d["coSimulation"]),
        modelExchange=d["modelExchange"] and _model_exchange(*d["modelExchange"]),
        scheduledExecution=d["scheduledExecution"] and ScheduledExecution(d["scheduledExecution"]),
        unitDefinitions=units,
        typeDefinitions=list(types.values()),
        modelVariables=variables,
        **{name: unknowns(d[name]) for name in ("outputs", "derivatives", "initialUnknowns")},
    )
