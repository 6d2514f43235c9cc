"""Every generated package in two Modelica compilers, with a stub for the imported block: all classes, and the examples run."""

import math
import os
import pathlib
import re

import pytest
import rumoca
import stub

HERE = pathlib.Path(__file__).parent
# The folder of Modelica Standard Library 4, or the few classes of it that the packages use.
LIBRARY = pathlib.Path(os.environ.get("MODELICA_LIBRARY", HERE / "library"))
PACKAGES = sorted(pathlib.Path(os.environ["MODELICA_PACKAGES"]).iterdir())
SPEED, LOAD = 104.72, 1.0
# In steady state the stub's torque is that of the load.
SPEED_UNDER_LOAD = SPEED - LOAD / stub.GAIN
POWER = LOAD * SPEED_UNDER_LOAD
# The battery's voltage less that of its cable.
LINK = 162.5 + math.sqrt(162.5**2 - 0.1 * POWER)

# Example: variables, and what they are at its end.
EXAMPLES = {
    "TwoInertias": {"load.w": SPEED_UNDER_LOAD, "drive.rotor.w": SPEED_UNDER_LOAD, "coupling.flange_a.tau": LOAD},
    "TwoInertiasCompliant": {"load.w": SPEED_UNDER_LOAD, "drive.tau": LOAD, "drive.speed": SPEED_UNDER_LOAD},
    "SupplyAndCooling": {"load.w": SPEED_UNDER_LOAD, "link.v": LINK, "coolant.port.Q_flow": LOAD**2},
}


class Package:
    """A generated package, and a folder with the stub of its block."""

    def __init__(self, folder, scratch):
        self.folder = next(path.parent for path in folder.glob("*/package.mo"))
        self.name, self.scratch = self.folder.name, scratch
        name = re.search(r"model Block = (\S+)", (self.folder / "Block.mo").read_text())[1]
        self.block = stub.block(next(folder.glob("*.fmu")), name, SPEED)
        (scratch / f"{name.split('.')[0]}.mo").write_text(self.block)

    def load(self, file, model):
        return rumoca.Session(roots=[str(LIBRARY), str(self.folder), str(self.scratch)]).load(str(file), model=model)

    def user(self, drive, more=""):
        """A model of a user, with a drive."""
        file = self.scratch / "User.mo"
        file.write_text(f"model User\n  extends Modelica.Icons.Example;\n  {self.name}.{drive};\n  {more}\nend User;\n")
        return self.load(file, "User")

    def merged(self):
        """The package as one class, without arrays, which `modelica` does not index in a modification."""
        order = (self.folder / "package.order").read_text().split()
        body = "".join((self.folder / f"{name}.mo").read_text().split(";", 1)[1] for name in order)
        body = re.sub(r"\n *(parameter )?Real\[\d+\][\s\S]*?\)\);", "", body)
        body = re.sub(r"\n *(final \w*_w_\d+_|\w*flux_map_w)=[^\n]*", "", body)
        head = (self.folder / "package.mo").read_text()
        place = head.index("  annotation(\n")
        return head[:place] + body + head[place:]


@pytest.fixture(params=PACKAGES, ids=lambda folder: folder.name)
def package(request, tmp_path):
    return Package(request.param, tmp_path)


@pytest.fixture
def plant(tmp_path):
    return Package(next(folder for folder in PACKAGES if folder.name == "PmsmPlant"), tmp_path)


@pytest.mark.parametrize("example", EXAMPLES)
def test_rumoca_runs_the_examples(package, example):
    if package.name == "PmsmDriveMeanLib" and example != "TwoInertias":
        pytest.skip("it differs from PmsmDriveLib in names alone")
    model = package.load(package.folder / "Examples.mo", f"{package.name}.Examples.{example}")
    result = model.simulate(t=(0, 1))
    for name, expected in EXAMPLES[example].items():
        assert float(result[name][-1]) == pytest.approx(expected, rel=1e-3), name


def test_modelica_runs_the_examples(package):
    modelica = pytest.importorskip("modelica.sim", reason="modelica needs Python 3.12 or later")
    from modelica.lang import parse

    for file in package.folder.glob("*.mo"):
        parse(file.read_text())
    block = re.sub(r"\n  parameter Real \w+\[\d+\][^\n]*", "", package.block)
    sources = [(HERE / "library" / "Modelica.mo").read_text(), block, package.merged()]
    sources = [parse(source) for source in sources]
    for example, expected in EXAMPLES.items():
        flat = modelica.flatten(sources, f"{package.name}.Examples.{example}")
        result = modelica.simulate(modelica.causalize(flat), stop=1.0)
        assert result["load.w"][-1] == pytest.approx(expected["load.w"], rel=1e-3)


def test_a_drive_with_nothing_connected_is_whole(plant):
    plant.user("ImposedShaft drive(machine=" + plant.name + ".Machines.ipmsm_2_2kw())").simulate(t=(0, 0.01))
    load = "Modelica.Mechanics.Rotational.Components.Inertia load(J=1e-3); equation connect(drive.flange, load.flange_a);"
    plant.user("CompliantShaft drive", load).simulate(t=(0, 0.01))


def test_a_connector_that_is_not_connected_is_an_equation_too_few(plant):
    """So the compiler would find one in the package, too."""
    with pytest.raises(rumoca.CompileError, match="balance = -1"):
        plant.user("ImposedShaft drive(use_enable=true)")


def test_an_enumeration_that_the_import_does_not_send_is_refused(plant):
    changed = plant.user(f"ImposedShaft drive(thermal_mode={plant.name}.Types.ThermalMode.Imposed)")
    with pytest.raises(rumoca.SimulationError, match="thermal.mode of the FMU is .*fmu preset"):
        changed.simulate(t=(0, 0.01))


def test_a_shaft_that_would_gain_energy_is_refused(plant):
    load = "Modelica.Mechanics.Rotational.Components.Inertia load(J=1e-3); equation connect(drive.flange, load.flange_a);"
    with pytest.raises(rumoca.SimulationError, match="the shaft would gain energy"):
        plant.user("CompliantShaft drive(c=5000, d=0.1)", load).simulate(t=(0, 0.01))
