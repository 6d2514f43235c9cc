//! Which values of a fit are written, and why the others are refused.

use super::electrical::Fit;
use super::mechanics::{MechanicalFit, Shown};
use super::motion::Motion;
use super::record::{BenchRecord, Complex, quantile};
use super::windows::{Problem, Timing};
use fmu_core::digits::rounded;
use serde::Serialize;

/// Maximum R T/L for a step, and for a step that equals a sample of the controller: within a sample the voltage is constant and
/// the current's course is known.
const DECAY: (f64, f64) = (0.2, 0.35);

/// A quantity of the machine.
#[derive(Clone, Debug, Serialize)]
pub struct Quantity {
    /// Name in a motor file.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// The value, whether it is written or not.
    pub value: f64,
    /// Relative half-width of the interval (95 %); NaN: the value is given.
    pub half_width: f64,
    /// Why it is not written, and a remedy.
    pub refused: Option<String>,
}

impl Quantity {
    /// Its name, and its fields for other programs.
    pub(super) fn json(&self) -> (String, serde_json::Value) {
        let known = self.refused.is_none();
        let number = |x: f64| (known && x.is_finite()).then_some(x);
        let data = serde_json::json!({
            "value": number(self.value), "half_width": number(self.half_width), "unit": self.unit, "refused": self.refused,
        });
        (self.name.to_owned(), data)
    }
}

/// Properties of the record, in addition to the fit.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// Angle that the rotor turns in a step, rad.
    turn: f64,
    /// R T over the smaller inductance.
    decay: f64,
    /// The maximum accepted value.
    most_decay: f64,
    /// Current that 99 % of the rows stay below, over the maximum current.
    current: f64,
    /// `i_d` stays within 2 % of the maximum current around its median in nine of ten rows.
    steady_i_d: bool,
    /// The rotor stands.
    standing: bool,
    /// Levels of speed.
    levels: usize,
    /// The load is unknown.
    unloaded: bool,
    /// Residual of the fit, relative to the noise residual and to the voltage.
    rest: (f64, f64),
    condition: f64,
}

impl Facts {
    pub(super) fn of(
        record: &BenchRecord,
        motion: &Motion,
        timing: Timing,
        fit: &Fit,
        shown: &Shown,
        i_max: f64,
    ) -> Self {
        let [R, L_d, L_q, ..] = fit.p;
        let rows = || motion.runs.iter().flat_map(Clone::clone);
        let w = quantile(rows().map(|k| motion.w[k].abs()).collect(), 0.99);
        let i_d: Vec<f64> = rows()
            .map(|k| (record.i[k] * Complex::cis(-(motion.theta[k] - fit.theta_0 + motion.w[k] * fit.tau))).re)
            .collect();
        let middle = quantile(i_d.clone(), 0.5);
        let far = quantile(i_d.iter().map(|i| (i - middle).abs()).collect(), 0.9);
        let voltage = (rows().map(|k| record.u[k].norm_sqr()).sum::<f64>() / rows().count().max(1) as f64).sqrt();
        Self {
            turn: w * record.step,
            decay: R * record.step / L_d.min(L_q),
            most_decay: if timing.every == 1 { DECAY.1 } else { DECAY.0 },
            current: quantile(rows().map(|k| record.i[k].norm()).collect(), 0.99) / i_max,
            steady_i_d: far < 0.02 * i_max + 2.0 * record.sigma,
            standing: w == 0.0,
            levels: shown.levels,
            unloaded: record.load.is_none(),
            rest: (fit.rest / fit.noise.max(f64::MIN_POSITIVE), fit.rest / voltage.max(f64::MIN_POSITIVE)),
            condition: fit.condition,
        }
    }

    /// Whether the model's residual exceeds the noise residual.
    pub(super) fn misfit(&self) -> bool {
        self.rest.0 > 3.0 && self.rest.1 > 0.02
    }
}

