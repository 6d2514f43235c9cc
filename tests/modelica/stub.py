"""A block with the variables of the one that an import makes of an FMU, and a drive of four equations in it."""

import re
import xml.etree.ElementTree as ElementTree
import zipfile

GAIN = 0.1  # N.m.s/rad
REAL, INTEGER = ("Real", "Float64"), ("Integer", "Int32")

# The torque follows the speed with a lag; the rotor turns in the block unless the shaft is imposed.
EQUATIONS = """
  der(stub_tau) = ({gain}*(speed_ref - stub_w) - stub_tau)/1e-3;
  der(stub_rotor) = (stub_tau - tau_load)/1e-3;
  der(stub_angle) = stub_rotor;
  stub_w = if {imposed} then speed_shaft else stub_rotor;
"""

OUTPUTS = {
    "speed": "stub_rotor",
    "angle": "stub_angle",
    "tau_shaft": "stub_tau",
    "i_dc": "stub_tau*stub_w/u_dc",
    "Q_coolant": "stub_tau^2",
}


def identifier(name):
    return re.sub(r"[^0-9A-Za-z]", "_", name)


def modelica_type(tag):
    return "Real" if tag in REAL else "Integer" if tag in INTEGER else tag if tag in ("Boolean", "Enumeration") else None


def block(fmu, name, speed_ref):
    """The text of the class `name`; `speed_ref` stands in for a reference where the FMU has none."""
    root = ElementTree.fromstring(zipfile.ZipFile(fmu).read("modelDescription.xml"))
    full, (*packages, name) = name, name.split(".")
    lines, equations, types = [f"model {name}"], [], {}
    for definition in root.find("TypeDefinitions"):
        items = definition if definition.tag == "EnumerationType" else definition.find("Enumeration")
        if items is not None:
            types[definition.get("name")] = [item.get("name") for item in items]
            lines.append(f"  type {definition.get('name')} = enumeration({', '.join(types[definition.get('name')])});")
    seen = set()
    for variable in root.find("ModelVariables"):
        mine, causality = identifier(variable.get("name")), variable.get("causality")
        # FMI 2.0 has the type as an element of the variable, FMI 3.0 as the variable itself.
        kind = next((child for child in variable if modelica_type(child.tag)), variable)
        of = modelica_type(kind.tag)
        if of is None:
            continue
        if causality == "parameter":
            start, size = kind.get("start"), ""
            if of == "Enumeration":
                of = kind.get("declaredType")
                start = f"{of}.{types[of][int(start) - 1]}"
            elif variable.find("Dimension") is not None:
                size, start = f"[{len(start.split())}]", "{" + ", ".join(start.split()) + "}"
            lines.append(f"  parameter {of} {mine}{size} = {start};")
        elif causality == "input":
            lines.append(f"  Modelica.Blocks.Interfaces.{of}Input {mine};")
        elif causality == "output":
            if of == "Enumeration":
                of = kind.get("declaredType")
                value = f"{full}.{of}.{types[of][0]}"
                lines.append(f"  output {of} {mine};")
            else:
                value = OUTPUTS.get(mine, "false" if of == "Boolean" else "0")
                lines.append(f"  Modelica.Blocks.Interfaces.{of}Output {mine};")
            equations.append(f"  {mine} = {value};")
        seen.add(mine)
    imposed = next(name for name in sorted(seen) if name.endswith("mechanics_imposed"))
    own = EQUATIONS.format(gain=GAIN, imposed=imposed)
    if "speed_ref" not in seen:
        own = own.replace("speed_ref", str(speed_ref))
    states = "".join(f"  Real {state}(start=0, fixed=true);\n" for state in ("stub_tau", "stub_rotor", "stub_angle"))
    text = "\n".join(lines) + "\n" + states + "  Real stub_w;\nequation" + own + "\n".join(equations) + f"\nend {name};\n"
    for package in reversed(packages):
        text = f"package {package}\n{text}end {package};\n"
    return text
