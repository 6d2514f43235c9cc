//! How `PmsmDrive` begins in a steady state ([`beginning`](crate::beginning)): it runs before the start.
//!
//! For [`TIME`], a copy of the drive runs on a shaft of constant speed that ends at the initial angle, at the temperatures of the steady
//! state, in torque mode with the reference of the algebra. The reference is corrected, and the run repeated, until the mean torque of
//! the shaft is the load. Then the drive takes over machine, controller and link as they are at the end. Every estimator and option thus
//! begins as it would be after a second in this state; the start takes as long as up to four seconds of simulation.

use super::PmsmDrive;
use crate::beginning::{Beginning, Operating};
use crate::steady::Steady;
use crate::torque::TorqueParameters;
use drive_base::math::wrap;
use drive_plant::model::PmsmPlant;
use drive_plant::thermal::{Temperatures, ThermalMode};
use fmu_core::continuous::ContinuousTime;
use fmu_core::draw::{Draw, mix};
use fmu_core::row::Slot;
use fmu_core::variable::Causality;
use fmu_core::{Block, Elapsed, Fault, Model, Step};

/// Time in s that a run takes before the start, and the part of it at the end whose mean torque counts.
const TIME: f64 = 1.0;
const COUNTED: f64 = 0.25;

/// Number of runs, and the error of the torque, as a share of the maximum torque, at which they end.
const RUNS: u32 = 4;
const SMALL: f64 = 1e-6;

/// Range of the torque, as a share of the maximum torque, and range and error of the estimated speed, as shares of it, up to which the
/// drive is steady.
const CALM: f64 = 0.1;

/// Error of the estimated angle in rad up to which the estimator follows the rotor.
const FOLLOWS: f64 = 0.7;

/// Number of samples of a run that only shows dependencies.
const SHORT: f64 = 2.0;

/// Communication step of the runs in samples.
const STEP: f64 = 4.0;

/// Range and mean of a signal.
#[derive(Clone, Copy, Debug, Default)]
struct Swing {
    count: f64,
    mean: f64,
    least: f64,
    greatest: f64,
}

impl Swing {
    fn add(&mut self, x: f64) {
        (self.least, self.greatest) =
            if self.count == 0.0 { (x, x) } else { (self.least.min(x), self.greatest.max(x)) };
        self.count += 1.0;
        self.mean += (x - self.mean) / self.count;
    }

    fn width(&self) -> f64 {
        self.greatest - self.least
    }
}

/// A drive that has run up, with the torque (N.m) of its shaft and its estimated speed (rad/s) in the end.
struct RunUp {
    drive: PmsmDrive,
    tau: Swing,
    speed_est: Swing,
}

impl RunUp {
    /// Whether the estimator follows the rotor and nothing swings, with the maximum torque `full` (N.m), at `speed` (rad/s).
    fn is_steady(&self, full: f64, speed: f64) -> bool {
        let (out, plant) = (&self.drive.pair.controller.out, &self.drive.pair.plant.out);
        let follows = out.lock_lost < 1.0 && wrap(out.theta_est - plant.theta_e).abs() < FOLLOWS;
        let off = (self.speed_est.mean - speed).abs();
        follows
            && self.tau.width() < CALM * full
            && (speed == 0.0 || self.speed_est.width().max(off) < CALM * speed.abs())
    }
}

impl PmsmDrive {
    /// The operating point at which it begins.
    pub(super) fn operating(&self) -> Operating {
        let plant = &self.pair.plant.model.parameters;
        let torque_mode = self.pair.controller.model.parameters.speed_loop.torque_mode;
        Operating {
            speed: if plant.mechanics.imposed { self.inputs.speed_shaft } else { plant.initial.speed },
            u_dc: self.link_voltage(),
            tau: if torque_mode { self.pair.controller.model.inputs.tau_ref } else { self.inputs.tau_load },
            coolant: self.inputs.thermal.coolant,
        }
    }

    /// The temperatures (K) that no network supplies.
    fn given(&self, drive: &Steady) -> Temperatures {
        match drive.plant.thermal.mode {
            ThermalMode::Imposed => self.inputs.thermal.imposed,
            _ => drive.start_temperatures(),
        }
    }

    /// Its steady state, by algebra.
    fn steady(&self) -> Steady {
        let (plant, controller) = (&self.pair.plant.model.parameters, &self.pair.controller.model.parameters);
        let mut drive = Steady::new(plant.clone(), controller.clone());
        drive.derating.clone_from(&self.derating);
        drive.sampled()
    }

    /// Whether it begins in a steady state.
    pub(super) fn begins_steadily(&self) -> bool {
        self.beginning.steady != Beginning::Off && self.inputs.enable && !self.inputs.asc
    }

    /// Checks that there is a steady state.
    ///
    /// # Errors
    /// Those of [`Beginning::point`].
    pub(super) fn validate_beginning(&self) -> Result<(), Fault> {
        if !self.begins_steadily() {
            return Ok(());
        }
        let drive = self.steady();
        // The voltage of the link is that of the source, before the state is found.
        let at = Operating { u_dc: self.inputs.u_dc, ..self.operating() };
        self.beginning.steady.point(&drive, at, self.given(&drive)).map(|_| ())
    }

