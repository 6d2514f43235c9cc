//! The two functions of MATLAB: the parameters as a struct, and the model around the FMU.

use super::outside::{Flange, Group, Kind, Outside, Port};
use super::text::{WIDTH, comment, literal, number, unit};
use std::fmt::Write as _;

/// A row of a cell array, broken after a comma if the line would be too long.
fn cells(words: &[String]) -> String {
    let mut out = String::from("    ");
    let mut column = 4;
    for (place, word) in words.iter().enumerate() {
        if place > 0 {
            let last = word.lines().next().unwrap_or_default().len();
            if column + last + 10 > WIDTH {
                out += ", ...\n        ";
                column = 8;
            } else {
                out += ", ";
                column += 2;
            }
        }
        out += word;
        column = if word.contains('\n') { WIDTH } else { column + word.len() };
    }
    out + "; ...\n"
}

/// The function that returns the start values as a struct.
pub(super) fn parameters(name: &str, fmu: &str, outside: &Outside) -> String {
    let mut out = format!("function p = {name}()\n");
    out += &comment(
        &format!("Parameters of {fmu} with its start values. Change them in a copy: p = {name}; p.NAME = VALUE;"),
        0,
    );
    out +=
        "% and write p into the mask of the block. Comments name the variable of the FMU, its unit and its meaning.\n";
    out += "p = struct();\n";
    for setting in &outside.settings {
        let first = &setting.fmi[0];
        let of = if setting.fmi.len() > 1 {
            format!("{first} and the next {}", setting.fmi.len() - 1)
        } else {
            first.clone()
        };
        let measured = setting.unit.as_deref().map(|unit| format!(" in {unit}")).unwrap_or_default();
        let fixed = if setting.kind == Kind::Number { "" } else { " (read when the model is built)" };
        out += &comment(&format!("{of}{measured}: {}{fixed}", setting.about), 0);
        let head = format!("p.{} = ", setting.field);
        let value = setting.value(4);
        let gap =
            if head.len() + value.lines().next().unwrap_or_default().len() + 4 > WIDTH { "...\n    " } else { "" };
        let _ = writeln!(out, "{head}{gap}{value};");
    }
    for (why, names) in &outside.left {
        out += &comment(&format!("Not in the struct, because {why}: {}", names.join(", ")), 0);
    }
    out + "end\n"
}

/// The names that the script uses.
pub(super) struct Names<'a> {
    pub(super) build: &'a str,
    pub(super) parameters: &'a str,
    pub(super) model: &'a str,
    /// Block and prefix of the buses.
    pub(super) stem: &'a str,
    /// File name of the FMU.
    pub(super) fmu: &'a str,
    pub(super) about: &'a str,
}

/// The function that builds the model.
pub(super) fn build(names: &Names<'_>, outside: &Outside) -> String {
    let Names { build, parameters, model, stem, fmu, about } = names;
    let mut out = format!("function {build}()\n");
    out += &comment(&format!("Builds the Simulink model {model} around {fmu}. {about}"), 0);
    out += "% Written by fmu simulink and checked as text against MathWorks' documentation; it has not been run in MATLAB.\n";
    if outside.flange.is_some() {
        out += "% Needs Simulink and Simscape, R2025a or later (simscape.addConnection).\n";
    } else {
        out += "% Needs Simulink.\n";
    }
    if outside.both {
        out += "% The FMU also has Model Exchange: if Simulink asks for the mode, choose Co-Simulation.\n";
    }
    let stop = number(outside.stop);
    let step = outside.step.map(number);
    let solver = match &step {
        Some(step) => format!("'SolverType', 'Fixed-step', 'Solver', 'FixedStepDiscrete', 'FixedStep', '{step}', ..."),
        None => "'SolverType', 'Variable-step', 'Solver', 'VariableStepAuto', ...".into(),
    };
    let _ = write!(
        out,
        "model = '{model}';
block = [model '/{stem}'];
fmu = [block '/FMU'];
if bdIsLoaded(model)
    error('fmu:simulink', 'The model %s is open: close_system(''%s'', 0) closes it without saving.', model, model);
end
addpath(fileparts(mfilename('fullpath')));
load_system('simulink_extras');
{libraries}new_system(model);
open_system(model);
set_param(model, {solver}
    'StopTime', '{stop}');

% The block: a masked subsystem with the FMU.
add_block('simulink/Ports & Subsystems/Subsystem', block, 'Position', [400 60 700 {bottom}]);
Simulink.SubSystem.deleteContents(block);
add_block('simulink_extras/FMU Import/FMU', fmu, 'Position', [400 40 700 {inner}]);
set_param(fmu, 'FMUName', '{fmu}');
set_param(fmu, 'FMUInputMapping', 'Flat', 'FMUOutputMapping', 'Flat', 'FMUParamMapping', 'Flat');
",
        libraries =
            if outside.flange.is_some() { "load_system('fl_lib');\nload_system('nesl_utility');\n" } else { "" },
        bottom = 100 + 30 * outside.inputs.len().max(outside.outputs.len()),
        inner = 80 + 40 * outside.inputs.len().max(outside.outputs.len()),
    );
    if let Some(step) = &step {
        let _ = writeln!(out, "set_param(fmu, 'FMUSampleTime', '{step}');");
    }
    let (inputs, outputs) = (outside.inputs.len(), outside.outputs.len());
    let _ = write!(
        out,
        "ports = get_param(fmu, 'PortHandles');
if numel(ports.Inport) ~= {inputs} || numel(ports.Outport) ~= {outputs}
    error('fmu:simulink', ['The block FMU has %d inputs and %d outputs, the description has {inputs} and {outputs}: ' ...
        'make all of them visible in the dialog of the block.'], numel(ports.Inport), numel(ports.Outport));
end
mask = Simulink.Mask.create(block);
mask.Type = '{stem}';
mask.Description = {about};
",
        about = literal(names.about, 19),
    );
    if !outside.settings.is_empty() {
        out += "mask.addParameter('Type', 'edit', 'Name', 'p', 'Prompt', 'Struct of parameters', ...\n";
        let _ = writeln!(out, "    'Value', '{parameters}');");
        out += &links(parameters, outside);
    }
    out += &signals(stem, outside);
    if let Some(flange) = &outside.flange {
        out += &mechanics(flange, step.as_deref());
    }
    out += "end\n";
    if !outside.settings.is_empty() {
        out += LINK;
    }
    if outside.buses_in.len() + outside.buses_out.len() > 0 {
        out += BUS;
    }
    out
}

