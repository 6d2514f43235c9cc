//! The two drives with a flange: the rotor in Modelica, or the rotor in the FMU behind a compliant shaft.

use super::base::icon;
use super::interface::{Interface, Shaft};

const FLANGE: &str = "  Modelica.Mechanics.Rotational.Interfaces.Flange_a flange
    \"The shaft's end\"
    annotation(Placement(transformation(extent={{90,-10},{110,10}})));
";

/// `ImposedShaft.mo`, if the FMU has that shaft.
pub(super) fn imposed(package: &str, interface: &Interface) -> Option<String> {
    let (Shaft { speed, angle, tau }, flag, inertia) = interface.imposed.as_ref()?;
    let load = interface.shaft.as_ref().map(|s| format!("  fmu.{} = 0;\n", s.tau)).unwrap_or_default();
    Some(format!(
        "within {package};
model ImposedShaft
  \"The rotor's inertia is here, and the FMU gives its torque: for every stiffness of the drive train\"
  extends Base(final {flag}=true);
{FLANGE}  Modelica.Mechanics.Rotational.Components.Inertia rotor(final J={inertia})
    \"The rotor\"
    annotation(Placement(transformation(extent={{{{20,-10}},{{40,10}}}})));
protected
  Modelica.Mechanics.Rotational.Sources.Torque torque
    \"The torque that the shaft receives from the FMU\"
    annotation(Placement(transformation(extent={{{{-20,-10}},{{0,10}}}})));
equation
  torque.tau = fmu.{tau};
  fmu.{speed} = rotor.w;
  fmu.{angle} = rotor.phi;
{load}  connect(torque.flange, rotor.flange_a) annotation(Line(points={{{{0,0}},{{20,0}}}}));
  connect(rotor.flange_b, flange) annotation(Line(points={{{{40,0}},{{100,0}}}}));
  annotation(Icon(graphics={{{icon}}}));
end ImposedShaft;
",
        icon = icon(package),
    ))
}

/// `CompliantShaft.mo`, if the FMU has that shaft.
pub(super) fn compliant(package: &str, interface: &Interface) -> Option<String> {
    let Shaft { speed, angle, tau } = interface.shaft.as_ref()?;
    let (flag, other) = match &interface.imposed {
        Some((shaft, flag, _)) => {
            (format!("(final {flag}=false)"), format!("  fmu.{} = 0;\n  fmu.{} = 0;\n", shaft.speed, shaft.angle))
        }
        None => Default::default(),
    };
    Some(format!(
        "within {package};
model CompliantShaft
  \"The rotor turns in the FMU, and a spring with a damper is between it and the flange, which needs an inertia\"
  extends Base{flag};
{FLANGE}  parameter Real c(unit=\"N.m/rad\", min=0) = 500
    \"Stiffness of the shaft\"
    annotation(Dialog(group=\"Shaft\"));
  parameter Real d(unit=\"N.m.s/rad\", min=0) = 0.2
    \"Damping of the shaft\"
    annotation(Dialog(group=\"Shaft\"));
  parameter Real lag(unit=\"s\", min=1e-6) = 1e-4
    \"Time constant of the shaft's torque: without it OpenModelica, which takes every output of an FMU to depend on every input, solves an algebraic loop\"
    annotation(Dialog(group=\"Shaft\"));
  parameter Real phi_start(unit=\"rad\", displayUnit=\"deg\") = 0
    \"Angle of the flange at the start, where the spring is relaxed\"
    annotation(Dialog(group=\"Shaft\"));
  Real tau(unit=\"N.m\", start=0, fixed=true)
    \"Torque of the shaft on the drive train\";
protected
  parameter Real angle_start(unit=\"rad\", fixed=false)
    \"Angle of the rotor at the start\";
  Real twist(unit=\"rad\")
    \"Angle of the rotor ahead of the flange\";
initial equation
  angle_start = fmu.{angle};
equation
  // The torque cannot gain energy from its lag if d >= c lag.
  assert(d >= c*lag, \"d = \" + String(d) + \" N.m.s/rad is below c lag = \" + String(c*lag) + \": the shaft would gain energy\");
  twist = fmu.{angle} - angle_start - (flange.phi - phi_start);
  lag*der(tau) = c*twist + d*(fmu.{speed} - der(flange.phi)) - tau;
  flange.tau = -tau;
  fmu.{tau} = tau;
{other}  annotation(Icon(graphics={{{icon}}}));
end CompliantShaft;
",
        icon = icon(package),
    ))
}
