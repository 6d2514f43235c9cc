//! `Examples.mo`: drive trains that run, and the script that imports the FMU into OpenModelica and runs one.

use super::figures::{COUPLING, Figure, LOAD, SPEED, STOP};
use super::interface::Interface;
use std::fmt::Write as _;

/// The text of `Examples.mo`.
pub(super) fn text(package: &str, interface: &Interface) -> String {
    let mut out = format!(
        "within {package};\npackage Examples\n  \"Drive trains that run\"\n  extends Modelica.Icons.ExamplesPackage;\n"
    );
    let has_reference = interface.signals().any(|v| v.name == "speed_ref");
    let (c, d, inertia) = COUPLING;
    let reference = || {
        let source = format!(
            "    Modelica.Blocks.Sources.Step speed(height={SPEED}, startTime=0.1)\n      \
             annotation(Placement(transformation(extent={{{{-90,-10}},{{-70,10}}}})));\n"
        );
        let connect =
            "    connect(speed.y, drive.speed_ref) annotation(Line(points={{-69,0},{-52,0}}, color={0,0,127}));\n";
        if has_reference { (source, connect) } else { Default::default() }
    };
    let used = if has_reference { "use_speed_ref=true" } else { "" };
    let load = format!(
        "    Modelica.Mechanics.Rotational.Components.Inertia load(J={inertia}, phi(start=0, fixed=true), w(start=0, fixed=true))
      annotation(Placement(transformation(extent={{{{30,-10}},{{50,10}}}})));
    Modelica.Mechanics.Rotational.Sources.Torque torque
      annotation(Placement(transformation(extent={{{{80,-10}},{{60,10}}}})));
    Modelica.Blocks.Sources.Step tau(height=-{LOAD:?}, startTime=0.6)
      annotation(Placement(transformation(extent={{{{80,30}},{{60,50}}}})));\n"
    );
    let torque = "    connect(tau.y, torque.tau) annotation(Line(points={{59,40},{52,40},{52,20},{90,20},{90,0},{82,0}}, color={0,0,127}));
    connect(torque.flange, load.flange_b) annotation(Line(points={{60,0},{50,0}}));\n";
    let experiment = format!("    annotation(experiment(StopTime={STOP:?}, Interval=1e-3, Tolerance=1e-6));\n");
    let (source, connect) = reference();
    let mut put = |name: &str, about: &str, drive: &str, extra: &str, wires: &str| {
        let _ = write!(
            out,
            "\n  model {name}\n    \"{about}\"\n    extends Modelica.Icons.Example;\n{drive}{source}{extra}{load}  equation\n\
             {connect}{wires}{torque}{experiment}  end {name};\n"
        );
    };
    let placed = |class: &str, modifiers: &[&str]| {
        let modifiers: Vec<&str> = modifiers.iter().copied().filter(|m| !m.is_empty()).collect();
        format!(
            "    {class} drive({})\n      annotation(Placement(transformation(extent={{{{-50,-20}},{{-10,20}}}})));\n",
            modifiers.join(", ")
        )
    };
    let coupling = format!(
        "    Modelica.Mechanics.Rotational.Components.SpringDamper coupling(c={c}, d={d})\n      \
         annotation(Placement(transformation(extent={{{{0,-10}},{{20,10}}}})));\n"
    );
    let coupled = "    connect(drive.flange, coupling.flange_a) annotation(Line(points={{-10,0},{0,0}}));
    connect(coupling.flange_b, load.flange_a) annotation(Line(points={{20,0},{30,0}}));\n";
    let rotor = "rotor(phi(start=0, fixed=true), w(start=0, fixed=true))";
    if interface.imposed.is_some() {
        let drive = placed("ImposedShaft", &[used, rotor]);
        put("TwoInertias", "Rotor and load with a spring and a damper between them", &drive, &coupling, coupled);
    }
    if interface.shaft.is_some() {
        let drive = placed("CompliantShaft", &[used, &format!("c={c}"), &format!("d={d}")]);
        let connect = "    connect(drive.flange, load.flange_a) annotation(Line(points={{-10,0},{30,0}}));\n";
        put(
            "TwoInertiasCompliant",
            "Two inertias behind a compliant shaft, with the rotor in the FMU",
            &drive,
            "",
            connect,
        );
    }
    let coolant = interface.heats.iter().any(|h| h.name == "coolant");
    if let (Some((u, ..)), true, true) = (&interface.link, coolant, interface.imposed.is_some()) {
        let u_dc = interface.input(u).map(super::interface::Variable::start).unwrap_or_default();
        let drive = placed("ImposedShaft", &[used, "use_dc_link=true", "use_coolant=true", rotor]);
        let parts = format!(
            "{coupling}    Modelica.Electrical.Analog.Sources.ConstantVoltage battery(V={u_dc})
      annotation(Placement(transformation(extent={{{{-90,80}},{{-70,100}}}})));
    Modelica.Electrical.Analog.Basic.Resistor cable(R=0.1)
      annotation(Placement(transformation(extent={{{{-60,80}},{{-40,100}}}})));
    Modelica.Electrical.Analog.Basic.Capacitor link(C=5e-4, v(start={u_dc}, fixed=true))
      annotation(Placement(transformation(extent={{{{-40,50}},{{-20,70}}}})));
    Modelica.Electrical.Analog.Basic.Ground ground
      annotation(Placement(transformation(extent={{{{-90,40}},{{-70,60}}}})));
    Modelica.Thermal.HeatTransfer.Sources.FixedTemperature coolant(T=313.15)
      annotation(Placement(transformation(extent={{{{-60,-60}},{{-40,-40}}}})));\n"
        );
        let wires = format!(
            "{coupled}    connect(battery.p, cable.p) annotation(Line(points={{{{-90,90}},{{-60,90}}}}, color={{0,0,255}}));
    connect(cable.n, link.p) annotation(Line(points={{{{-40,90}},{{-40,60}}}}, color={{0,0,255}}));
    connect(link.p, drive.dc_p) annotation(Line(points={{{{-40,60}},{{-38,20}}}}, color={{0,0,255}}));
    connect(link.n, drive.dc_n) annotation(Line(points={{{{-20,60}},{{-22,20}}}}, color={{0,0,255}}));
    connect(battery.n, link.n) annotation(Line(points={{{{-70,90}},{{-20,90}},{{-20,60}}}}, color={{0,0,255}}));
    connect(ground.p, battery.n) annotation(Line(points={{{{-80,60}},{{-70,90}}}}, color={{0,0,255}}));
    connect(coolant.port, drive.coolant) annotation(Line(points={{{{-40,-50}},{{-30,-50}},{{-30,-20}}}}, color={{191,0,0}}));\n"
        );
        let about = "With a battery, its cable, the capacitor of the link, and a coolant of 40 degC";
        put("SupplyAndCooling", about, &drive, &parts, &wires);
    }
    out + "end Examples;\n"
}

