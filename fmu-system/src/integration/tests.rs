//! Systems in plain Rust that implement the same trait as the adapter of FMUs.

use super::*;
use fmu_import::{CompletedStep, Error, Update};
use std::f64::consts::{LN_2, PI};

/// A system of closures; `event` handles an event at a time and a state.
struct Plain<F, Z, E> {
    nominals: Vec<f64>,
    indicators: usize,
    f: F,
    z: Z,
    event: E,
    evaluations: usize,
    discards: usize,
    calls: usize,
}

impl<F, Z, E> Plain<F, Z, E> {
    /// A run of these systems makes at most some million calls: an endless loop of an integrator ends here instead of hanging.
    fn count(&mut self) {
        self.calls += 1;
        assert!(self.calls < 5_000_000, "the integrator makes an endless number of calls");
    }
}

impl<F, Z, E> HybridSystem for Plain<F, Z, E>
where
    F: FnMut(f64, &[f64], &mut [f64]) -> bool,
    Z: FnMut(f64, &[f64], &mut [f64]),
    E: FnMut(f64, &mut [f64]) -> Update,
{
    fn nominals(&self) -> &[f64] {
        &self.nominals
    }

    fn name(&self, _: f64) -> String {
        "plain".into()
    }

    fn indicator_count(&self) -> usize {
        self.indicators
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), TrialError> {
        self.count();
        self.evaluations += 1;
        if (self.f)(t, x, dx) {
            return Ok(());
        }
        self.discards += 1;
        Err(TrialError::Discard(Error::usage("plain", "out of range")))
    }

    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<(), TrialError> {
        self.count();
        (self.z)(t, x, z);
        Ok(())
    }

    fn completed_step(&mut self, _: f64, _: &[f64]) -> Result<CompletedStep, Error> {
        self.count();
        Ok(CompletedStep::default())
    }

    fn event(&mut self, t: f64, x: &mut [f64]) -> Result<Update, Error> {
        self.count();
        Ok((self.event)(t, x))
    }
}

/// A system without indicators, which begins at `x`.
fn smooth(x: Vec<f64>, f: impl FnMut(f64, &[f64], &mut [f64]) -> bool) -> impl HybridSystem {
    Plain {
        nominals: vec![1.0; x.len()],
        indicators: 0,
        f,
        z: |_, _: &[f64], _: &mut [f64]| {},
        event: move |_, to: &mut [f64]| {
            to.copy_from_slice(&x);
            Update::default()
        },
        evaluations: 0,
        discards: 0,
        calls: 0,
    }
}

/// x' = v, v' = -x from (1, 0): a cosine.
fn oscillator() -> impl HybridSystem {
    smooth(vec![1.0, 0.0], |_, x, dx| {
        dx.copy_from_slice(&[x[1], -x[0]]);
        true
    })
}

fn error_at_1(solver: Solver, h: f64) -> f64 {
    let mut system = oscillator();
    let mut driver = Driver::start(&mut system, solver, h, 0.0).unwrap().0;
    assert!(driver.run_to(&mut system, 1.0).unwrap().is_continue());
    let (t, x) = driver.point();
    assert!((t - 1.0).abs() < 1e-14);
    (x[0] - 1_f64.cos()).abs().max((x[1] + 1_f64.sin()).abs())
}

#[test]
fn rk4_has_order_4() {
    let errors = [0.1, 0.05, 0.025].map(|h| error_at_1(Solver::Rk4, h));
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 4.0).abs() < 0.1, "{errors:?}");
    }
}

#[test]
fn dormand_prince_has_order_5_and_its_dense_output_order_4() {
    let errors = [0.2, 0.1, 0.05].map(|h| {
        let mut step = steps::Step::new(2);
        (step.t, step.t_end, step.x, step.f) = (0.0, h, vec![1.0, 0.0], vec![0.0, -1.0]);
        assert!(dopri::step(&mut oscillator(), &mut step).is_ok());
        let mut x = [0.0; 2];
        dopri::interpolate(&step, 0.3, &mut x);
        ((step.x_end[0] - h.cos()).abs(), (x[0] - (0.3 * h).cos()).abs())
    });
    for pair in errors.windows(2) {
        // Of one step: the order of convergence plus one, and one more, since odd powers are missing.
        let (end, between) = ((pair[0].0 / pair[1].0).log2(), (pair[0].1 / pair[1].1).log2());
        assert!(end > 5.8 && between > 4.8, "{end} {between}: {errors:?}");
    }
}

