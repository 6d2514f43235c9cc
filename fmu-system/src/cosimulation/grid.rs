//! Communication points, counted in integers.

use super::schedule::SAME;
use fmu_import::limits::STEPS;

/// Start, stop and step of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Start time in s.
    pub start: f64,
    /// Stop time in s.
    pub stop: f64,
    /// Communication step in s. When it does not divide the time, the last step is shorter.
    pub step: f64,
    /// Step the FMUs one after another; each receives the new outputs of those before it.
    pub sequential: bool,
}

/// Initial steps of another length than in the settings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CoarseSteps {
    /// Their number.
    pub steps: u32,
    /// Length in s.
    pub step: f64,
}

/// An event this close before a communication point, as a share of the step, counts as at that point.
pub(super) const EARLY: f64 = 0.01;

/// The communication points of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    settings: Settings,
    steps: u32,
    /// Longer steps at the beginning.
    approach: CoarseSteps,
    /// Relative tolerance for the solvers inside the FMUs; by default the tolerance of each default experiment.
    pub(super) tolerance: Option<f64>,
    /// Steps end where inputs jump.
    pub(super) meets: bool,
    /// States are saved before each step, for FMUs that discard one.
    pub(super) careful: bool,
}

impl Settings {
    pub(super) fn grid(&self) -> Result<Grid, String> {
        let Self { start, stop, step, .. } = *self;
        if ![start, stop, step].iter().all(|x| x.is_finite()) {
            return Err(format!("start {start}, stop {stop} and step {step} must be finite"));
        }
        if stop <= start {
            return Err(format!("the stop time of {stop} s must be after the start time of {start} s"));
        }
        if step <= 0.0 {
            return Err(format!("the step of {step} s must be positive"));
        }
        let count = (stop - start) / step;
        // A millionth of a step is rounding, more is a shorter last step.
        let whole = if (count - count.round()).abs() < 1e-6 * count.max(1.0) { count.round() } else { count.ceil() };
        if whole < 1.0 {
            let duration = stop - start;
            return Err(format!(
                "the step {step:e} s is longer than the simulation of {duration} s; give a shorter one"
            ));
        }
        if whole > f64::from(u32::try_from(STEPS.most).unwrap_or(u32::MAX)) {
            return Err(format!(
                "a step of {step} s from {start} s to {stop} s {}",
                STEPS.exceeded(format!("{whole:e}"))
            ));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "an integer in the range, see above"
        )]
        let steps = whole as u32;
        Ok(Grid {
            settings: *self,
            steps,
            approach: CoarseSteps::default(),
            tolerance: None,
            meets: false,
            careful: false,
        })
    }
}

impl Grid {
    pub(super) fn settings(&self) -> &Settings {
        &self.settings
    }

    pub(super) fn steps(&self) -> u32 {
        self.steps
    }

    /// The grid after steps of another length, from `start` (s) on.
    pub(super) fn after_approach(self, approach: CoarseSteps, start: f64) -> Self {
        let Self { settings, steps, .. } = self;
        Self { settings: Settings { start, ..settings }, steps: steps + approach.steps, approach, ..self }
    }

    /// Time of point `k`; never summed up.
    pub(super) fn time(&self, k: u32) -> f64 {
        let (Settings { start, stop, step, .. }, before) = (self.settings, self.approach);
        if k == self.steps {
            stop
        } else if k <= before.steps {
            start + f64::from(k) * if before.steps > 0 { before.step } else { step }
        } else {
            start + (f64::from(before.steps) * before.step + f64::from(k - before.steps) * step)
        }
    }

    /// The communication point after the time `t` (s), if `t` lies within the simulation and is not a communication point.
    pub(super) fn after(&self, t: f64) -> Option<f64> {
        let Settings { start, stop, step, .. } = self.settings;
        let nearest = start + ((t - start) / step).round() * step;
        let inside = t > start && t < stop && (t - nearest).abs() > SAME;
        let next = (start + ((t - start) / step).ceil() * step).min(stop);
        (inside && next - t > EARLY * step).then_some(next)
    }

    /// The settings up to the last whole step, if the last one is shorter.
    pub(super) fn without_short_step(&self) -> Option<Settings> {
        let last = self.steps - 1;
        (self.size(last) < self.settings.step).then(|| Settings { stop: self.time(last), ..self.settings })
    }

    /// Size of the step from point `k`: `step` itself, not the difference of two rounded times, except for a short last one.
    pub(super) fn size(&self, k: u32) -> f64 {
        if k < self.approach.steps {
            return self.approach.step;
        }
        let rest = self.settings.stop - self.time(k);
        if k + 1 == self.steps && (rest - self.settings.step).abs() > 1e-3 * self.settings.step {
            rest
        } else {
            self.settings.step
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact if nothing is rounded")]
mod tests {
    use super::*;

    fn grid(start: f64, stop: f64, step: f64) -> Result<Grid, String> {
        Settings { start, stop, step, sequential: false }.grid()
    }

    #[test]
    fn points_are_not_summed() {
        let g = grid(0.0, 1.0, 1e-4).unwrap();
        assert_eq!((g.steps(), g.time(3), g.time(10_000)), (10_000, 3.0 * 1e-4, 1.0));
        assert!((0..g.steps()).all(|k| g.size(k) == 1e-4));
    }

    #[test]
    fn long_steps_come_first() {
        let fine = grid(0.5, 0.6, 0.01).unwrap().after_approach(CoarseSteps { steps: 5, step: 0.1 }, 0.0);
        assert_eq!(fine.steps(), 15);
        assert_eq!([0, 1, 5, 6, 15].map(|k| fine.time(k)), [0.0, 0.1, 0.5, 0.51, 0.6]);
        assert_eq!([0, 4, 5, 14].map(|k| fine.size(k)), [0.1, 0.1, 0.01, 0.01]);
    }

    #[test]
    fn the_last_step_may_be_short() {
        let g = grid(1.0, 2.0, 0.3).unwrap();
        assert_eq!((g.steps(), g.time(4)), (4, 2.0));
        assert!((g.size(3) - 0.1).abs() < 1e-12, "{}", g.size(3));
        assert_eq!(grid(0.0, 0.1, 0.3).unwrap().size(0), 0.1);
        assert_eq!([g.after(1.31), g.after(1.6), g.after(1.95), g.after(2.5)], [Some(1.6), None, Some(2.0), None]);
        assert_eq!(g.without_short_step().unwrap().stop, 1.0 + 3.0 * 0.3);
        assert_eq!(grid(0.0, 1.0, 0.1).unwrap().without_short_step(), None);
    }

    #[test]
    fn nonsense_is_refused() {
        for (start, stop, step) in
            [(0.0, 0.0, 0.1), (0.0, 1.0, 0.0), (0.0, 1.0, -1.0), (0.0, f64::NAN, 0.1), (0.0, 1e9, 1e-9)]
        {
            assert!(grid(start, stop, step).is_err(), "{start} {stop} {step}");
        }
        let refused = |step| grid(2.0, 3.0, step).unwrap_err();
        assert_eq!(refused(1e308), "the step 1e308 s is longer than the simulation of 1 s; give a shorter one");
        assert!(refused(1e-10).ends_with("takes 1e10 steps; the limit is 2147483648"), "{}", refused(1e-10));
    }
}
