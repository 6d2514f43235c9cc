"""SensorlessControllerClocked in FMPy: a scheduler written by hand gives the bits of the controller in Co-Simulation."""

from shutil import rmtree

from fmpy import extract, instantiate_fmu, read_model_description
from pair import Unit

T_S = 1e-4
OUTPUTS = ("u_a", "u_b", "u_c", "speed_est")


def currents(k):
    """A rotating current that the controller measures at sample k."""
    return [2.0 * ((k % 20) / 10.0 - 1.0), 1.0 - (k % 7) / 3.5, 0.5 - (k % 11) / 11.0]


def test_a_scheduler_in_fmpy_has_the_bits_of_cosimulation(archives):
    controller = Unit(archives / "fmi3" / "SensorlessController.fmu")
    expected = []
    for k in range(200):
        controller.set_reals(controller.of("i_a", "i_b", "i_c", "speed_ref"), [*currents(k), 50.0])
        controller.slave.doStep(k * T_S, T_S)
        expected.append(controller.get_reals(controller.of(*OUTPUTS)))
    controller.close()

    archive = archives / "fmi3" / "SensorlessControllerClocked.fmu"
    description = read_model_description(archive)
    references = {v.name: v.valueReference for v in description.modelVariables}
    folder = extract(archive)
    fmu = instantiate_fmu(folder, description, "ScheduledExecution")
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    found = []
    for k in range(201):
        inputs = [references[name] for name in ("i_a", "i_b", "i_c", "speed_ref")]
        fmu.setFloat64(inputs, [*currents(k), 50.0])
        fmu.activateModelPartition(references["sample"], k * T_S)
        # The command of the last sample acts from this tick on.
        found.append(fmu.getFloat64([references[name] for name in OUTPUTS]))
    fmu.terminate()
    fmu.freeInstance()
    rmtree(folder)
    assert found[1:] == expected
    assert any(values[0] != 0.0 for values in expected)