    /// Takes over the steady state; returns whether it was found.
    pub(super) fn begin_steady(&mut self) -> bool {
        let drive = self.steady();
        let at = self.operating();
        let Ok((temperatures, point)) = self.beginning.steady.point(&drive, at, self.given(&drive)) else {
            return false;
        };
        let full = drive.settled().speed_loop().1 * drive.controller.limit.i;
        let by_speed = !drive.controller.speed_loop.torque_mode;
        let free = !drive.plant.mechanics.imposed;
        let (mut speed, mut tau_ref) = (at.speed, point.tau_ref);
        let mut run = self.run_up(temperatures, speed, tau_ref);
        for _ in 1..if self.short { 1 } else { RUNS } {
            let Some(last) = run.as_ref().filter(|run| run.is_steady(full, at.speed)) else { return false };
            let (tau_off, speed_off) = (at.tau - last.tau.mean, at.speed - last.speed_est.mean);
            if !by_speed || tau_off.abs() < SMALL * full && speed_off.abs() < SMALL * at.speed.abs() {
                break;
            }
            tau_ref += tau_off;
            if free {
                speed += speed_off;
            }
            run = self.run_up(temperatures, speed, tau_ref);
        }
        let Some(run) = run.filter(|run| self.short || run.is_steady(full, at.speed)) else { return false };
        self.take_over(run.drive, at.speed);
        true
    }

    /// A copy that has run for [`TIME`] at the mechanical `speed` (rad/s) up to the angle at which this one begins, with the torque
    /// reference `tau_ref` (N.m).
    fn run_up(&self, temperatures: Temperatures, speed: f64, tau_ref: f64) -> Option<RunUp> {
        let mut block = Block { model: self.clone(), ..Block::default() };
        let model = &mut block.model;
        model.beginning.steady = Beginning::Off;
        let (angle, T_s) = (self.pair.plant.out.angle, model.pair.controller.model.parameters.T_s);
        // Whole communication steps, and whole periods of a carrier.
        let (steps, h) = if self.short { (SHORT, T_s) } else { ((TIME / (STEP * T_s)).ceil(), STEP * T_s) };
        let begins = angle - speed * steps * h;
        let plant = &mut model.pair.plant.model.parameters;
        plant.mechanics.imposed = true;
        plant.thermal.mode = ThermalMode::Imposed;
        let n_p = f64::from(plant.motor.n_p);
        model.inputs.thermal.imposed = temperatures;
        (model.inputs.speed_shaft, model.inputs.angle_shaft, model.inputs.tau_ref) = (speed, begins, tau_ref);
        model.torque = TorqueParameters::default();
        let controller = &mut model.pair.controller.model;
        (controller.parameters.speed_loop.torque_mode, controller.parameters.start.catch) = (true, false);
        model.derive();
        model.initialize();
        model.link.clone_from(&self.link);
        model.pair.controller.model.begin_at(n_p * begins, speed);
        if self.short {
            let share = shown_by_inputs(&mut block);
            for state in &PmsmPlant::STATES[..2] {
                *state.at(&mut block.model.pair.plant.model) *= 1.0 + share;
            }
        }
        let (mut now, [mut tau, mut speed_est]) = (Elapsed::ZERO, [Swing::default(); 2]);
        for k in 0..num_of(steps) {
            let model = &mut block.model;
            model.inputs.angle_shaft = begins + speed * now.seconds();
            let step = Step { start: now, h };
            model.advance(&step).ok()?;
            now = step.end();
            if f64::from(k) >= (1.0 - COUNTED) * steps {
                tau.add(model.period.last.tau_shaft);
                speed_est.add(model.pair.controller.out.speed_est);
            }
        }
        Some(RunUp { drive: block.model, tau, speed_est })
    }

    /// Takes over the state of a drive that has run up, at the angle at which this one begins.
    fn take_over(&mut self, run: Self, speed: f64) {
        let angle = self.pair.plant.out.angle;
        let before = std::mem::replace(&mut self.pair, run.pair);
        let (plant, controller) = (&mut self.pair.plant, &mut self.pair.controller);
        plant.model.parameters = before.plant.model.parameters;
        controller.model.parameters = before.controller.model.parameters;
        let commanded = plant.model.inputs.commanded();
        plant.model.inputs = before.plant.model.inputs;
        plant.model.inputs.apply(commanded);
        controller.model.inputs = before.controller.model.inputs;
        self.pair.now = Elapsed::ZERO;
        plant.model.begin_here(angle);
        self.link = run.link.begun(self.source(Elapsed::ZERO));
        self.derive();
        self.pair.controller.model.begin_here(speed);
        self.pair.output();
        self.period = run.period.begun();
        self.before = self.pair.plant.model.inputs.commanded();
    }

    /// The warning that the drive does not begin in its steady state.
    pub(super) fn unsettled_message(&self) -> String {
        let Operating { speed, tau, .. } = self.operating();
        let estimator = self.pair.controller.model.parameters.estimator.name();
        format!(
            "initial.steady: after {TIME} s at {speed} rad/s with {tau} N.m, {estimator} is not steady: the drive begins \
             as with initial.steady = 1 (Off); begin at another speed or torque"
        )
    }
}

/// A number from 0 to below 1 that changes with each input of the drive: a short run shows by it that the steady state depends on all.
fn shown_by_inputs(block: &mut Block<PmsmDrive>) -> f64 {
    let mut hash = 0;
    for index in 0..PmsmDrive::TABLE.len() {
        match PmsmDrive::TABLE.entry(block, index).filter(|(meta, _)| meta.causality == Causality::Input) {
            Some((_, Slot::Real(x))) => hash = mix(hash ^ x.to_bits()),
            Some((_, Slot::Boolean(x))) => hash = mix(hash ^ (2 + u64::from(*x))),
            _ => (),
        }
    }
    Draw(hash).share()
}

/// A number of steps.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most some millions")]
fn num_of(steps: f64) -> u32 {
    steps as u32
}
