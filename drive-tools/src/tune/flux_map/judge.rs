//! Checks that a table describes a machine, and this machine: the residue of its map, reciprocity, torque, the magnet, the
//! currents.

use super::super::motor::MotorFile;
use super::squares::Point;
use crate::error::{Result, WithContext, bail, ensure};
use drive::frame::Dq;
use drive::plant::flux_map::FluxMap;
use std::f64::consts::SQRT_2;

/// Maximum residue, reciprocity error and torque error as a share of the rms value.
const ALLOWED: f64 = 0.15;

/// Deviation of the map from the table, in A.
pub(super) struct Errors {
    /// Root mean square of both currents.
    rms: Dq,
    worst: f64,
    /// Root mean square of the table's current.
    scale: f64,
}

impl Errors {
    #[expect(clippy::cast_precision_loss, reason = "thousands of points")]
    pub(super) fn of(map: &FluxMap, points: &[Point], psi_M: f64) -> Self {
        let error = |p: &Point| map.current(p.psi - Dq::new(psi_M, 0.0)) - p.i;
        let mean = |of: &dyn Fn(&Point) -> f64| (points.iter().map(of).sum::<f64>() / points.len() as f64).sqrt();
        Self {
            rms: Dq::new(mean(&|p| error(p).d().powi(2)), mean(&|p| error(p).q().powi(2))),
            worst: points.iter().map(|p| error(p).magnitude()).fold(0.0, f64::max),
            scale: mean(&|p| p.i.magnitude().powi(2)),
        }
    }

    pub(super) fn text(&self, points: &[Point]) -> String {
        let Self { rms, worst, .. } = self;
        format!(
            "flux_map comes within {:.2e} A (i_d) and {:.2e} A (i_q) rms of its {} points, {worst:.2e} A at worst",
            rms.d(),
            rms.q(),
            points.len()
        )
    }
}

/// Refuses a map that deviates from its table or is physically impossible.
pub(super) fn check(map: &FluxMap, errors: &Errors, points: &[Point], file: &str, psi_M: f64) -> Result<()> {
    const CAUSES: &str = "usual causes are swapped axes, the other sign of i_d (convention = \"syr\"?), or columns of another \
                          run; columns are i_d,i_q in A and psi_d,psi_q in Wb";
    let off = errors.rms.magnitude() / errors.scale;
    ensure!(
        off < ALLOWED,
        "{file}: no energy has these currents: the closest map is {:.0} % off, {:.0} % are allowed; {CAUSES}",
        100.0 * off,
        100.0 * ALLOWED
    );
    let Some(x) = map.flaw() else { return Ok(()) };
    let psi = x + Dq::new(psi_M, 0.0);
    let distance = |p: &&Point| (Dq::new(p.psi.d(), p.psi.q().abs()) - psi).magnitude();
    let nearest =
        points.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).with_context(|| "no points".to_owned())?;
    bail!(
        "{file}: more flux takes less current at psi = ({:.4}, {:.4}) Wb, near i = ({:.2}, {:.2}) A, which is impossible; add or \
         correct points there; {CAUSES}",
        psi.d(),
        psi.q(),
        nearest.i.d(),
        nearest.i.q()
    )
}

/// Refuses a table whose magnet differs from the machine's.
pub(super) fn judge_magnet(found: f64, motor: &MotorFile) -> Result<()> {
    let given = &motor.data.machine.psi_M;
    let ratio = found / given.get_ref();
    let cause = if (ratio - SQRT_2).abs() < 0.1 || (ratio - 1.0 / SQRT_2).abs() < 0.1 {
        "one of them is an rms value (scale = \"rms\" in [flux_map] for a table of rms values)"
    } else {
        "correct the value, or the table's axes, or give the temperature of the table"
    };
    ensure!(
        (ratio - 1.0).abs() < 0.1,
        "{}: machine.psi_M = {} Wb, but the table has no current at {found:.5} Wb: {cause}",
        motor.place(given),
        given.get_ref()
    );
    Ok(())
}

