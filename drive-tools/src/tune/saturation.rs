//! The saturation of a machine's file over the currents in use: the minimum incremental inductance, and whether the polynomial is
//! still physical there.
//!
//! The current is a polynomial of the flux linkage. It describes a real machine as long as its derivative, the inverse of the
//! incremental inductances, is positive definite; beyond that, more flux would require less current, and the plant diverges.

use super::flux_map::Fitted;
use super::motor::{Data, Located, MotorFile, electrical};
use crate::error::{Result, bail};
use drive::frame::Dq;
use drive::motor::Motor;
use drive::plant::machine::{self, Magnetics};
use drive::plant::saturation::Saturation;
use std::f64::consts::TAU;

/// Number of directions of the current.
const DIRECTIONS: u32 = 72;

fn of(data: &Data) -> Saturation {
    let value = |x: &Option<Located>| x.as_ref().map_or(0.0, |x| *x.get_ref());
    data.saturation.as_ref().map_or_else(Saturation::default, |s| Saturation {
        s_2: value(&s.s_2),
        s_3: value(&s.s_3),
        s_dq: value(&s.s_dq),
    })
}

/// The flux linkages (Wb) from the magnet's outward in one direction, at which the current is at most `i` (A).
fn outward<'a>(motor: &'a Motor, saturation: &'a Saturation, i: f64, direction: u32) -> impl Iterator<Item = Dq> + 'a {
    let (sin, cos) = (TAU * f64::from(direction) / f64::from(DIRECTIONS)).sin_cos();
    let step = i * motor.L_d.max(motor.L_q) / 200.0;
    (0..=400_u32)
        .map(move |k| Dq::new(motor.psi_M + f64::from(k) * step * cos, f64::from(k) * step * sin))
        .take_while(move |&psi| machine::current(motor, Magnetics::Polynomial(saturation), psi).magnitude() <= i)
}

/// The smallest incremental inductance in H of the plant, which may have a map, with a current of `i` (A) in any direction.
pub fn least_inductance(data: &Data, fitted: Option<&Fitted>, i: f64) -> f64 {
    let (mut motor, saturation) = (electrical(data), of(data));
    let magnetics = match fitted {
        Some(Fitted { map, psi_M, .. }) => {
            motor.psi_M = *psi_M;
            Magnetics::Map(map)
        }
        None => Magnetics::Polynomial(&saturation),
    };
    let at = |angle: f64| {
        let psi = |r: f64| Dq::new(motor.psi_M + r * angle.cos(), r * angle.sin());
        let (mut low, mut high) = (0.0, i * motor.L_d.max(motor.L_q));
        for _ in 0..50 {
            let r = 0.5 * (low + high);
            let above = machine::current(&motor, magnetics, psi(r)).magnitude() > i;
            *(if above { &mut high } else { &mut low }) = r;
        }
        machine::least_inductance(&motor, magnetics, psi(low))
    };
    (0..DIRECTIONS).map(|k| at(f64::from(k) * TAU / f64::from(DIRECTIONS))).fold(f64::INFINITY, f64::min)
}

/// Checks that the saturation is physical up to the maximum current.
///
/// # Errors
/// The coefficients, the current at which they fail, and the remedy.
pub fn check(motor: &MotorFile) -> Result<()> {
    let Some(given) = &motor.data.saturation else { return Ok(()) };
    let (machine, saturation) = (electrical(&motor.data), of(&motor.data));
    let limit = *motor.data.rating.current.get_ref();
    let current = |psi: Dq| machine::current(&machine, Magnetics::Polynomial(&saturation), psi);
    for psi in (0..DIRECTIONS).flat_map(|k| outward(&machine, &saturation, limit, k)) {
        let h = 1e-4 * machine.psi_M;
        let by = |step: Dq| (current(psi + step) - current(psi - step)) * (0.5 / h);
        let (by_d, by_q) = (by(Dq::new(h, 0.0)), by(Dq::new(0.0, h)));
        if by_d.d() * by_q.q() - by_q.d() * by_d.q() <= 0.0 || by_d.d() <= 0.0 {
            let i = current(psi);
            let Saturation { s_2, s_3, s_dq } = saturation;
            let first = [&given.s_2, &given.s_3, &given.s_dq].into_iter().flatten().next();
            bail!(
                "{}: with saturation.s_2 = {s_2}, s_3 = {s_3}, s_dq = {s_dq}, more flux takes less current from ({:.2}, {:.2}) A \
                 on; up to rating.current = {limit} A, the inductances must stay positive: lower s_2 and s_dq, or raise s_3",
                first.map_or_else(|| motor.place_at(0), |x| motor.place(x)),
                i.d(),
                i.q()
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn ipmsm(from: &str, to: &str) -> MotorFile {
        let text = include_str!("../../../motors/ipmsm-2.2kw.toml");
        assert!(text.contains(from), "{from}");
        MotorFile::parse(&text.replacen(from, to, 1), Path::new("m.toml")).unwrap()
    }

    #[test]
    fn the_least_inductance_is_on_the_side_of_the_magnet() {
        let data = ipmsm("s_2 = 40.0", "s_2 = 40.0").data;
        assert!((least_inductance(&data, None, 1e-9) - 36e-3).abs() < 1e-9);
        // On the d-axis, 0.2277 Wb in excess of the magnet's flux takes 8.87 A.
        let found = 1e3 * least_inductance(&data, None, 8.87);
        assert!((found - 19.151).abs() < 0.05, "{found} mH");
    }

    #[test]
    fn a_polynomial_that_is_no_machine_is_refused() {
        check(&ipmsm("s_3 = 40.0", "s_3 = 40.0\ns_dq = 10.0")).unwrap();
        for (from, to, message) in [
            ("s_3 = 40.0", "s_3 = 40.0\ns_dq = 40.0", "s_dq = 40, more flux takes less current"),
            ("s_2 = 40.0", "s_2 = 400.0", "s_2 = 400, s_3 = 40"),
        ] {
            let error = check(&ipmsm(from, to)).unwrap_err().to_string();
            assert!(error.contains(message) && error.starts_with("m.toml:") && error.lines().count() == 1, "{error}");
        }
    }
}