/// Better fits: other phases, another direction, another delay.
pub(super) fn better(record: &BenchRecord, motion: &Motion, timing: Timing, i_max: f64, fit: &Fit) -> String {
    /// A third of a turn.
    const THIRD: f64 = 2.0 * std::f64::consts::PI / 3.0;
    let changed = |change: fn(Complex) -> Complex| {
        let mut other = record.clone();
        other.i.iter_mut().for_each(|i| *i = change(*i));
        Problem::new(&other, motion, timing, i_max).fit()
    };
    let reversed = || {
        let (mut other, mut turning) = (record.clone(), motion.clone());
        other.theta.iter_mut().for_each(|x| *x = -*x);
        turning.theta.iter_mut().for_each(|x| *x = -*x);
        turning.w.iter_mut().for_each(|x| *x = -*x);
        Problem::new(&other, &turning, timing, i_max).fit()
    };
    let tries = [
        ("theta with the other sign", reversed()),
        ("the currents of phases b and c swapped", changed(|i| i.conj())),
        ("the currents of phases a and b swapped", changed(|i| i.conj() * Complex::cis(THIRD))),
        ("the currents of phases a and c swapped", changed(|i| i.conj() * Complex::cis(-THIRD))),
        ("the currents with the other sign", changed(|i| -i)),
        ("the currents one phase on", changed(|i| i * Complex::cis(THIRD))),
        ("the currents one phase back", changed(|i| i * Complex::cis(-THIRD))),
        (
            "voltages one row later",
            Problem::new(record, motion, Timing { delay: timing.delay + 1.0, ..timing }, i_max).fit(),
        ),
    ];
    // A fit with a wrong sign may leave little.
    let most = if fit.is_possible() { fit.rest / 3.0 } else { 1.5 * fit.rest };
    let sound = |f: &Fit| f.p[..4].iter().all(|&x| x > 0.0) && f.rest < most;
    let best = tries.into_iter().filter_map(|(what, f)| Some((what, f.filter(sound)?)));
    match best.min_by(|(_, a), (_, b)| a.rest.total_cmp(&b.rest)) {
        Some((what, _)) => format!("the model does not fit; it fits with {what}: correct the columns"),
        None => "the model does not fit, not even with other phases, signs and delays: check columns, units and timing"
            .into(),
    }
}

/// Ratios of the torque of the currents to the load that have one common cause.
const SCALES: [(f64, &str); 9] = [
    (-1.0, "the load has the other sign: it is positive where it brakes positive rotation"),
    (std::f64::consts::FRAC_1_SQRT_2, "currents or voltages are RMS values: give instantaneous values"),
    (std::f64::consts::SQRT_2, "currents or voltages are multiplied by sqrt(2)"),
    (1.732_050_808, "line-to-line voltages are given as phase voltages"),
    (1.355_8, "the load is in lbf.ft: multiply by 1.3558"),
    (0.101_972, "the load is in kgf.cm: divide by 10.197"),
    (1e-3, "the load is in mN.m, or currents or voltages are divided by 1000"),
    (0.01, "the load is in N.cm"),
    (1e3, "the load is in kN.m, or currents or voltages are multiplied by 1000"),
];

/// Relative error of the torque for which sensors, iron losses and saturation may account.
const TORQUE_ERROR: f64 = 0.1;

/// Why the scales of currents, voltages and load contradict each other.
pub(super) fn scales(shown: &Shown) -> Option<String> {
    let (ratio, half) = shown.per_load()?;
    if (ratio - 1.0).abs() < TORQUE_ERROR + half || half > 0.2 * ratio.abs() {
        return None;
    }
    let cause = SCALES.into_iter().find(|(scale, _)| (ratio / scale - 1.0).abs() < 0.04);
    let cause = cause.map_or("currents, voltages or load have another scale: check their units", |(_, cause)| cause);
    Some(format!("currents and voltages give {} times the torque of the load: {cause}", rounded(ratio, 3)))
}

