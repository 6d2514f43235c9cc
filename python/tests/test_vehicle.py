"""`fmurun.vehicle`: three drives on a cycle, the balance, brakes and slopes, refused cycles, the figure."""

import os
import subprocess
from pathlib import Path

import fmurun
import numpy as np
import pytest
from fmurun import FmuError, drives

EXAMPLES = Path(__file__).parents[2] / "examples"
CYCLE = EXAMPLES / "vehicle/cycle.csv"
CAR = {"mass": 1300.0, "cda": 0.6, "c_rr": 0.010, "radius": 0.30, "gear": 9.0}
# Accelerate, hold, brake to standstill.
SHORT = [(0, 0), (1, 0), (9, 40), (14, 40), (22, 0), (23, 0)]
# A kick scooter with a hub motor.
SCOOTER = {"mass": 100.0, "cda": 0.6, "c_rr": 0.012, "radius": 0.1, "gear": 1.0}
SCOOTER_SHORT = [(0, 0), (1, 0), (11, 9), (25, 9), (33, 0), (34, 0)]


def mapped(machine, J, u_dc, folder):
    """The values of MappedDrive from the map of a machine."""
    command = [os.environ["FMU_COMMAND"], "map", drives.machines[machine], "--verify", "0", "--out", folder]
    subprocess.run(command, check=True, capture_output=True)
    sheet = folder / "sheet.toml"
    sheet.write_text(f'''name = "{machine}"\nsource = "fmu map"\n[losses]\nfile = "map.csv"\n[mechanics]\nJ = {J}
[dc_link]\nu_dc = {u_dc}\n[bandwidth]\ntorque = 1000\n''')
    return drives.from_datasheet(sheet)


@pytest.mark.parametrize(("machine", "car", "cycle"), [("traction-100kw", CAR, SHORT), ("hub-36v", SCOOTER, SCOOTER_SHORT)])
def test_three_drives_use_the_same_energy(machine, car, cycle, tmp_path):
    values = drives.tune(machine)
    table = mapped(machine, values["plant.mechanics.J"], values["u_dc"], tmp_path)
    car = fmurun.vehicle(**car)
    trips = [car.run(drives.PmsmDrive, cycle, start_values=values), car.run(drives.PmsmDriveMean, cycle, start_values=values),
             car.run(drives.MappedDrive, cycle, start_values=table)]  # fmt: skip
    for trip in trips:
        print(trip, "\n")
        assert abs(trip.balance) < 1e-3
        assert trip.error < 0.5
        assert trip.wh_per_km == pytest.approx(trips[0].wh_per_km, rel=5e-3)
        assert sum(trip.losses[cause] for cause in trip.losses if cause not in ("air", "rolling", "slope", "gear", "brakes")) == (
            pytest.approx(trip.energy["losses"]))  # fmt: skip
    assert {"copper", "iron", "friction"} <= set(trips[1].losses)
    assert "drive" in trips[2].losses
    assert trips[1].temperatures["T_winding"] == pytest.approx(20.0)


def test_slope_gear_and_brakes():
    values = drives.tune("traction-100kw")
    car = fmurun.vehicle(**CAR)
    level = car.run(drives.PmsmDriveMean, SHORT, start_values=values)
    # 5 % more height: m g h of potential energy.
    hill = car.run(drives.PmsmDriveMean, SHORT, start_values=values, slope=5.0)
    height = hill.distance * 0.05 / np.hypot(1.0, 0.05)
    assert hill.losses["slope"] == pytest.approx(CAR["mass"] * 9.81 * height, rel=1e-3)
    assert level.energy["link"] < hill.energy["link"]
    by_time = car.run(drives.PmsmDriveMean, [(t, v, 5.0) for t, v in SHORT], start_values=values)
    by_distance = car.run(drives.PmsmDriveMean, SHORT, start_values=values, slope=[(0.0, 5.0), (1e4, 5.0)])
    assert by_time.energy == by_distance.energy == hill.energy
    geared = fmurun.vehicle(**CAR, gear_efficiency=0.95).run(drives.PmsmDriveMean, SHORT, start_values=values)
    assert geared.losses["gear"] > 0.04 * geared.energy["shaft"]
    # A drive whose torque is small leaves the braking to the brakes.
    weak = values | {"controller.limit.i": 40.0, "controller.limit.i_q": 40.0}
    slow = [(0, 0), (30, 30), (33, 0), (35, 0)]
    braked = car.run(drives.PmsmDriveMean, slow, start_values=weak)
    assert braked.losses["brakes"] > 10e3
    assert all(abs(trip.balance) < 2e-3 for trip in (level, hill, geared, braked))
    assert all(trip.result["v"][-1] < 0.1 for trip in (level, hill, geared, braked))