/// `import.mos`, for OpenModelica.
pub(super) fn script(package: &str, fmu: &str, block: &str, figures: &Result<Vec<Figure>, String>) -> String {
    let rows = figures.as_deref().unwrap_or_default();
    let expected = match figures {
        Ok(rows) => {
            let row = |(t, w, tau): &Figure| format!("// {t:<6} {w:>10.3} {tau:>10.3}\n");
            let rows: String = rows.iter().map(row).collect();
            format!(
                "// It must print about these values (speeds within 0.1 rad/s, torques within 0.05 N.m):\n// t/s        load.w coupling.flange_a.tau\n{rows}"
            )
        }
        Err(why) => format!("// No figures are given, because the FMU does not run here: {}\n", why.replace('\n', " ")),
    };
    let times: Vec<String> = rows.iter().map(|(t, ..)| t.to_string()).collect();
    let times = if times.is_empty() { STOP.to_string() } else { times.join(", ") };
    format!(
        "// Imports {fmu}, loads {package} and runs an example: omc import.mos, in this folder.
{expected}loadModel(Modelica); getErrorString();
// The import of an FMU with states needs reinit in an algorithm.
setCommandLineOptions(\"--allowNonStandardModelica=reinitInAlgorithms\"); getErrorString();
// One folder for each FMU: the block reads the description there again when it runs.
mkdir(\"{block}\");
importFMU(\"{fmu}\", \"{block}\"); getErrorString();
loadFile(\"{block}/{block}.mo\"); getErrorString();
loadFile(\"{package}/package.mo\"); getErrorString();
simulate({package}.Examples.TwoInertias, stopTime={STOP:?}, numberOfIntervals=1000, tolerance=1e-6); getErrorString();
for t in {{{times}}} loop
  print(String(t) + \" \" + String(val(load.w, t)) + \" \" + String(val(coupling.flange_a.tau, t)) + \"\\n\");
end for;
"
    )
}
