//! The loops and limits of the methods with a tracker or a sensor, and the I-f start of those that need an EMF.
//!
//! The start: the rotor swings on the current vector with w_0 = sqrt(n_p K I / J), damped by 0.5, and the reluctance reduces
//! stiffness and damping by the share (L_q - L_d) I / psi_M. The alignments take 3 of its time constants each, the speed before
//! the hand-over 4. Where the saliency leaves less than 1.4 times the rated torque on the d-axis, the start is that above psi_M / (L_q -
//! L_d), which the controller aligns with half of that and then moves along the line without torque (`reluctance` there).

use super::bandwidth::GREATEST_TORQUE;
use super::motor::{Data, electrical, swing, torque_constant};
use super::setting::{Setting, Value, real, set};
use drive::control::limits::Limits;
use drive::control::reference::{max_torque, max_torque_per_ampere};

/// Duration of a start (s) above which a note gives it.
const LONG: f64 = 2.0;

/// The loops; `active`: with active resistance.
pub fn settings(data: &Data, active: bool) -> Vec<Setting> {
    let mut all = vec![
        set("current.mtpa", Value::Boolean(true), "salient: minimum current for a torque"),
        real("speed_loop.b", 1.0, "proportional part on the whole error"),
        real("limit.i_q", *data.rating.current.get_ref(), "the maximum current"),
    ];
    if active {
        all.push(set("current.active_resistance", Value::Boolean(true), "K_i = w_c^2 L"));
    }
    all
}

/// The torque limit of a method that estimates.
pub fn limit(data: &Data) -> Setting {
    real("limit.tau", GREATEST_TORQUE * data.rating.torque.get_ref(), "1.6 times the rated torque")
}

/// The values of a drive with a sensor: only the current limits the torque.
pub fn sensored(data: &Data) -> Vec<Setting> {
    let i = *data.rating.current.get_ref();
    let most = max_torque(&electrical(data), &Limits { i_q: i, i, tau: f64::INFINITY }, true);
    let mut all = settings(data, true);
    all.push(real("limit.tau", most, "the torque of the maximum current, by maximum torque per ampere"));
    all
}

/// Share of the start's torque that accelerates the rotor.
const SHARE: (f64, f64) = (0.3, 0.6);

/// Times of alignment and settling of a start above psi_M / (L_q - L_d), in units of 1 / w_0.
const ON_LINE: (f64, f64) = (5.0, 4.0);

/// Minimum current of such a start in units of psi_M / (L_q - L_d).
const LINE: f64 = 1.2;

