"""PathSim (pathsim-fmi on FMPy) runs the whole drive from the archives of both standards and the pair of FMI 2.0: of FMI 3.0 it
sets every integer as an Int64, and `timing.delay` is an Int32.

It passes every port as a real, and Boolean ports stop it: `Reals` leaves them out. It steps one FMU after the other, in the
order of its blocks, and hands on at once: `timing.delay` is 0. A block shows at t what it has at the end of the step from t.
"""

import pathsim_fmi.blocks
import pytest
from pathsim import Connection, Simulation
from pathsim.blocks import Scope, Source
from pathsim_fmi import CoSimulationFMU
from reference import DRIVE_STEP, LINKS, NAMES, RECORDED, T_S

U_DC = 325.0  # V: PathSim sets inputs that nothing feeds to 0
STANDARDS = ["fmi2", "fmi3"]
ORDERS = {"plant first": ["plant", "controller"], "controller first": ["controller", "plant"]}


class Reals(pathsim_fmi.blocks.FMUWrapper):
    """Ports are the real variables only; the others keep their start values."""

    def _build_variable_maps(self):
        super()._build_variable_maps()
        for ports in (self.input_refs, self.output_refs):
            for name in [n for n in ports if self.variable_map[n].type not in ("Real", "Float64")]:
                del ports[name]


@pytest.fixture
def reals(monkeypatch):
    """Blocks without Boolean ports."""
    monkeypatch.setattr(pathsim_fmi.blocks, "FMUWrapper", Reals)


def run(blocks, connections, recorded, step, n):
    """The recorded ports at the communication points 0 to n - 1; at the start as initialized."""
    scope = Scope()
    rows = [[float(block.outputs[name]) for block, name in recorded]]
    links = [Connection(block[name], scope[k]) for k, (block, name) in enumerate(recorded)]
    Simulation([*blocks, scope], [*connections, *links], dt=step, log=False).run((n - 1) * step)
    time, values = scope.read()
    assert len(time) >= n - 1
    return rows + [list(row) for row in values.T[: n - 1]]


@pytest.mark.parametrize("standard", STANDARDS)
def test_drive(archives, experiment, standard, reals):
    start = {"plant.initial.theta_e": experiment.theta_e}
    drive = CoSimulationFMU(archives / standard / "PmsmDrive.fmu", start_values=start, dt=DRIVE_STEP)
    speed_ref, load = (Source(lambda t, k=k: experiment.inputs(t)[k]) for k in (0, 1))
    u_dc = Source(lambda t: U_DC)
    sources = [(speed_ref, "speed_ref"), (load, "tau_load"), (u_dc, "u_dc")]
    connections = [Connection(source, drive[name]) for source, name in sources]
    blocks = [speed_ref, load, u_dc, drive]
    rows = run(blocks, connections, [(drive, "speed")], DRIVE_STEP, len(experiment.entry["drive"]))
    experiment.check_drive([row[0] for row in rows], 0.0)


@pytest.mark.parametrize("order", ORDERS)
def test_pair(archives, experiment, order, reals):
    start = {"plant": {"initial.theta_e": experiment.theta_e}, "controller": {"timing.delay": experiment.delay(order)}}
    pair = {
        name: CoSimulationFMU(archives / "fmi2" / f"{NAMES[name]}.fmu", instance_name=name, start_values=start[name], dt=T_S)
        for name in NAMES
    }
    speed_ref, load = (Source(lambda t, k=k: experiment.inputs(t)[k]) for k in (0, 1))
    u_dc = Source(lambda t: U_DC)
    connections = [Connection(pair[a][x], pair[b][y]) for a, x, b, y in LINKS]
    connections += [Connection(speed_ref, pair["controller"]["speed_ref"]), Connection(load, pair["plant"]["tau_load"])]
    connections += [Connection(u_dc, *(block["u_dc"] for block in pair.values()))]
    blocks = [speed_ref, load, u_dc, *(pair[name] for name in ORDERS[order])]
    rows = run(blocks, connections, [(pair[a], x) for a, x in RECORDED], T_S, experiment.steps)
    experiment.check(rows[:: experiment.every], order)


@pytest.mark.parametrize("standard", STANDARDS)
def test_boolean_ports_stop_it(archives, standard):
    """When this fails `Reals` has become needless."""
    with pytest.raises(Exception, match="failed with status 3"):
        CoSimulationFMU(archives / standard / "PmsmDrive.fmu", dt=DRIVE_STEP)
