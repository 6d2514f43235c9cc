//! Iron loss from a drag test: a motor drives the machine, which has no current, at some speeds. The measured power less friction,
//! which is measured with an unmagnetized rotor or estimated, is the iron loss.
//!
//! Without current, the flux linkage is psi_M, and the plant loses p = 1.5 psi_M^2 G(w) w^2 with G(w) = G_e + G_h /
//! sqrt(w^2 + w_0^2). So p / (1.5 psi_M^2) is linear in G_e and G_h: linear least squares. A coefficient that would be negative
//! is set to 0, and only the other one is fitted.

use super::motor::{Data, MotorFile};
use super::setting::{Setting, Value};
use crate::error::{Result, bail};
use drive::plant::iron::Iron;

/// The settings `iron.G_e` and `iron.G_h` of the plant; none without `[iron]` in the file.
///
/// # Errors
/// The position of the points in the file, and why they cannot be fitted.
#[expect(non_snake_case, reason = "the symbols of the model")]
pub fn fit(motor: &MotorFile) -> Result<Vec<Setting>> {
    let Some(iron) = &motor.data.iron else { return Ok(Vec::new()) };
    let (place, points) = (motor.place(&iron.p), iron.p.get_ref());
    let machine = &motor.data.machine;
    let (n_p, psi_M) = (f64::from(*machine.n_p.get_ref()), machine.psi_M.get_ref());
    for &[speed, p] in points {
        if !(speed.is_finite() && speed > 0.0 && p.is_finite() && p >= 0.0) {
            bail!(
                "{place}: [{speed}, {p}] must be a speed in rad/s greater than 0 and a power in W of at least 0: correct the pair"
            );
        }
    }
    let slowest = points.iter().fold(f64::INFINITY, |least, [speed, _]| least.min(*speed));
    let fastest = points.iter().fold(0.0_f64, |most, [speed, _]| most.max(*speed));
    if fastest <= 1.05 * slowest {
        bail!(
            "{place}: eddy currents and hysteresis differ by their dependence on speed: give pairs for at least two speeds, preferably in the ratio 1 to 3"
        );
    }
    let Iron { G_e, G_h, w_0 } = coefficients(&motor.data).unwrap_or_default();
    let lost = |speed: f64| {
        let w = n_p * speed;
        1.5 * psi_M * psi_M * (G_e * w * w + G_h * w * w / w.hypot(w_0))
    };
    let worst = points.iter().map(|&[speed, p]| (lost(speed) - p).abs()).fold(0.0, f64::max);
    let rule = format!("least squares of the drag test, within {worst:.2} W");
    let setting =
        |name, x| Setting { name, value: Value::Real(x), rule: rule.clone(), origin: Some(iron.p.span().start) };
    Ok(vec![setting("iron.G_e", G_e), setting("iron.G_h", G_h)])
}

/// The coefficients of the drag test, if there is one.
#[expect(non_snake_case, reason = "the symbols of the model")]
fn coefficients(data: &Data) -> Option<Iron> {
    let points = data.iron.as_ref()?.p.get_ref();
    let (n_p, psi_M) = (f64::from(*data.machine.n_p.get_ref()), data.machine.psi_M.get_ref());
    let w_0 = Iron::default().w_0;
    // Normal equations of y = G_e a + G_h b.
    let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for &[speed, p] in points {
        let w = n_p * speed;
        let ((a, b), y) = ((w * w, w * w / w.hypot(w_0)), p / (1.5 * psi_M * psi_M));
        (aa, ab, bb, ay, by) = (aa + a * a, ab + a * b, bb + b * b, ay + a * y, by + b * y);
    }
    let determinant = aa * bb - ab * ab;
    let (G_e, G_h) = match ((ay * bb - by * ab) / determinant, (by * aa - ay * ab) / determinant) {
        (G_e, _) if G_e < 0.0 => (0.0, by / bb),
        (_, G_h) if G_h < 0.0 => (ay / aa, 0.0),
        both => both,
    };
    Some(Iron { G_e, G_h, w_0 })
}

/// Conductance of the iron in S at standstill, where it is largest; 0 without a drag test.
pub fn at_standstill(data: &Data) -> f64 {
    coefficients(data).map_or(0.0, |iron| iron.conductance(0.0)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn fitted(points: &str) -> Result<Vec<f64>> {
        let text = include_str!("../../../motors/ipmsm-2.2kw.toml");
        let motor = MotorFile::parse(&format!("{text}\n[iron]\np = {points}\n"), Path::new("m.toml"))?;
        let value = |s: Setting| if let Value::Real(x) = s.value { x } else { f64::NAN };
        Ok(fit(&motor)?.into_iter().map(value).collect())
    }

    /// 2.7e-4 S and 0.127 1/H lose 53.35 W at 1500 rpm.
    #[test]
    fn the_conductances_come_back() {
        let found = fitted("[[52.35988, 11.785], [157.07963, 53.354], [314.15927, 160.170]]").unwrap();
        assert!((found[0] / 2.7e-4 - 1.0).abs() < 1e-4 && (found[1] / 0.127 - 1.0).abs() < 1e-4, "{found:?}");
        // Slower than w^1 or faster than w^2: only one of them.
        let found = fitted("[[100.0, 30.0], [200.0, 50.0]]").unwrap();
        assert!(found[0] == 0.0 && found[1] > 0.0, "{found:?}");
        let found = fitted("[[100.0, 10.0], [200.0, 60.0]]").unwrap();
        assert!(found[0] > 0.0 && found[1] == 0.0, "{found:?}");
    }

    #[test]
    fn points_that_say_nothing_are_refused() {
        for (points, message) in [
            ("[[100.0, 5.0]]", "give pairs for at least two speeds"),
            ("[[100.0, 5.0], [100.0, 5.1]]", "give pairs for at least two speeds"),
            ("[[100.0, -5.0], [200.0, 9.0]]", "[100, -5] must be a speed in rad/s greater than 0"),
            ("[[0.0, 0.0], [200.0, 9.0]]", "[0, 0] must be"),
        ] {
            let error = fitted(points).unwrap_err().to_string();
            assert!(error.contains(message) && error.starts_with("m.toml:"), "{error}");
        }
    }
}
