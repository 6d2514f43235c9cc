//! How a drive is used: torque or speed control, on its own inertia or on the shaft of a drive train.
//!
//! These values are added after the trial, which controls the speed of a free shaft.

use super::setting::{Tuned, Value, set};
use crate::error::{Error, Result, bail};

/// Reference of the controller and coupling of the shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Application {
    /// The controller follows `tau_ref`.
    pub torque: bool,
    /// The drive train imposes speed and angle on the shaft.
    pub imposed: bool,
}

impl Application {
    /// From the words `speed` or `torque`, and `free` or `imposed`; the first of each without a word.
    ///
    /// # Errors
    /// Another word: names the option, the word and those that it accepts.
    pub fn named(control: Option<&str>, shaft: Option<&str>) -> Result<Self> {
        Ok(Self {
            torque: second("control", control, ["speed", "torque"])?,
            imposed: second("shaft", shaft, ["free", "imposed"])?,
        })
    }

    /// The drive with the values of this application.
    ///
    /// # Errors
    /// They do not fit the other values.
    pub fn applied(self, tuned: &Tuned) -> Result<Tuned> {
        let mut all = tuned.clone();
        if self.torque {
            all.controller.push(set("speed_loop.torque_mode", Value::Boolean(true), "torque control by tau_ref"));
        }
        if self.imposed {
            all.plant.push(set("mechanics.imposed", Value::Boolean(true), "the drive train turns the shaft"));
            if all
                .controller
                .iter()
                .any(|s| s.name == "start.mode" && s.value == Value::Item("CurrentFrequency".into()))
            {
                bail!(
                    "shaft = imposed with the I-f start of {}: the start turns the rotor, and the drive train holds it; choose \
                     the estimator Sensored, or one that starts by itself, such as Rasmussen",
                    tuned.estimator.name()
                );
            }
        }
        all.pair().start().map_err(|e| Error::new(format!("{}: these values do not fit together: {e}", tuned.name)))?;
        Ok(all)
    }
}

/// Whether the word is the second of the two.
fn second(option: &str, given: Option<&str>, [first, second]: [&str; 2]) -> Result<bool> {
    match given {
        None => Ok(false),
        Some(word) if word == first => Ok(false),
        Some(word) if word == second => Ok(true),
        Some(word) => bail!("{option} = {word}: must be {first} or {second}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::motor::MotorFile;
    use super::super::rules::fixed;
    use super::*;
    use std::path::Path;

    fn tuned(machine: &str, estimator: &str) -> Tuned {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../motors/{machine}.toml"));
        let mut motor = MotorFile::read(&path).unwrap();
        motor.choose(estimator).unwrap();
        fixed(&motor).unwrap()
    }

    fn named(control: &str, shaft: &str) -> Application {
        Application::named(Some(control), Some(shaft)).unwrap()
    }

    #[test]
    fn words_become_values() {
        let other =
            |all: &[super::super::setting::Setting]| -> Vec<&'static str> { all.iter().map(|s| s.name).collect() };
        let plain = tuned("traction-100kw", "Sensored");
        assert_eq!(Application::named(None, None).unwrap().applied(&plain).unwrap(), plain);
        assert_eq!(named("speed", "free").applied(&plain).unwrap(), plain);
        let used = named("torque", "imposed").applied(&plain).unwrap();
        let pair = used.pair();
        assert!(
            pair.controller.model.parameters.speed_loop.torque_mode && pair.plant.model.parameters.mechanics.imposed
        );
        assert_eq!(other(&used.controller).len(), other(&plain.controller).len() + 1);
        let half = named("torque", "free").applied(&plain).unwrap().pair();
        assert!(
            half.controller.model.parameters.speed_loop.torque_mode && !half.plant.model.parameters.mechanics.imposed
        );
    }

    /// Only the current limits the torque of a drive with a sensor: a higher `limit.tau` adds nothing.
    #[test]
    fn a_sensor_has_the_torque_of_the_current_limit() {
        for machine in ["traction-100kw", "reference", "ipmsm-2.2kw", "servo-6.6kw"] {
            let plain = tuned(machine, "Sensored");
            let [limits, more] = [plain.clone(), plain.with("limit.tau", Value::Real(1e4))].map(|tuned| {
                let par = tuned.pair().controller.model.parameters.clone();
                drive::control::reference::max_torque(&par.motor, &par.limit, par.current.mtpa)
            });
            assert!((limits / more - 1.0).abs() < 1e-12 && limits > plain.torque, "{machine}: {limits} of {more} N.m");
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_by_name() {
        let unknown = Application::named(Some("current"), None).unwrap_err().to_string();
        assert_eq!(unknown, "control = current: must be speed or torque");
        let unknown = Application::named(None, Some("loose")).unwrap_err().to_string();
        assert_eq!(unknown, "shaft = loose: must be free or imposed");
        let held = named("torque", "imposed").applied(&tuned("traction-100kw", "ExtendedEmf")).unwrap_err().to_string();
        assert!(
            held.contains("shaft = imposed") && held.contains("ExtendedEmf") && held.contains("Sensored"),
            "{held}"
        );
    }
}
