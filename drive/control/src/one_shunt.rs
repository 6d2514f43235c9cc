//! One shunt in the DC link: two phase currents per carrier period, read while an active vector lasts.
//!
//! A carrier period of one sample, with the min-max zero sequence, has the duty cycles d = 1/2 + (u + u_z) / u_dc, sorted here: d_1 >= d_2
//! >= d_3. While it falls, the legs switch off at the shares (1 + d)/2 of the period, the one of d_3 first:
//!
//! | from | to | current of the link | for |
//! |---|---|---|---|
//! | (1 + d_3)/2 | (1 + d_2)/2 | -i_3 | (d_2 - d_3)/2 of the period |
//! | (1 + d_2)/2 | (1 + d_1)/2 | i_1 | (d_1 - d_2)/2 |
//!
//! Each is read at the end of its vector, if that lasts at least `sensor.window`: dead time, ringing and the sampling of the converter.
//! Otherwise the phase keeps its last reading: near the borders of the sectors, and with little voltage all phases. The third current is
//! the negative sum of the two others. The mean current between two samples is taken as a straight line; the ripple at the instants of
//! the readings is not modeled. The reading of the link has the gain, the offset, the noise and the steps of phase a's sensor, so an offset
//! adds to i_1 and subtracts from i_3. i in A, u in V.

use crate::sensor::Sensor;
use drive_base::frame::{AlphaBeta, Phases};
use serde::{Deserialize, Serialize};

/// What the shunt has shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct OneShunt {
    /// True currents at the last sample in A.
    before: AlphaBeta,
    /// Reconstructed currents in A.
    seen: AlphaBeta,
}

impl OneShunt {
    /// Reads the shunt in the period of `T_s` (s) that ends at sample `k` with the currents `i` (A), under the voltage `u` (V) on the
    /// link voltage `u_dc` (V). Without a voltage from the inverter (`None`), no current is known.
    pub(super) fn read(&mut self, sensor: &Sensor, i: Phases, k: u64, T_s: f64, applied: Option<(Phases, f64)>) {
        let before = Phases::from_stator(std::mem::replace(&mut self.before, i.to_stator()));
        let last = self.currents();
        self.seen = AlphaBeta::ZERO;
        let Some((u, u_dc)) = applied else { return };
        let (u, then, now) = ([u.a, u.b, u.c], [before.a, before.b, before.c], [i.a, i.b, i.c]);
        let mut order = [0, 1, 2];
        order.sort_by(|&x, &y| u[y].total_cmp(&u[x]));
        let [first, second, third] = order;
        let middle = 0.5 * (u[first] + u[third]);
        let duty = |x: usize| if u_dc > 0.0 { (0.5 + (u[x] - middle) / u_dc).clamp(0.0, 1.0) } else { 0.5 };
        let at = |x: usize, share: f64| then[x] + (now[x] - then[x]) * share;
        // The readings of both vectors have separate noise.
        let reading = |i: f64, of: u64| sensor.measure(Phases { a: i, ..Phases::default() }, 2 * k + of).a;
        let mut seen = [last.a, last.b, last.c];
        let lasts = |from: usize, to: usize| 0.5 * T_s * (duty(to) - duty(from)) >= sensor.window;
        let (of_third, of_first) = (lasts(third, second), lasts(second, first));
        if of_third {
            seen[third] = -reading(-at(third, 0.5 * (1.0 + duty(second))), 0);
        }
        if of_first {
            seen[first] = reading(at(first, 0.5 * (1.0 + duty(first))), 1);
        }
        // The phase that is neither read nor needed follows from the sum.
        match (of_first, of_third) {
            (true, true) => seen[second] = -seen[first] - seen[third],
            (true, false) => seen[third] = -seen[first] - seen[second],
            (false, true) => seen[first] = -seen[second] - seen[third],
            (false, false) => {}
        }
        let [a, b, c] = seen;
        self.seen = Phases { a, b, c }.to_stator();
    }

    /// The reconstructed currents in A.
    pub(super) fn currents(&self) -> Phases {
        Phases::from_stator(self.seen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::MeasuredPhases;

    const T_S: f64 = 1e-4;

    fn sensor(window: f64) -> Sensor {
        Sensor { phases: MeasuredPhases::One, window, ..Sensor::default() }
    }

    /// Before a period that begins with the currents `i` (A).
    fn at(i: Phases) -> OneShunt {
        OneShunt { before: i.to_stator(), ..OneShunt::default() }
    }

    fn near(found: Phases, expected: [f64; 3]) {
        let found = [found.a, found.b, found.c];
        assert!(found.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-12), "{found:?}, not {expected:?}");
    }

    /// Constant currents are seen as they are, in each of the six sectors; currents that change, at the ends of the active vectors.
    #[test]
    fn both_readings_are_at_the_ends_of_their_vectors() {
        let constant = Phases { a: 3.0, b: -1.0, c: -2.0 };
        for sector in 0..6 {
            let angle = (30.0 + 60.0 * f64::from(sector)).to_radians() + 0.1;
            let u = |shift: f64| 90.0 * (angle - shift.to_radians()).cos();
            let u = Phases { a: u(0.0), b: u(120.0), c: u(240.0) };
            let mut shunt = at(constant);
            shunt.read(&sensor(0.0), constant, 0, T_S, Some((u, 300.0)));
            near(shunt.currents(), [3.0, -1.0, -2.0]);
        }
        // d = 0.8, 0.4, 0.2: read at the shares 0.7 for c and 0.9 for a.
        let mut shunt = at(constant);
        let u = Phases { a: 100.0, b: -20.0, c: -80.0 };
        shunt.read(&sensor(0.0), Phases { a: 4.0, b: 0.0, c: -4.0 }, 0, T_S, Some((u, 300.0)));
        near(shunt.currents(), [3.9, -0.5, -3.4]);
    }

    /// A vector that is too short keeps the last reading of its phase, and the current that both leave follows from the sum.
    #[test]
    fn a_short_vector_is_not_read() {
        let last = Phases { a: 3.0, b: -1.0, c: -2.0 };
        let i = Phases { a: 4.0, b: -1.5, c: -2.5 };
        let read = |u: Phases| {
            let mut shunt = OneShunt { seen: last.to_stator(), ..at(i) };
            shunt.read(&sensor(3e-6), i, 0, T_S, Some((u, 300.0)));
            shunt.currents()
        };
        // d_1 - d_2 = 0.05: 2.5 us.
        near(read(Phases { a: 60.0, b: 45.0, c: -60.0 }), [3.5, -1.0, -2.5]);
        near(read(Phases { a: 60.0, b: -45.0, c: -60.0 }), [4.0, -1.0, -3.0]);
        near(read(Phases { a: 3.0, b: 0.0, c: -3.0 }), [3.0, -1.0, -2.0]);
    }

    #[test]
    fn an_offset_has_both_signs() {
        let mut sensor = sensor(0.0);
        (sensor.gain.a, sensor.offset.a) = (1.1, 0.2);
        let i = Phases { a: 1.0, b: 0.0, c: -1.0 };
        let mut shunt = at(i);
        shunt.read(&sensor, i, 0, T_S, Some((Phases { a: 90.0, b: 0.0, c: -90.0 }, 300.0)));
        near(shunt.currents(), [1.3, 0.0, -1.3]);
        shunt.read(&sensor, i, 1, T_S, None);
        near(shunt.currents(), [0.0; 3]);
    }
}