/// The current, the time of an alignment and of the settling, and the torque that the start carries, with the rules.
struct Lead {
    i: (f64, &'static str),
    align: (f64, &'static str),
    settle: (f64, &'static str),
    /// Maximum torque in N.m on the ramp.
    torque: f64,
}

/// Maximum current in A of a start on the d-axis: the reluctance torque is at most half of the magnet's.
pub fn most_on_axis(data: &Data) -> f64 {
    let machine = &data.machine;
    0.5 * machine.psi_M.get_ref() / (machine.L_q.get_ref() - machine.L_d.get_ref()).abs()
}

/// A start with the current on the d-axis, where the magnet holds the rotor.
fn on_axis(data: &Data, lead: f64) -> Lead {
    let k = torque_constant(data);
    let saliency = (data.machine.L_q.get_ref() - data.machine.L_d.get_ref()).abs();
    // Decay rate of the swing on the current vector, in 1/s.
    let decay = 0.5 * swing(data, lead) * (1.0 - saliency * lead / data.machine.psi_M.get_ref());
    Lead {
        i: (lead, "1.4 times the rated torque / K, at most the maximum current and psi_M / (2 |L_q - L_d|)"),
        align: ((3.0 / decay).max(0.25), "the rotor settles on the current vector: 3 time constants, at least 0.25 s"),
        settle: ((4.0 / decay).max(0.2), "its swing has decayed at the hand-over: 4 time constants, at least 0.2 s"),
        torque: k * lead,
    }
}

/// A start of a machine whose reluctance torque outweighs the magnet's: none if the maximum current is not enough for it.
fn on_line(data: &Data) -> Option<Lead> {
    let (machine, J, limit) = (electrical(data), *data.mechanics.J.get_ref(), *data.rating.current.get_ref());
    let saliency = machine.L_q - machine.L_d;
    let i_0 = machine.psi_M / saliency;
    let wanted = max_torque_per_ampere(&machine, 1.4 * data.rating.torque.get_ref()).magnitude();
    let i = wanted.min(limit);
    if saliency <= 0.0 || i < LINE * i_0 {
        return None;
    }
    let n_p = f64::from(machine.n_p);
    let swing = |stiffness: f64| (n_p * 1.5 * n_p * stiffness / J).sqrt();
    let (still, turning) = (swing(0.25 * machine.psi_M * i_0), swing(saliency * (i * i - i_0 * i_0)));
    Some(Lead {
        i: (i, "1.4 times the rated torque, by maximum torque per ampere, at most the maximum current"),
        align: (
            (ON_LINE.0 / still).max(0.25),
            "the rotor settles on psi_M / (2 (L_q - L_d)): 5 / w_0, at least 0.25 s",
        ),
        settle: ((ON_LINE.1 / turning).max(0.2), "its swing has decayed at the hand-over: 4 / w_0, at least 0.2 s"),
        torque: max_torque(&machine, &Limits { i_q: i, i, tau: f64::INFINITY }, true),
    })
}

/// The I-f start up to `speed` (rad/s). `steady`: the estimator does not bear the quick change of the current at the hand-over, so it
/// stays on the d-axis.
pub fn start(data: &Data, (speed, rule): (f64, &str), steady: bool, notes: &mut Vec<String>) -> Vec<Setting> {
    let (limit, torque) = (*data.rating.current.get_ref(), *data.rating.torque.get_ref());
    // A d-axis current holds the rotor only while magnet torque exceeds reluctance torque: |L_q - L_d| i
    // < psi_M.
    let k = torque_constant(data);
    let (wanted, stable) = ((1.4 * torque / k).min(limit), most_on_axis(data));
    let line = (stable < wanted && !steady).then(|| on_line(data)).flatten();
    let on_line = line.is_some();
    let lead = line.unwrap_or_else(|| on_axis(data, wanted.min(stable)));
    if on_line {
        notes.push(format!(
            "the I-f start aligns the rotor with psi_M / (2 (L_q - L_d)) = {stable:.2} A, which hold up to {:.2} N.m, {:.2} of the rated \
             torque; then {:.2} A carry up to {:.2} N.m; let a higher load act once start_state is Running",
            k * stable,
            k * stable / torque,
            lead.i.0,
            lead.torque
        ));
    } else if stable < wanted {
        notes.push(format!(
            "the saliency leaves {stable:.2} A for the I-f start: it carries up to {:.2} N.m, {:.2} of the rated torque; let the load act \
             once start_state is Running",
            k * stable,
            k * stable / torque
        ));
    } else if wanted < 1.2 * torque / k {
        notes.push(format!(
            "the maximum current gives {:.2} N.m in the I-f start, {:.2} of the rated torque",
            k * wanted,
            k * wanted / torque
        ));
    }
    let still = 2.0 * lead.align.0 + lead.settle.0;
    let per_share = speed * data.mechanics.J.get_ref() / lead.torque;
    let share = (per_share / (LONG - still)).clamp(SHARE.0, SHARE.1);
    // A start with less than 1.4 times the torque has none to spare.
    let spare = stable >= wanted || on_line;
    let share = if !spare {
        SHARE.0
    } else if still < LONG {
        share
    } else {
        SHARE.1
    };
    let acceleration = share * lead.torque / data.mechanics.J.get_ref();
    let duration = 2.0 * lead.align.0 + speed / acceleration + lead.settle.0;
    if duration > LONG * (1.0 + 1e-9) {
        notes.push(format!(
            "the I-f start takes {duration:.1} s: 2 x {:.2} s of alignment, {:.2} s of acceleration, {:.2} s of settling",
            lead.align.0,
            speed / acceleration,
            lead.settle.0
        ));
    }
    vec![
        set("start.mode", Value::Item("CurrentFrequency".into()), "no EMF at standstill"),
        real("start.i", lead.i.0, lead.i.1),
        real("start.speed", speed, rule),
        real("start.acceleration", acceleration, "0.3 of the start's torque, up to 0.6 for a start of 2 s"),
        real("start.t_align", lead.align.0, lead.align.1),
        real("start.settle", lead.settle.0, lead.settle.1),
    ]
}
