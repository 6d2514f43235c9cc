"""A vehicle on a driving cycle: the same vehicle with PmsmDrive, PmsmDriveMean and a drive given by tables.

    pip install ./python matplotlib
    cargo run --release -- map motors/traction-100kw.toml --out target/map
    python examples/drive-train/vehicle.py PmsmDriveMean
    python examples/drive-train/vehicle.py PmsmDrive PmsmDriveMean target/map/map.csv --plot vehicle.svg    # --stop 60 ends earlier

A drive is a name of `fmurun.drives`, with the tuned values of the machine, or the map of `fmu map`, or the data sheet
(TOML) of a drive: these run as MappedDrive. Vehicle and cycle are those of examples/vehicle.
"""

import argparse
import tempfile
import tomllib
from pathlib import Path

import fmurun
from fmurun import drives

HERE = Path(__file__).parent
MACHINE = "traction-100kw"
CAR = tomllib.loads((HERE.parent / "vehicle/vehicle.toml").read_text())


def values(drive):
    """The FMU of a drive, and its start values."""
    tuned = drives.tune(MACHINE)
    if drive.endswith(".toml"):
        return drives.MappedDrive, drives.from_datasheet(drive)
    if not drive.endswith(".csv"):
        return getattr(drives, drive), tuned
    sheet = f"""name = "{MACHINE}"
source = "fmu map"
losses.file = '{Path(drive).resolve()}'
mechanics.J = {tuned["plant.mechanics.J"]}
dc_link.u_dc = {tuned["u_dc"]}
bandwidth.torque = {tuned["controller.current.bandwidth"]}
"""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sheet.toml"
        path.write_text(sheet)
        return drives.MappedDrive, drives.from_datasheet(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drives", nargs="+")
    parser.add_argument("--stop", type=float)
    parser.add_argument("--plot")
    arguments = parser.parse_args()
    car = fmurun.vehicle(mass=CAR["mass"], cda=CAR["drag_area"], c_rr=CAR["rolling_resistance"], radius=CAR["wheel_radius"],
                         gear=CAR["gear_ratio"], rho=CAR["air_density"])  # fmt: skip
    trips = []
    for drive in arguments.drives:
        fmu, start = values(drive)
        trips.append(car.run(fmu, HERE.parent / "vehicle/cycle.csv", start_values=start, stop_time=arguments.stop))
        print(trips[-1], "\n")
    first, *others = trips
    for trip in others:
        print(f"{trip.name} differs from {first.name} by {100 * (trip.wh_per_km / first.wh_per_km - 1):+.3f} %")
    if arguments.plot:
        import matplotlib.pyplot as plt

        plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "drive-train", "path.simplify_threshold": 0.5})
        first.plot(*others).savefig(arguments.plot, metadata={"Date": None})


if __name__ == "__main__":
    main()