/// The parameters of the block FMU as expressions of the struct.
fn links(parameters: &str, outside: &Outside) -> String {
    let mut numbers = String::new();
    let mut choices = String::new();
    for setting in &outside.settings {
        for (fmi, expression) in setting.links() {
            let name = literal(fmi, 4);
            match setting.kind {
                Kind::Number => numbers += &cells(&[name, format!("'{expression}'")]),
                Kind::Truth | Kind::Item => choices += &cells(&[name, expression]),
            }
        }
    }
    let mut out = String::new();
    if !numbers.is_empty() {
        let _ = write!(out, "\n% Numbers: expressions of the mask's struct.\nlink(fmu, {{ ...\n{numbers}    }});\n");
    }
    if !choices.is_empty() {
        let _ = write!(
            out,
            "\n% Check boxes and lists: values of the struct when the model is built.\np = {parameters};\n\
             link(fmu, {{ ...\n{choices}    }});\n"
        );
    }
    out
}

/// Ports and buses of the block, and constants and outputs around it.
fn signals(stem: &str, outside: &Outside) -> String {
    let mut out = String::new();
    let bound: Vec<usize> = outside.flange.iter().flat_map(|f| [Some(f.speed), f.angle]).flatten().collect();
    let in_bus = |groups: &[Group], at: usize| groups.iter().any(|g| g.elements.iter().any(|(_, e)| *e == at));
    let mut inputs = String::new();
    for (at, port) in outside.inputs.iter().enumerate() {
        if !bound.contains(&at) && !in_bus(&outside.buses_in, at) {
            let start = port.start.as_deref().map_or_else(|| "''".into(), |start| literal(start, 8));
            inputs += &cells(&[format!("'{}'", port.name), (at + 1).to_string(), start]);
        }
    }
    out += "\n% Inputs: block, port of the FMU, constant around the block ('': connect a signal).\n";
    let _ = write!(
        out,
        "inputs = {{ ...
{inputs}    }};
for k = 1:size(inputs, 1)
    y = 40*k;
    add_block('simulink/Sources/In1', [block '/' inputs{{k, 1}}], 'Position', [40 y 70 y+14]);
    add_line(block, [inputs{{k, 1}} '/1'], sprintf('FMU/%d', inputs{{k, 2}}));
    if ~isempty(inputs{{k, 3}})
        add_block('simulink/Sources/Constant', [model '/' inputs{{k, 1}}], 'Value', inputs{{k, 3}}, ...
            'OutDataTypeStr', 'Inherit: Inherit from ''Constant value''', 'Position', [60 y 160 y+20]);
        add_line(model, [inputs{{k, 1}} '/1'], sprintf('{stem}/%d', k));
    end
