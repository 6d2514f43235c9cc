//! Predicts failures of the tuned drive: failures in its [`trial`](super::trial), their causes, and remedies ([`remedy`]).
//!
//! - **Load.** A step of the torque T makes the speed loop (double pole at w_s / 2) dip by 2/e T / (J w_s). An EMF-based
//!   estimator loses the rotor near zero speed; a flux observer may pass it. There, R^ below R turns the estimate by
//!   c_1 (R - R^) i / (w^2 psi_M), to first order.
//! - **Start, flux observer.** At rest, R^ below R drives the estimate away at (R - R^) i_0 / psi_M, and the rotor follows with
//!   w_0 = sqrt(n_p K i_0 / J): the drift must be slower. The rules choose R^ for that; a margin below 2 % is less than the
//!   uncertainty of R. From the opposite angle, the speed loop drives i_q to its limit before the rotor has turned around: at
//!   an angle of atan(i_q / i_d) from the rotor, the currents produce no torque, and if R - R^ is small, the estimate stays
//!   there.
//! - **Start, extended EMF.** A change of i_q acts on the estimated speed through (L_q - L_d) p i_q against the EMF; closed by
//!   the speed loop, the gain is J w_s (L_q - L_d) rho^2 / (K n_p w psi_M). Above 40 at 0.1 pu, the speed does not
//!   settle there after the hand-over.

use super::bandwidth::{DIP_OF_A_STEP, GREATEST_GAIN, gain_per_bandwidth};
use super::motor::{Data, Located, MotorFile, torque_constant};
use super::rasmussen::{LEAST_MARGIN, resistance_margin};
use super::remedy::{self, Cure, What};
use super::setting::Tuned;
use super::trial::Trial;
use drive::control::start::StartMode;
use drive::control::tables::ControllerParameters;
use drive::estimator::{Class, Kind};
use fmu_core::digits::rounded;
use std::fmt;

/// A start or a load that the drive will not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// Operating conditions that the drive cannot hold.
    pub what: What,
    /// At which speed in pu.
    pub level: f64,
    /// Why.
    pub reason: String,
    /// Remedies; each was tried.
    pub cures: Vec<Cure>,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "will not hold {} at {} pu: {}; ", self.what, rounded(self.level, 3), self.reason)?;
        if self.cures.is_empty() {
            return f.write_str("no remedy was found: use a sensor (estimator Sensored) with a higher rating.current");
        }
        for (k, cure) in self.cures.iter().enumerate() {
            write!(f, "{}{cure}", if k > 0 { ", or " } else { "" })?;
        }
        Ok(())
    }
}

/// Failures of the drive in its `trials`, and notes on conditions that it holds by a narrow margin.
pub fn of(motor: &MotorFile, tuned: &Tuned, trials: &[Trial]) -> (Vec<Limit>, Vec<String>) {
    let (mut limits, mut notes) = (Vec::new(), Vec::new());
    let pair = tuned.pair();
    let par = &pair.controller.model.parameters;
    for trial in trials {
        let level = trial.task.level;
        let mut tell = |what, reason| {
            let cures = remedy::found(motor, tuned, trials, trial, what);
            limits.push(Limit { what, level, reason, cures });
        };
        if !trial.starts() {
            tell(What::Start, of_start(&motor.data, par, trial));
        }
        if !trial.holds() {
            tell(What::Load, of_load(&motor.data, par, trial));
        } else if trial.slips() {
            notes.push(format!(
                "at {} pu, the drive slips under {} and recovers: the estimate is up to {:.0} deg off, and the speed comes down to \
                 {:.2} pu",
                rounded(level, 3),
                step(trial),
                trial.error,
                trial.least
            ));
        } else if trial.least <= 0.0 {
            notes.push(format!(
                "at {} pu, {} takes the speed to {:.2} pu, through zero, where the estimate depends on R_s",
                rounded(level, 3),
                step(trial),
                trial.least
            ));
        }
    }
    (limits, notes)
}

