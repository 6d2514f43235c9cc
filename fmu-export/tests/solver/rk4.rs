//! The ball's motion by the classical Runge-Kutta method, with events where they are.

use super::ball::*;
use super::{Fmu, OK};

/// Runs to `stop`; returns the times of the ticks and the number of bounces. Each time event comes `late` by this share.
pub fn solve(fmu: &Fmu, mut t: f64, stop: f64, next: Option<f64>, late: f64) -> (Vec<f64>, i32) {
    let (mut next, mut ticks) = (next, Vec::new());
    while t < stop {
        let event = next.map_or(f64::INFINITY, |next| next * (1.0 + late));
        let end = stop.min(event).min(t + 1e-3);
        let (h, x) = (end - t, fmu.states::<2>());
        let before = fmu.indicators::<1>()[0] > 0.0;
        rk4(fmu, t, h, x);
        let crossed = || (fmu.indicators::<1>()[0] > 0.0) != before;
        let mut at = end;
        if crossed() {
            let (mut low, mut high) = (0.0, h);
            while high - low > 1e-13 {
                let middle = f64::midpoint(low, high);
                rk4(fmu, t, middle, x);
                *(if crossed() { &mut high } else { &mut low }) = middle;
            }
            rk4(fmu, t, high, x);
            at = t + high;
        }
        assert_eq!(fmu.completed(), OK);
        if at < end || end == event {
            assert_eq!(fmu.event(), OK);
            let (before, held) = (fmu.states::<2>(), fmu.get(HELD));
            let (changed, update) = fmu.settle();
            assert_eq!(changed, before != fmu.states(), "valuesOfContinuousStatesChanged");
            assert!(update.next.unwrap() > at, "{:?} after {at}", update.next);
            if held != fmu.get(HELD) {
                ticks.push(at);
            }
            next = update.next;
            assert_ne!(fmu.indicators(), [0.0]);
            assert_eq!(fmu.leave(), OK);
        }
        t = at;
    }
    (ticks, fmu.get_integer(BOUNCES))
}

fn rk4(fmu: &Fmu, t: f64, h: f64, x: [f64; 2]) {
    let mut sum = [0.0; 2];
    let mut k = [0.0; 2];
    for (at, weight) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
        assert_eq!((fmu.set_time(t + at * h), fmu.set_states(&[x[0] + at * h * k[0], x[1] + at * h * k[1]])), (OK, OK));
        assert_eq!(fmu.set(&[U], &[(t + at * h).sin()]), OK);
        k = fmu.derivatives();
        sum = [sum[0] + weight * k[0], sum[1] + weight * k[1]];
    }
    let end = [x[0] + h / 6.0 * sum[0], x[1] + h / 6.0 * sum[1]];
    assert_eq!((fmu.set_time(t + h), fmu.set_states(&end)), (OK, OK));
}