end
"
    );
    let mut outputs = String::new();
    for (at, port) in outside.outputs.iter().enumerate() {
        if !in_bus(&outside.buses_out, at) {
            outputs += &cells(&[format!("'{}'", port.name), (at + 1).to_string()]);
        }
    }
    let _ = write!(
        out,
        "\n% Outputs: block, port of the FMU.
outputs = {{ ...
{outputs}    }};
for k = 1:size(outputs, 1)
    y = 40*k;
    add_block('simulink/Sinks/Out1', [block '/' outputs{{k, 1}}], 'Position', [940 y 970 y+14]);
    add_line(block, sprintf('FMU/%d', outputs{{k, 2}}), [outputs{{k, 1}} '/1']);
    add_block('simulink/Sinks/Out1', [model '/' outputs{{k, 1}}], 'Position', [860 y 890 y+14]);
    add_line(model, sprintf('{stem}/%d', k), [outputs{{k, 1}} '/1']);
end
"
    );
    for (way, groups, ports) in
        [("in", &outside.buses_in, &outside.inputs), ("out", &outside.buses_out, &outside.outputs)]
    {
        for group in groups {
            out += &bus(way, stem, group, ports);
        }
    }
    out
}

/// A bus: its type, and its port.
fn bus(way: &str, stem: &str, group: &Group, ports: &[Port]) -> String {
    let kind = super::text::identifier(&format!("{stem}_{}", group.name), 63);
    let mut rows = String::new();
    let mut start = Vec::new();
    for (element, at) in &group.elements {
        let port = &ports[*at];
        let measured = port.unit.as_deref().map(|unit| format!(" ({unit})")).unwrap_or_default();
        let symbol = port.unit.as_deref().and_then(unit).unwrap_or_default();
        rows += &cells(&[
            format!("'{element}'"),
            (at + 1).to_string(),
            format!("'{}'", port.of.unwrap_or("double")),
            format!("'{symbol}'"),
            literal(&format!("{}{measured}", port.about), 8),
        ]);
        start.push(format!("'{element}', {}", port.start.as_deref().unwrap_or("0.0")));
    }
    let value = literal(&format!("struct({})", start.join(", ")), 4);
    let constant = if way == "in" { format!(", ...\n    {value}") } else { String::new() };
    format!(
        "\n{}bus_{way}(model, '{stem}', '{}', '{kind}', ...\n    {}, {{ ...\n{rows}    }}{constant});\n",
        comment(&group.about, 0),
        group.name,
        literal(&group.about, 4),
    )
}

/// The flange: torque source, motion sensor and the rotor's inertia.
fn mechanics(flange: &Flange, step: Option<&str>) -> String {
    let Flange { speed, angle, torque, inertia } = flange;
    let mut out = String::from(
        "\n% The flange. Torque is positive from C to R of the source, speed is that of R relative to C of the sensor.\n",
    );
    let mut blocks = vec![
        ("fl_lib/Mechanical/Mechanical Sources/Ideal Torque Source", "torque_source", "[700 700 740 740]"),
        ("fl_lib/Mechanical/Mechanical Sensors/Ideal Rotational Motion Sensor", "motion_sensor", "[780 700 820 740]"),
        ("fl_lib/Mechanical/Rotational Elements/Mechanical Rotational Reference", "housing", "[700 780 740 820]"),
        ("nesl_utility/Solver Configuration", "solver", "[620 780 660 820]"),
        ("nesl_utility/Simulink-PS Converter", "torque", "[620 700 650 730]"),
        ("nesl_utility/PS-Simulink Converter", "speed_of_shaft", "[860 700 890 730]"),
        ("nesl_utility/Connection Port", "flange", "[940 760 970 774]"),
    ];
    if inertia.is_some() {
        blocks.push(("fl_lib/Mechanical/Rotational Elements/Inertia", "rotor", "[860 760 900 800]"));
    }
    if angle.is_some() {
        blocks.push(("nesl_utility/PS-Simulink Converter", "angle_of_shaft", "[860 820 890 850]"));
    }
    if step.is_some() {
        blocks.push(("simulink/Discrete/Unit Delay", "last_step", "[560 700 590 730]"));
    }
    for (library, name, position) in blocks {
        let _ = writeln!(out, "add_block('{library}', ...\n    [block '/{name}'], 'Position', {position});");
    }
    out += "set_param([block '/torque'], 'Unit', 'N*m');\nset_param([block '/speed_of_shaft'], 'Unit', 'rad/s');\n";
    if angle.is_some() {
        out += "set_param([block '/angle_of_shaft'], 'Unit', 'rad');\n";
    }
    if let Some(field) = inertia {
        let _ = writeln!(out, "set_param([block '/rotor'], 'inertia', 'p.{field}');");
    }
    if let Some(step) = step {
        let _ = writeln!(
            out,
            "set_param([block '/solver'], 'UseLocalSolver', 'on', 'LocalSolverSampleTime', '{step}');\n\
             % The delay of one step prevents an algebraic loop through the FMU and the drive train.\n\
             set_param([block '/last_step'], 'SampleTime', '{step}');\n\
             add_line(block, 'FMU/{}', 'last_step/1');\nadd_line(block, 'last_step/1', 'torque/1');",
            torque + 1
        );
    } else {
        let _ = writeln!(out, "add_line(block, 'FMU/{}', 'torque/1');", torque + 1);
    }
    let _ = writeln!(out, "add_line(block, 'speed_of_shaft/1', 'FMU/{}');", speed + 1);
    let mut pairs = vec![
        ("torque", "output", "torque_source", "S"),
        ("torque_source", "C", "housing", "W"),
        ("torque_source", "R", "motion_sensor", "R"),
        ("motion_sensor", "C", "housing", "W"),
        ("motion_sensor", "W", "speed_of_shaft", "input"),
        ("solver", "port", "housing", "W"),
        ("torque_source", "R", "flange", "port"),
    ];
    if let Some(angle) = angle {
        let _ = writeln!(out, "add_line(block, 'angle_of_shaft/1', 'FMU/{}');", angle + 1);
        pairs.push(("motion_sensor", "A", "angle_of_shaft", "input"));
    }
    if inertia.is_some() {
        pairs.push(("torque_source", "R", "rotor", "I"));
    }
    for (from, port, to, end) in pairs {
        let _ = writeln!(out, "simscape.addConnection([block '/{from}'], '{port}', [block '/{to}'], '{end}');");
    }
    out
}

