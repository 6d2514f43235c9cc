//! Whether a communication step continues the simulation (FMI 2.0.5, 4.2.2; FMI 3.0.2, 4.2.1).

use crate::snapshot::{Experiment, Snapshot};
use fmu_core::{Elapsed, Fault, Model};

impl<M: Model> Snapshot<M> {
    /// Checks a step from `t` by `h`, which reaches `next` after the start.
    ///
    /// # Errors
    /// Names the invalid argument and the expected value.
    #[inline]
    pub(crate) fn check_step(&self, t: f64, h: f64, next: Elapsed) -> Result<(), Fault> {
        let end = t + h;
        // None of these comparisons is true for NaN; a subnormal h is below the resolution of any time except 0.
        let advances = h >= f64::MIN_POSITIVE && end > t && end < f64::INFINITY;
        if !(advances && self.continues(t, h)) {
            return Err(self.misplaced(t, h));
        }
        match self.experiment {
            Some(Experiment { start, stop: Some(stop) }) if end > stop => {
                // Our own sum does not drift; the importer's may, and it may cut its last step to meet the stop time.
                let reached = (start + next.seconds()).min(end);
                if reached > stop + 1e-9 * h + rounding(stop) { Err(beyond(t, h, stop)) } else { Ok(()) }
            }
            _ => Ok(()),
        }
    }

    /// Whether the step begins where the last one ended.
    #[inline]
    fn continues(&self, t: f64, h: f64) -> bool {
        (t - self.end).abs() <= h / 100.0 + rounding(t)
    }

    #[cold]
    fn misplaced(&self, t: f64, h: f64) -> Fault {
        let positive = (f64::MIN_POSITIVE..f64::INFINITY).contains(&h);
        if positive { point(t, h, self.end) } else { size(h) }
    }
}

/// Largest rounding error of two additions at this magnitude.
fn rounding(t: f64) -> f64 {
    2.0 * f64::EPSILON * t.abs()
}

#[cold]
fn size(h: f64) -> Fault {
    Fault::value("communicationStepSize", h, "finite and greater than 0")
}

#[cold]
fn point(t: f64, h: f64, end: f64) -> Fault {
    let allowed = format!("the last step ended at {end}, and a step of {h} may begin at most {} away", h / 100.0);
    if (t - end).abs() <= h / 100.0 {
        return Fault::new(format!("a step of {h} does not advance the time {t}"));
    }
    Fault::value("currentCommunicationPoint", t, allowed)
}

#[cold]
fn beyond(t: f64, h: f64, stop: f64) -> Fault {
    Fault::new(format!("a step of {h} from {t} goes beyond the stop time {stop}"))
}