def test_the_figure(tmp_path):
    pytest.importorskip("matplotlib").use("Agg")
    car, values = fmurun.vehicle(**CAR), drives.tune("traction-100kw")
    trips = [car.run(fmu, SHORT, start_values=values) for fmu in (drives.PmsmDriveMean, drives.PmsmDrive)]
    figure = trips[0].plot(trips[1])
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert labels == ["speed [km/h]", "torque [N.m]", "link power [kW]", "losses [kW]"]
    assert all(len(axis.lines) == 2 for axis in figure.axes)
    figure.savefig(tmp_path / "vehicle.svg")
    network = {"plant.thermal.mode": "Network", "plant.thermal.C_winding": 50.0, "plant.thermal.C_stator": 500.0, "plant.thermal.C_rotor": 500.0,
               "plant.thermal.C_inverter": 50.0, "plant.thermal.G_ws": 20.0, "plant.thermal.G_sc": 20.0, "plant.thermal.G_sr": 5.0,
               "plant.thermal.G_inverter": 20.0}  # fmt: skip
    warm = car.run(drives.PmsmDriveMean, SHORT, start_values=values | network)
    assert warm.temperatures["T_winding"] > 21.0
    assert "T_winding" in str(warm)
    assert warm.plot().axes[-1].get_ylabel() == "temperature [°C]"
    assert "Wh/km" in str(warm)
    assert "copper" in str(warm)


def test_what_is_wrong_is_named(tmp_path):
    car, values = fmurun.vehicle(**CAR), drives.tune("traction-100kw")
    run = lambda cycle, **more: car.run(drives.PmsmDriveMean, cycle, start_values=values, **more)  # noqa: E731
    file = tmp_path / "cycle.csv"

    def written(text):
        file.write_text(text)
        return file

    for wrong, message in [
        (lambda: fmurun.vehicle(0.0, 0.6, 0.01, 0.3, 9.0), "mass = 0.0 must be greater than 0"),
        (lambda: fmurun.vehicle(1.0, -0.6, 0.01, 0.3, 9.0), "cda = -0.6 must be at least 0"),
        (lambda: fmurun.vehicle(1300.0, 0.6, 0.01, 0.3, 9.0, gear_efficiency=97), "write 97 % as 0.97"),
        (lambda: fmurun.vehicle(1.3, 0.6, 0.01, 0.3, 9.0), "mass = 1.3 must be at least 10 kg .*: write 1.3 t as 1300"),
        (lambda: fmurun.vehicle(1300.0, 0.6, 1.0, 0.3, 9.0), "c_rr = 1.0 must be at most 0.5: write 1 % as 0.01"),
        (lambda: fmurun.vehicle(1300.0, 0.6, 0.01, 300.0, 9.0), "radius = 300.0 must be at most 3.0: write 300 mm as 0.3"),
        (lambda: run(written("time,speed [kn]\n0,0\n9,9\n")), "cycle.csv:1: the unit kn of a speed must be km/h, m/s or mph"),
        (lambda: run(written("time,speed\n0,0\n900,900\n")), "vehicles are slower than 900 km/h"),
        (lambda: run(written("time,speed\n0,0\n1,x\n")), "cycle.csv:3: 1,x must be time"),
        (lambda: run(written("0,0\n1,2\n1,3\n")), "the time 1 s of row 3 does not increase"),
        (lambda: run(written("0,0\n1\n")), "cycle.csv:2: has 1 values"),
        (lambda: run([(0, 0)]), "needs at least two rows"),
        (lambda: run([(0, 0, 1), (1, 2, 1)], slope=3.0), "the cycle has a third column"),
        (lambda: run(SHORT, slope=[1, 2, 3]), "slope = .* must be a number in %"),
        (lambda: run(SHORT, step_size=0.0), "step_size = 0.0 must be greater than 0 s"),
        (lambda: car.run(drives.PmsmPlant, SHORT), "PmsmPlant has no tau_ref, .*: a vehicle needs PmsmDrive, "),
        (lambda: car.run(drives.PmsmDrive, SHORT, start_values={"plant.motor.R": 1}), "did you mean plant.motor.R_s"),
    ]:
        with pytest.raises(ValueError, match=message):
            wrong()
    with pytest.warns(UserWarning, match="vehicles accelerate less than 83.3333 m/s2"):
        run(written("0,0\n0.1,30\n"))
    files = [f"time,speed{unit}\n0,0\n4,{speed}\n" for unit, speed in (("", 36), (" [km/h]", 36), (" [m/s]", 10))]
    slow = [run(written(text)).distance for text in files]
    assert slow[0] == slow[1] == pytest.approx(slow[2])
    with pytest.raises(FmuError, match="not allowed"):
        car.run(drives.PmsmDriveMean, SHORT, start_values=values | {"plant.motor.R_s": -1.0})


def test_doctests(run_doctests):
    assert run_doctests("fmurun._vehicle") > 0