/// Names in the block's dialog differ from the FMU's in characters that MATLAB forbids: only letters and digits count.
const LINK: &str = r"
function link(fmu, rows)
dialog = fieldnames(get_param(fmu, 'DialogParameters'));
keys = regexprep(dialog, '[^A-Za-z0-9]', '');
for k = 1:size(rows, 1)
    at = find(strcmp(keys, regexprep(rows{k, 1}, '[^A-Za-z0-9]', '')));
    value = rows{k, 2};
    if islogical(value)
        states = {'off', 'on'};
        value = states{value + 1};
    end
    if numel(at) == 1
        set_param(fmu, dialog{at}, value);
    else
        warning('fmu:simulink', '%s keeps its start value: %d parameters of the block match.', rows{k, 1}, numel(at));
    end
end
end
";

/// The type of a bus in the base workspace; a port of the block that is a bus.
const BUS: &str = r"
function define_bus(kind, about, rows)
elements = repmat(Simulink.BusElement, size(rows, 1), 1);
for k = 1:size(rows, 1)
    element = Simulink.BusElement;
    element.Name = rows{k, 1};
    element.DataType = rows{k, 3};
    element.Unit = rows{k, 4};
    element.Description = rows{k, 5};
    elements(k) = element;
end
bus = Simulink.Bus;
bus.Description = about;
bus.Elements = elements;
assignin('base', kind, bus);
end

function bus_in(model, stem, name, kind, about, rows, value)
define_bus(kind, about, rows);
block = [model '/' stem];
ports = get_param(block, 'PortHandles');
y = 80 + 40*numel(ports.Inport);
add_block('simulink/Sources/In1', [block '/' name], 'OutDataTypeStr', ['Bus: ' kind], ...
    'Position', [40 y 70 y+14]);
add_block('simulink/Signal Routing/Bus Selector', [block '/' name '_selector'], ...
    'OutputSignals', strjoin(rows(:, 1)', ','), 'Position', [140 y 145 y+30]);
add_line(block, [name '/1'], [name '_selector/1']);
for k = 1:size(rows, 1)
    add_line(block, sprintf('%s_selector/%d', name, k), sprintf('FMU/%d', rows{k, 2}));
end
add_block('simulink/Sources/Constant', [model '/' name], 'Value', value, 'OutDataTypeStr', ['Bus: ' kind], ...
    'Position', [60 y 160 y+20]);
add_line(model, [name '/1'], sprintf('%s/%d', stem, numel(ports.Inport) + 1));
end

function bus_out(model, stem, name, kind, about, rows)
define_bus(kind, about, rows);
block = [model '/' stem];
ports = get_param(block, 'PortHandles');
y = 80 + 40*numel(ports.Outport);
add_block('simulink/Signal Routing/Bus Creator', [block '/' name '_creator'], ...
    'Inputs', sprintf('%d', size(rows, 1)), 'OutDataTypeStr', ['Bus: ' kind], 'Position', [860 y 865 y+30]);
for k = 1:size(rows, 1)
    line = add_line(block, sprintf('FMU/%d', rows{k, 2}), sprintf('%s_creator/%d', name, k));
    set_param(line, 'Name', rows{k, 1});
end
add_block('simulink/Sinks/Out1', [block '/' name], 'Position', [940 y 970 y+14]);
add_line(block, [name '_creator/1'], [name '/1']);
add_block('simulink/Sinks/Out1', [model '/' name], 'Position', [860 y 890 y+14]);
add_line(model, sprintf('%s/%d', stem, numel(ports.Outport) + 1), [name '/1']);
end
";
