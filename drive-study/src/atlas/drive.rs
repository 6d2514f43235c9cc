//! A drive of the atlas: a drive of `fmu compare`, or one tuned for a machine's file, with settings of the user.

use crate::compare::candidate::{Candidate, Class, Entry};
use crate::runner::{Bench, REFERENCE_SPEED};
use drive::SensorlessController;
use drive::control::start::StartMode;
use drive::estimator::Kind;
use drive::plant::pwm::InverterMode;
use drive_tools::error::{Error, Result, WithContext, bail};
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use fmu_core::description::VariableKind;
use fmu_core::variable::Causality;
use fmu_core::{Description, Model, Slot};
use std::path::Path;
use toml::Spanned;

/// How the drive reaches its speed; this also determines when it counts as lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Approach {
    /// From rest, in steps.
    Rest,
    /// From 0.2 of the rated speed, by ramps.
    Turning,
}

/// A drive at rest, and the units of the axes of the atlas.
#[derive(Clone)]
pub struct Drive {
    /// Name of the estimator.
    pub name: String,
    /// Its machine.
    pub machine: String,
    /// The drive at rest, with its rated speed and torque.
    pub bench: Bench,
    /// How it reaches its speed.
    pub approach: Approach,
}

impl Drive {
    /// The drive of `fmu compare`: rated are 3000 rpm and 2 N.m on the reference motor, 1500 rpm and 14 N.m on the 2.2 kW
    /// machine.
    pub fn compared(entry: Entry) -> Self {
        let Candidate { class, mut bench, .. } = Candidate::new(entry);
        let rest = class == Class::FluxObserver;
        if rest {
            bench.speed = REFERENCE_SPEED;
        }
        Self {
            name: entry.name.into(),
            machine: entry.machine.into(),
            bench,
            approach: if rest { Approach::Rest } else { Approach::Turning },
        }
    }

    /// The machine of a file with this estimator and a fixed resistance, tuned by the rules of `fmu tune`: a flux observer by those
    /// for Rasmussen's, any other by those for the extended EMF.
    ///
    /// # Errors
    /// Those of [`drive_tools::tune::tune`].
    pub fn tuned(path: &Path, kind: Kind) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        let mut file = MotorFile::parse(&text, path)?;
        let rest = kind.class() == Class::FluxObserver;
        let rules = if rest { "Rasmussen" } else { "ExtendedEmf" };
        file.data.control.estimator = Some(Spanned::new(0..0, rules.into()));
        let tuned = rules::fixed(&file)?;
        let mut pair = tuned.pair();
        let par = &mut pair.controller.model.parameters;
        par.estimator = kind;
        par.start.mode = StartMode::Direct;
        // The other estimators refuse this option.
        par.estimators.emf.hold_reversal &= kind == Kind::ExtendedEmf;
        Ok(Self {
            name: kind.name().into(),
            machine: tuned.name,
            bench: Bench { pair, speed: *file.data.rating.speed.get_ref(), torque: *file.data.rating.torque.get_ref() },
            approach: if rest { Approach::Rest } else { Approach::Turning },
        })
    }

    /// The drive on this inverter. Switched has a carrier period of one sample, whose extremes are the sampling instants.
    #[must_use]
    pub fn on_inverter(mut self, mode: InverterMode) -> Self {
        let (plant, controller) = (&mut self.bench.pair.plant.model, &self.bench.pair.controller.model);
        if mode == InverterMode::Switched {
            plant.parameters.inverter.T_pwm = controller.parameters.T_s;
            self.machine.push_str(", switched inverter");
        }
        plant.parameters.inverter.pwm.mode = mode;
        self
    }

    /// Sets a parameter of the controller from the text `name=value`.
    ///
    /// # Errors
    /// States the error and the expected input.
    pub fn set(&mut self, text: &str) -> Result<()> {
        let (name, value) = text
            .split_once('=')
            .ok_or_else(|| Error::new(format!("--set {text}: is not NAME=VALUE; write for example T_s=1e-4")))?;
        let description = Description::of::<SensorlessController>().map_err(Error::new)?;
        let variable = description.variable(name).filter(|v| v.causality == Causality::Parameter).ok_or_else(|| {
            Error::new(format!(
                "--set {name}: is not a parameter of SensorlessController; its documentation page lists them"
            ))
        })?;
        if name.starts_with("motor.") {
            bail!("--set {name}: the atlas sets the motor's values from the machine; choose --resistance or --flux");
        }
        let wrong = |expected: &str| Error::new(format!("--set {name}={value}: must be {expected}; correct the value"));
        let table = <SensorlessController as Model>::TABLE;
        let index = (0..table.len()).find(|&i| table.locate(i).is_some_and(|(found, ..)| found == name));
        let block = &mut self.bench.pair.controller;
        let (_, slot) = index
            .and_then(|i| table.entry(block, i))
            .ok_or_else(|| Error::new(format!("--set {name}: does not accept --set")))?;
        match (slot, &variable.kind) {
            (Slot::Real(x), _) => {
                let range = variable.range();
                let number = value.parse::<f64>().ok().filter(|x| x.is_finite() && range.contains(*x));
                *x = number.ok_or_else(|| wrong(&format!("a number {range}")))?;
            }
            (Slot::Integer(x), _) => {
                let range = variable.range();
                let number = value.parse::<i32>().ok().filter(|x| range.contains(f64::from(*x)));
                x.set(number.ok_or_else(|| wrong(&format!("an integer {range}")))?.into());
            }
            (Slot::Boolean(x), _) => *x = value.parse().map_err(|_| wrong("true or false"))?,
            (Slot::Enumeration(x), VariableKind::Enumeration { items, .. }) => {
                let known = || items.iter().map(|(_, name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
                let item = items.iter().find(|(_, name, _)| name == value);
                x.set(item.ok_or_else(|| wrong(&format!("one of {}", known())))?.0);
            }
            _ => return Err(wrong("a number")),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_setting_names_what_is_allowed() {
        let mut drive = Drive::compared(Entry::all()[0]);
        for (text, expected) in [
            ("T_s", "--set T_s: is not NAME=VALUE"),
            ("adaptation.on=true", "--set adaptation.on: is not a parameter of SensorlessController"),
            ("speed_est=1", "--set speed_est: is not a parameter"),
            ("motor.R_s=1", "--set motor.R_s: the atlas sets the motor's values"),
            ("adaptation.resistance=1", "--set adaptation.resistance=1: must be true or false"),
            ("limit.i=-1", "--set limit.i=-1: must be a number"),
            ("T_s=NaN", "--set T_s=NaN: must be a number"),
            ("timing.delay=5", "--set timing.delay=5: must be an integer"),
            ("start.mode=Now", "--set start.mode=Now: must be one of"),
        ] {
            let message = drive.set(text).unwrap_err().to_string();
            assert!(message.starts_with(expected), "{message}");
        }
        drive.set("adaptation.k_a=0.02").unwrap();
        drive.set("adaptation.resistance=true").unwrap();
        let adaptation = &drive.bench.pair.controller.model.parameters.estimators.adaptation;
        assert!(adaptation.resistance && (adaptation.k_a - 0.02).abs() < 1e-12);
    }
}