/// A note if the drive does not start from every angle while the rated torque acts from the first sample on: from `started` of
/// `angles` it does.
pub fn under_load(tuned: &Tuned, level: f64, (started, angles): (u32, u32)) -> Option<String> {
    if started == angles {
        return None;
    }
    let pair = tuned.pair();
    let (par, plant) = (&pair.controller.model.parameters, &pair.plant.model.parameters);
    let back = |time: f64| f64::from(par.motor.n_p) * tuned.torque * time * time / (2.0 * plant.mechanics.J);
    let turns = |what: &str, time: f64| {
        let turned = back(time);
        format!("{what} takes {time:.3} s, in which the load turns a free rotor by n_p T t^2 / (2 J) = {turned:.1} rad")
    };
    let why = match par.start.mode {
        StartMode::CurrentFrequency => turns("the growth of the start's current", par.start.t_align / 3.0),
        StartMode::Injection => turns("the search for the pole", par.polarity.t_find),
        StartMode::Direct => {
            "the estimate is wrong until the rotor has aligned with i_0, and the load acts before".into()
        }
    };
    Some(format!(
        "under the rated torque from rest, the drive gets to {} pu from {started} of {angles} angles: {why}; let the load act \
         once start_state is Running, or hold the rotor with a brake until then",
        rounded(level, 3)
    ))
}

fn step(trial: &Trial) -> String {
    if trial.task.level > 1.0 {
        format!("a step of {:.3} N.m", trial.task.torque)
    } else {
        "a step of the rated torque".into()
    }
}

fn of_load(data: &Data, par: &ControllerParameters, trial: &Trial) -> String {
    let dip = DIP_OF_A_STEP * trial.task.torque / (data.mechanics.J.get_ref() * par.speed_loop.bandwidth);
    let speed = trial.task.level * data.rating.speed.get_ref();
    let part = |x: &Option<Located>| x.as_ref().map_or(0.0, |x| *x.get_ref());
    let friction = part(&data.mechanics.tau_coulomb) + part(&data.mechanics.B) * speed;
    if trial.most < trial.task.torque + friction {
        return format!(
            "u_dc and rating.current leave {:.3} N.m, and load and friction take {:.3} N.m",
            trial.most,
            trial.task.torque + friction
        );
    }
    let by_speed = format!("{} takes 2/e T / (J w_s) = {dip:.3} of the {speed:.3} rad/s", step(trial));
    if par.estimator != Kind::Rasmussen {
        return by_speed;
    }
    let (psi_M, w) = (data.machine.psi_M.get_ref(), f64::from(par.motor.n_p) * speed);
    let lost = (data.machine.R_s.get_ref() - par.motor.R_s) * trial.task.torque / torque_constant(data);
    let turned = par.estimators.rasmussen.c_1 * lost / (w * w * psi_M);
    if turned < 0.05 {
        return by_speed;
    }
    format!("{by_speed}, and c_1 (R - R^) i / (w^2 psi_M) = {turned:.2} rad turns the estimate")
}

fn of_start(data: &Data, par: &ControllerParameters, trial: &Trial) -> String {
    let from = format!("from {} of {} angles, ", trial.angles - trial.started, trial.angles);
    if par.estimator == Kind::Rasmussen {
        let margin = resistance_margin(data);
        if margin < LEAST_MARGIN {
            return format!(
                "{from}at rest, the estimate leaves the rotor unless R_s is known to {:.1} %: (R - R^) i_0 / psi_M against \
                 sqrt(n_p K i_0 / J)",
                100.0 * margin
            );
        }
        let i_0 = par.zero_speed.i_0;
        let beside = par.limit.i_q_beside(i_0).atan2(i_0).to_degrees();
        return format!(
            "{from}the speed loop is faster than the rotor, and the estimate stays near atan(i_q / i_0) = {beside:.0} deg \
            away from it, where the currents produce no torque"
        );
    }
    let gain = gain_per_bandwidth(data, par.estimators.tracker.bandwidth) * par.speed_loop.bandwidth;
    if par.estimator.class() != Class::BackEmf || gain <= GREATEST_GAIN {
        let after = match par.start.mode {
            StartMode::Direct => "",
            StartMode::CurrentFrequency => " after the I-f start",
            StartMode::Injection => " after the start by injection",
        };
        return format!("{from}the speed does not settle at its reference{after}");
    }
    format!(
        "{from}the speed loop acts on the estimate through (L_q - L_d) p i_q with the gain J w_s (L_q - L_d) rho^2 / (K n_p w \
         psi_M) = {gain:.0}, more than {GREATEST_GAIN}"
    )
}