/// The reciprocity error of a table on a grid of currents by central differences; `None` if it is not on a grid.
///
/// # Errors
/// It is too large for a machine.
pub(super) fn reciprocity(points: &[Point], file: &str) -> Result<Option<String>> {
    let axis = |of: fn(Dq) -> f64| {
        let mut values: Vec<f64> = points.iter().map(|p| of(p.i)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup_by(|a, b| (*a - *b).abs() < 1e-6 * (1.0 + b.abs()));
        values
    };
    let (along_d, along_q) = (axis(Dq::d), axis(Dq::q));
    if along_d.len() * along_q.len() != points.len() || along_d.len() < 3 || along_q.len() < 3 {
        return Ok(None);
    }
    let place = |values: &[f64], x: f64| values.partition_point(|v| *v < x - 1e-6 * (1.0 + x.abs()));
    let mut psi = vec![Dq::ZERO; points.len()];
    for p in points {
        psi[place(&along_d, p.i.d()) * along_q.len() + place(&along_q, p.i.q())] = p.psi;
    }
    let (mut error, mut mutual, mut own, mut n) = (0.0, 0.0, 0.0, 0.0);
    for m in 1..along_d.len() - 1 {
        for k in 1..along_q.len() - 1 {
            let at = |m: usize, k: usize| psi[m * along_q.len() + k];
            let by_d = (at(m + 1, k) - at(m - 1, k)) * (1.0 / (along_d[m + 1] - along_d[m - 1]));
            let by_q = (at(m, k + 1) - at(m, k - 1)) * (1.0 / (along_q[k + 1] - along_q[k - 1]));
            error += (by_q.d() - by_d.q()).powi(2);
            mutual += 0.5 * (by_q.d().powi(2) + by_d.q().powi(2));
            own += 0.5 * (by_d.d().powi(2) + by_q.q().powi(2));
            n += 1.0;
        }
    }
    let rms = |sum: f64| 1e3 * (sum / n).sqrt();
    let [error, mutual, own] = [error, mutual, own].map(rms);
    // Where the axes are hardly coupled, the error counts beside the inductances themselves.
    let share = error / mutual.max(0.1 * own);
    ensure!(
        share < ALLOWED,
        "{file}: d psi_d/d i_q and d psi_q/d i_d differ by {error:.3} mH rms and are {mutual:.3} mH: {:.0} % are allowed; a machine's \
         are equal (swapped axes, the sign of i_d, or columns of two runs)",
        100.0 * ALLOWED
    );
    Ok(Some(format!(
        "the table's d psi_d/d i_q and d psi_q/d i_d, which reciprocity makes equal, differ by {error:.3} mH rms beside {mutual:.3} mH"
    )))
}

/// Compares the torques in the table with those computed from its flux linkages and currents.
///
/// # Errors
/// They are too far off.
pub(super) fn torque(points: &[Point], torques: &[f64], motor: &MotorFile, file: &str) -> Result<Option<String>> {
    if torques.is_empty() {
        return Ok(None);
    }
    let k = 1.5 * f64::from(*motor.data.machine.n_p.get_ref());
    let (mut by, mut squared, mut error) = (0.0, 0.0, 0.0);
    for (p, tau) in points.iter().zip(torques) {
        let own = k * p.psi.cross(p.i);
        (by, squared) = (by + own * tau, squared + own * own);
        error += (own - tau).powi(2);
    }
    let (ratio, off) = (by / squared, (error / squared).sqrt());
    ensure!(
        off < ALLOWED,
        "{file}: the torques are {ratio:.3} times 1.5 n_p psi x i, {:.0} % rms off: wrong n_p, rms values (scale = \"rms\": 2 times), or \
         a torque per sector of the machine",
        100.0 * off
    );
    Ok(Some(format!(
        "the table's torques are {ratio:.4} times 1.5 n_p psi x i, {:.1} % rms off (1 to 3 % are usual with finite elements)",
        100.0 * off
    )))
}

/// Reports an axis on which the table ends below the currents in use.
pub(super) fn coverage(points: &[Point], motor: &MotorFile) -> Option<String> {
    let limit = *motor.data.rating.current.get_ref();
    let most = |of: fn(Dq) -> f64| points.iter().map(|p| of(p.i)).fold(f64::NEG_INFINITY, f64::max);
    let (d, q) = (most(|i| -i.d()), most(|i| i.q().abs()));
    (d.min(q) < 1.2 * limit).then(|| {
        format!(
            "the table ends at i_d = {:.1} A and |i_q| = {q:.1} A; with 1.2 times rating.current, {:.1} A, transients stay inside it; \
             beyond, the inductances at its edge are used",
            -d,
            1.2 * limit
        )
    })
}