/// Name, unit, value, half-width, floor of the relative half-width, its limit, and the rules that may forbid the value.
type Row<'a> = (&'static str, &'static str, f64, f64, f64, f64, Vec<&'a Option<String>>);

/// All quantities with their verdicts.
pub(super) fn values(
    fit: &Fit,
    mechanics: Option<&MechanicalFit>,
    facts: &Facts,
    misfit: Option<String>,
    doubt: Option<String>,
) -> Vec<Quantity> {
    let all = misfit.or(doubt).or_else(|| {
        (facts.turn > 0.6)
            .then(|| format!("bandwidth: the rotor turns by {:.2} rad in a step: shorter steps are needed", facts.turn))
    });
    let fast = (facts.decay > facts.most_decay)
        .then(|| format!("bandwidth: R_s T/L = {:.2}: shorter steps are needed", facts.decay));
    let apart = (facts.condition > 1e6)
        .then(|| "psi_M and R_s are not separable: record two speeds or two currents".to_owned());
    let low = (facts.current < 0.3).then(|| {
        "R_s is not separable from the inverter's loss: record more current, or a test with direct current".to_owned()
    });
    let steady = facts.steady_i_d.then(|| "i_d was constant: record steps of i_d".to_owned());
    let rest = facts.standing.then(|| "the rotor stood still: record a turning rotor".to_owned());
    let one_speed =
        (facts.levels < 2 && !facts.standing).then(|| "the speed was constant: record two speeds".to_owned());
    let two_speeds = (facts.levels < 3).then(|| "the record contains too few speeds: record three".to_owned());
    let load = facts.unloaded.then(|| "the load is unknown: add tau_load or tau_shaft, or give --load none".to_owned());
    let [R, L_d, L_q, psi_M, ..] = fit.p;
    let (m, half) = mechanics.map_or(([f64::NAN; 3], [f64::NAN; 3]), |m| (m.p, m.half));
    let (u_dead, i_zero) = (fit.u_dead(), fit.i_zero());
    // The part of the inverter's loss that the curve cannot represent does not appear in the residual, so both have wide floors.
    #[rustfmt::skip]
    let rows: [Row<'_>; 9] = [
        ("R_s", "Ohm", R, fit.half[0], 0.003, 0.01, vec![&apart, &fast, &low]),
        ("L_d", "H", L_d, fit.half[1], 0.01, 0.025, vec![&fast, &steady]),
        ("L_q", "H", L_q, fit.half[2], 0.01, 0.025, vec![&fast, &one_speed]),
        ("psi_M", "Wb", psi_M, fit.half[3], 0.003, 0.01, vec![&rest, &apart]),
        ("J", "kg.m2", m[0], half[0], 0.005, 0.025, vec![&rest, &load, &one_speed]),
        ("B", "N.m.s/rad", m[1], half[1], 0.0, 0.15, vec![&rest, &load, &one_speed, &two_speeds]),
        ("tau_coulomb", "N.m", m[2], half[2], 0.0, 0.15, vec![&rest, &load, &one_speed, &two_speeds]),
        ("u_dead", "V", u_dead, fit.half[4], 0.03, 0.15, vec![&fast, &low]),
        ("i_zero", "A", i_zero, fit.half[5], 0.3, 0.35, vec![&fast, &low]),
    ];
    rows.into_iter()
        .map(|(name, unit, value, half, floor, limit, rules)| {
            let half_width = (half / value).hypot(floor).abs();
            let wide = || {
                (half_width.is_nan() || half_width > limit || value <= 0.0).then(|| {
                    format!(
                        "the interval of +-{:.2} % is above {} %: record longer, or with more steps",
                        100.0 * half_width,
                        100.0 * limit
                    )
                })
            };
            let refused = all.clone().or_else(|| rules.into_iter().flatten().next().cloned()).or_else(wide);
            Quantity { name, unit, value, half_width, refused }
        })
        .collect()
}
