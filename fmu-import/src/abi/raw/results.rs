//! Results of calls, as the FMU wrote them.

use std::fmt;

/// Value of a byte or an integer before a call.
pub(super) const UNTOUCHED: u8 = 0xc5;
/// Value of a number before a call: a NaN that no computation returns.
pub(super) const UNTOUCHED_NUMBER: f64 = f64::from_bits(0x7ff8_c5c5_c5c5_c5c5);

/// A flag that the FMU returned, as text; what it did not write has no value.
pub fn flag_text(flag: i32) -> String {
    if flag == i32::from(UNTOUCHED) { "(not written)".into() } else { flag.to_string() }
}

/// A number that the FMU returned, as text; what it did not write has no value.
pub fn number_text(x: f64) -> String {
    if x.to_bits() == UNTOUCHED_NUMBER.to_bits() { "(not written)".into() } else { format!("{x:?}") }
}

/// Writes results as `name=value, ...`.
fn list(f: &mut fmt::Formatter<'_>, flags: &[(&str, i32)], (name, number): (&str, f64)) -> fmt::Result {
    flags.iter().try_for_each(|(name, flag)| write!(f, "{name}={}, ", flag_text(*flag)))?;
    write!(f, "{name}={}", number_text(number))
}

/// Which results of `fmi3DoStep` get a pointer; the others get NULL.
pub type ResultPointers = [bool; 4];

/// The results of `fmi3DoStep`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepResults {
    /// `eventHandlingNeeded`, as a byte.
    pub event: u8,
    /// `terminateSimulation`, as a byte.
    pub terminate: u8,
    /// `earlyReturn`, as a byte.
    pub early: u8,
    /// `lastSuccessfulTime`.
    pub last: f64,
}

impl fmt::Display for StepResults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flags = [
            ("eventHandlingNeeded", self.event.into()),
            ("terminateSimulation", self.terminate.into()),
            ("earlyReturn", self.early.into()),
        ];
        list(f, &flags, ("lastSuccessfulTime", self.last))
    }
}

/// The results of an update of the discrete states; the flags as the FMU wrote them, 0xc5 where it did not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateResults {
    /// `newDiscreteStatesNeeded`, `discreteStatesNeedUpdate`.
    pub again: i32,
    /// `terminateSimulation`.
    pub terminate: i32,
    /// `nominalsOfContinuousStatesChanged`.
    pub nominals_changed: i32,
    /// `valuesOfContinuousStatesChanged`.
    pub states_changed: i32,
    /// `nextEventTimeDefined`.
    pub next_event_time_defined: i32,
    /// `nextEventTime`, NaN where the FMU did not write it.
    pub next_event_time: f64,
}

impl fmt::Display for UpdateResults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flags = [
            ("another update needed", self.again),
            ("terminateSimulation", self.terminate),
            ("nominalsOfContinuousStatesChanged", self.nominals_changed),
            ("valuesOfContinuousStatesChanged", self.states_changed),
            ("nextEventTimeDefined", self.next_event_time_defined),
        ];
        list(f, &flags, ("nextEventTime", self.next_event_time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_written_has_no_value() {
        let results = StepResults { event: UNTOUCHED, terminate: 0, early: 1, last: UNTOUCHED_NUMBER };
        let text =
            "eventHandlingNeeded=(not written), terminateSimulation=0, earlyReturn=1, lastSuccessfulTime=(not written)";
        assert_eq!(results.to_string(), text);
        assert_eq!((number_text(f64::NAN), number_text(0.5), flag_text(2)), ("NaN".into(), "0.5".into(), "2".into()));
        assert!(UNTOUCHED_NUMBER.is_nan());
    }
}