#[test]
fn both_interpolants_meet_the_ends_with_their_slopes() {
    for (step_once, interpolate) in [
        (
            rk4::step as fn(&mut Oscillator, &mut steps::Step) -> Result<(), TrialError>,
            rk4::interpolate as fn(&steps::Step, f64, &mut [f64]),
        ),
        (dopri::step, dopri::interpolate),
    ] {
        let mut step = steps::Step::new(2);
        (step.t, step.t_end, step.x, step.f) = (1.0, 1.5, vec![1.0, 0.0], vec![0.0, -1.0]);
        assert!(step_once(&mut Oscillator, &mut step).is_ok());
        let (mut x, mut near, d) = ([0.0; 2], [0.0; 2], 1e-6);
        for (theta, at, slope, inside) in [(0.0, &step.x, &step.f, d), (1.0, &step.x_end, &step.f_end, -d)] {
            interpolate(&step, theta, &mut x);
            interpolate(&step, theta + inside, &mut near);
            for i in 0..2 {
                assert!((x[i] - at[i]).abs() < 1e-15, "{theta}: {x:?}");
                let found = (near[i] - x[i]) / (0.5 * inside);
                assert!((found - slope[i]).abs() < 1e-5, "{theta}: {found} {}", slope[i]);
            }
        }
    }
}

/// The oscillator as a type.
struct Oscillator;

impl HybridSystem for Oscillator {
    fn nominals(&self) -> &[f64] {
        &[1.0, 1.0]
    }

    fn name(&self, _: f64) -> String {
        "plain".into()
    }

    fn indicator_count(&self) -> usize {
        0
    }

    fn derivatives(&mut self, _: f64, x: &[f64], dx: &mut [f64]) -> Result<(), TrialError> {
        dx.copy_from_slice(&[x[1], -x[0]]);
        Ok(())
    }

    fn indicators(&mut self, _: f64, _: &[f64], _: &mut [f64]) -> Result<(), TrialError> {
        Ok(())
    }

    fn completed_step(&mut self, _: f64, _: &[f64]) -> Result<CompletedStep, Error> {
        Ok(CompletedStep::default())
    }

    fn event(&mut self, _: f64, _: &mut [f64]) -> Result<Update, Error> {
        Ok(Update::default())
    }
}

#[test]
fn the_adaptive_error_follows_the_tolerance() {
    for (rtol, allowed) in [(1e-4, 1e-3), (1e-7, 1e-6), (1e-10, 1e-9)] {
        let error = error_at_1(Solver::Dopri { rtol }, f64::NAN);
        assert!(error < allowed && error > 1e-4 * allowed, "{rtol}: {error}");
    }
}

/// A ball from a height of 1 m, as the Reference FMU BouncingBall: the time of every bounce is known.
#[test]
fn a_ball_bounces_at_the_right_times() {
    const G: f64 = 9.81;
    const E: f64 = 0.7;
    for (solver, tolerance) in [(Solver::Rk4, 1e-10), (Solver::Dopri { rtol: 1e-8 }, 1e-10)] {
        let (mut begun, mut bounces) = (false, Vec::new());
        let mut system = Plain {
            nominals: vec![1.0; 2],
            indicators: 1,
            f: |_, x: &[f64], dx: &mut [f64]| {
                dx.copy_from_slice(&[x[1], -G]);
                true
            },
            z: |_, x: &[f64], z: &mut [f64]| z[0] = x[0],
            event: |t, x: &mut [f64]| {
                if std::mem::replace(&mut begun, true) {
                    bounces.push(t);
                    x.copy_from_slice(&[f64::MIN_POSITIVE, -E * x[1]]);
                } else {
                    x.copy_from_slice(&[1.0, 0.0]);
                }
                Update { states_changed: true, ..Update::default() }
            },
            evaluations: 0,
            discards: 0,
            calls: 0,
        };
        let mut driver = Driver::start(&mut system, solver, 0.01, 0.0).unwrap().0;
        for k in 1..=250 {
            assert!(driver.run_to(&mut system, 0.01 * f64::from(k)).unwrap().is_continue());
            assert!(driver.point().1[0] >= 0.0);
        }
        let fall = (2.0 / G).sqrt();
        let mut expected = vec![fall];
        for n in 1..6 {
            expected.push(expected[n - 1] + 2.0 * fall * E.powi(i32::try_from(n).unwrap()));
        }
        for (found, expected) in bounces.iter().zip(&expected) {
            assert!((found - expected).abs() < tolerance, "{solver:?}: {found} {expected}");
        }
        assert!(bounces.len() >= 6, "{bounces:?}");
    }
}

