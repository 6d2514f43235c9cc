"""libcosim runs the pair from the FMI 2.0 archives. (libcosimpy 0.0.6 crashes while it reads any FMI 3.0 archive.)

Its fixed-step algorithm is Jacobi. It counts time in whole nanoseconds, so that its steps differ from 1e-4 s in the last
bits, and the results with them.
"""

from shutil import copy

from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from reference import LINKS, NAMES, RECORDED, T_S

NAMESPACE = "http://opensimulationplatform.com/MSMI/OSPSystemStructure"


def structure(experiment):
    """The system structure, OSP's own format."""
    start = {"plant": ("initial.theta_e", f'<Real value="{experiment.theta_e!r}"/>')}
    start["controller"] = ("timing.delay", f'<Integer value="{experiment.delay("jacobi")}"/>')
    simulators = "".join(
        f'<Simulator name="{instance}" source="{NAMES[instance]}.fmu" stepSize="{T_S}"><InitialValues>'
        f'<InitialValue variable="{variable}">{value}</InitialValue></InitialValues></Simulator>'
        for instance, (variable, value) in start.items()
    )
    connections = "".join(
        f'<VariableConnection><Variable simulator="{a}" name="{x}"/><Variable simulator="{b}" name="{y}"/></VariableConnection>'
        for a, x, b, y in LINKS
    )
    return (
        f'<OspSystemStructure xmlns="{NAMESPACE}" version="0.1"><BaseStepSize>{T_S}</BaseStepSize><Algorithm>fixedStep'
        f"</Algorithm><Simulators>{simulators}</Simulators><Connections>{connections}</Connections></OspSystemStructure>"
    )


def test_pair(archives, experiment, tmp_path):
    references = {}
    for instance, name in NAMES.items():
        copy(archives / "fmi2" / f"{name}.fmu", tmp_path)
        variables = read_model_description(tmp_path / f"{name}.fmu").modelVariables
        references[instance] = {v.name: v.valueReference for v in variables}
    (tmp_path / "OspSystemStructure.xml").write_text(structure(experiment))
    execution = CosimExecution.from_osp_config_file(str(tmp_path / "OspSystemStructure.xml"))
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(manipulator)
    execution.add_observer(observer)
    index = {instance: execution.slave_index_from_instance_name(instance) for instance in NAMES}
    rows = []
    for k in range(experiment.steps):
        if k % experiment.every == 0:
            get = observer.last_real_values
            rows.append([get(index[instance], [references[instance][name]])[0] for instance, name in RECORDED])
        for instance, variable, value in experiment.changes(k):
            manipulator.slave_real_values(index[instance], [references[instance][variable]], [value])
        assert execution.step(1)
    experiment.check(rows, "jacobi", rounding=1e-8)