/// Two indicators in one step: the earlier event is found, then the later one.
#[test]
fn the_first_of_several_events_comes_first() {
    let mut events = Vec::new();
    let mut system = Plain {
        nominals: Vec::new(),
        indicators: 2,
        f: |_, _: &[f64], _: &mut [f64]| true,
        z: |t: f64, _: &[f64], z: &mut [f64]| z.copy_from_slice(&[LN_2 - t, 0.3 - t]),
        event: |t, _: &mut [f64]| {
            events.push(t);
            Update::default()
        },
        evaluations: 0,
        discards: 0,
        calls: 0,
    };
    let mut driver = Driver::start(&mut system, Solver::default(), 1.0, 0.0).unwrap().0;
    assert!(driver.run_to(&mut system, 1.0).unwrap().is_continue());
    assert_eq!(events.len(), 3, "{events:?}");
    assert!((events[1] - 0.3).abs() < 1e-9 && (events[2] - LN_2).abs() < 1e-9, "{events:?}");
    assert!(events[1] >= 0.3 && events[2] >= LN_2, "an event is behind its crossing: {events:?}");
}

/// Location takes few evaluations, and at most three times as many as bisection (34) if the indicator is flat or jumps.
#[test]
fn location_is_fast_and_sure() {
    for (name, z, most) in [
        ("straight", (|t| 0.3 - t) as fn(f64) -> f64, 8),
        ("curved", |t| (-5.0 * t).exp() - 0.2, 15),
        ("steep", |t| (0.3 - t).powi(9), 102),
        ("step", |t| if t < 0.3 { 1e-12 } else { -1.0 }, 102),
    ] {
        let (mut count, root) = (0, if name == "curved" { 5_f64.ln() / 5.0 } else { 0.3 });
        let found = locate::first_crossing(&[z(0.0)], &[z(1.0)], 1e-10, |t, to| {
            count += 1;
            to[0] = z(t);
            Ok(())
        });
        let found = found.unwrap();
        assert!(
            (0.0..=1e-10).contains(&(found - root)) && count <= most,
            "{name}: {count} evaluations, {}",
            found - root
        );
    }
}

/// Time events are hit exactly, even one that differs from a communication point only by rounding.
#[test]
fn time_events_are_exact() {
    let (mut k, mut events) = (0, Vec::new());
    let mut system = Plain {
        nominals: vec![1.0],
        indicators: 0,
        f: |_, _: &[f64], dx: &mut [f64]| {
            dx[0] = 1.0;
            true
        },
        z: |_, _: &[f64], _: &mut [f64]| {},
        event: |t, x: &mut [f64]| {
            events.push((t, x[0]));
            k += 1;
            Update { next_event_time: Some(0.1_f64.mul_add(f64::from(k), 0.0)), ..Update::default() }
        },
        evaluations: 0,
        discards: 0,
        calls: 0,
    };
    let mut driver = Driver::start(&mut system, Solver::Rk4, 0.3, 0.0).unwrap().0;
    for point in [0.3, 0.6, 0.7, 1.0] {
        assert!(driver.run_to(&mut system, point).unwrap().is_continue());
    }
    assert_eq!(events.len(), 11);
    for (k, (t, x)) in (0_u32..).zip(&events) {
        assert_eq!(t.to_bits(), (0.1 * f64::from(k)).to_bits());
        assert!((x - t).abs() < 1e-15);
    }
}

/// A point that the system cannot compute is tried with a shorter step; if no step helps, the run ends with its message.
#[test]
fn discarded_steps_are_halved() {
    // Up to t = 1 the root is real.
    let mut system = smooth(vec![0.0], |t, _, dx| {
        dx[0] = if t <= 1.0 { -PI * (1.0 - t).sqrt() } else { f64::NAN };
        t <= 1.0
    });
    let mut driver = Driver::start(&mut system, Solver::Rk4, 0.6, 0.0).unwrap().0;
    let error = driver.run_to(&mut system, 2.0).unwrap_err().to_string();
    let (t, x) = driver.point();
    assert!(error.starts_with(&format!("plain: every step from t = {t} s, down to ")), "{error}");
    assert!(error.ends_with("e-16 s: out of range") && (t - 1.0).abs() < 1e-14, "{error}");
    assert!((x[0] + PI * 2.0 / 3.0).abs() < 2e-3, "{x:?}");
}

#[test]
fn events_without_end_are_an_error() {
    let mut system = Plain {
        nominals: Vec::new(),
        indicators: 0,
        f: |_, _: &[f64], _: &mut [f64]| true,
        z: |_, _: &[f64], _: &mut [f64]| {},
        event: |t, _: &mut [f64]| Update { next_event_time: Some(t), ..Update::default() },
        evaluations: 0,
        discards: 0,
        calls: 0,
    };
    let mut driver = Driver::start(&mut system, Solver::Rk4, 1.0, 0.5).unwrap().0;
    let error = driver.run_to(&mut system, 1.0).unwrap_err().to_string();
    assert_eq!(error, "plain: more than 100 events at t = 0.5 s; the next event time is 0.5 s");
}

/// An oscillator with a third state that follows a cosine as fast as `fast` (1/s), and its calls of [`HybridSystem::limited`].
struct Following {
    fast: f64,
    limited: Vec<(f64, f64)>,
}

impl HybridSystem for Following {
    fn nominals(&self) -> &[f64] {
        &[1.0, 1.0, 1e-3]
    }

    fn name(&self, _: f64) -> String {
        "following".into()
    }

    fn indicator_count(&self) -> usize {
        0
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), TrialError> {
        dx.copy_from_slice(&[x[1], -x[0], self.fast * (1e-3 * t.cos() - x[2])]);
        Ok(())
    }

    fn indicators(&mut self, _: f64, _: &[f64], _: &mut [f64]) -> Result<(), TrialError> {
        Ok(())
    }

    fn completed_step(&mut self, _: f64, _: &[f64]) -> Result<CompletedStep, Error> {
        Ok(CompletedStep::default())
    }

    fn event(&mut self, _: f64, x: &mut [f64]) -> Result<Update, Error> {
        x.copy_from_slice(&[1.0, 0.0, 0.0]);
        Ok(Update::default())
    }

    fn limited(&mut self, t: f64, h: f64) {
        self.limited.push((t, h));
    }
}

#[test]
fn stability_that_limits_the_steps_is_reported_once_and_early() {
    // The eigenvalue of the fast state, the tolerance, and whether the error or stability limits the steps.
    for (fast, rtol, is_stiff) in [(1e4, 1e-6, true), (1e4, 1e-4, true), (1.0, 1e-6, false), (1.0, 1e-12, false)] {
        let mut system = Following { fast, limited: Vec::new() };
        let mut driver = Driver::start(&mut system, Solver::Dopri { rtol }, f64::NAN, 0.0).unwrap().0;
        let until = if is_stiff { 1.0 } else { 100.0 };
        assert!(driver.run_to(&mut system, until).unwrap().is_continue());
        assert_eq!(system.limited.len(), usize::from(is_stiff), "{fast} {rtol}");
        for (t, h) in system.limited {
            // The steps vary around the boundary of stability, 3.31 on the negative real axis.
            assert!(t < 0.8 && (2.5..5.0).contains(&(h * fast)), "{t} {h}");
        }
    }
}

#[test]
fn a_run_with_many_steps_left_gets_advice() {
    assert_eq!(advice(0.5, 1e-3, 10.5), None);
    let advice = advice(0.5, 1e-3, 1e8).unwrap();
    assert!(advice.contains("to 1.0e-3 s") && advice.contains("to 100000000 s needs about 1e11"), "{advice}");
}

/// At a pace that would take hours, a run ends with an error; one of as many steps that arrives goes on.
#[test]
fn a_target_out_of_reach_is_an_error() {
    let evaluations = std::cell::Cell::new(0);
    let to = |w: f64, duration| {
        let mut system = smooth(vec![0.0], |t, _, dx: &mut [f64]| {
            evaluations.set(evaluations.get() + 1);
            dx[0] = w * (w * t).cos();
            true
        });
        let mut driver = Driver::start(&mut system, Solver::Dopri { rtol: 1e-6 }, 1.0, 0.25).unwrap().0;
        driver.run_to(&mut system, 0.25 + duration)
    };
    let error = to(1e11, 1.0).unwrap_err().to_string();
    assert!(error.starts_with("integration: 100000 steps from t = 0.25 s on lead only "), "{error}");
    assert!(error.contains("e-7 s further: ") && error.ends_with("too closely"), "{error}");
    evaluations.set(0);
    assert!(to(1e6, 0.2).unwrap().is_continue());
    assert!(evaluations.get() > 600_000, "{evaluations:?}");
}
