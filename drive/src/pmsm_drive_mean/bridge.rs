//! The inverter of `PmsmDriveMean`: its gates switch, are off, or short-circuit the machine; trips by the voltage.

use super::{PmsmDriveMean, State};
use crate::steady::{At, Diodes, Point};
use drive_control::estimator::Kind;
use drive_control::trip::{Cause, Trip};
use drive_plant::inverter::Gates;

impl PmsmDriveMean {
    /// State of the gates.
    pub(super) fn bridge(&self) -> Gates {
        if self.inputs.asc || self.trip.shorts {
            Gates::Short
        } else if self.inputs.enable && self.trip.cause == Cause::None {
            Gates::Switch
        } else {
            Gates::Off
        }
    }

    /// Whether the controller operates and the gates switch.
    pub(super) fn gates(&self) -> bool {
        self.bridge() == Gates::Switch
    }

    /// The point of the drive under the condition of `at`: with the torque `tau` (N.m) of the current loop while the gates switch,
    /// after these `diodes` while they are off.
    pub(super) fn point_of(&self, at: &At<'_>, (tau, diodes): (f64, Diodes)) -> Point {
        match self.bridge() {
            Gates::Switch => at.by_loop(tau),
            Gates::Short => at.shorted(),
            Gates::Off => at.off(diodes),
        }
    }

    /// At the end of a step or at an event, with the point there: whether the diodes conduct.
    pub(super) fn settle(&mut self) {
        self.diodes = match self.bridge() {
            Gates::Off => self.point.diodes.map_or(Diodes::Blocked, Diodes::Conducted),
            Gates::Switch | Gates::Short => Diodes::Open(self.point.psi),
        };
    }

    /// Model Exchange, at an event in this `state`: where the gates have just been switched off, the current flows on from there.
    pub(super) fn leave(&mut self, state: &State) {
        if let (Diodes::Open(_), Gates::Off) = (self.diodes, self.bridge()) {
            let before = self.at(state, &self.point).by_loop(state.tau);
            self.diodes = Diodes::Open(before.psi);
        }
    }

    /// At the end of a step or at an event: the trips by the voltage `u` (V) of the link, until `enable` falls.
    pub(super) fn watch_voltage(&mut self, u: f64) {
        let controller = &self.drive.controller;
        if !(self.inputs.enable && controller.trip.used) {
            self.trip = Trip::default();
        } else if !self.inputs.asc {
            let speed = self.speed(&self.state);
            if self.trip.cause == Cause::UnderVoltage && controller.trip.restarts(u) {
                (self.trip, self.known) = (Trip::default(), false);
            }
            if self.trip.cause == Cause::None {
                self.trip = Trip::new(controller.trip.cause_of_voltage(u), speed);
            }
            if self.trip.cause != Cause::None {
                // Without a sensor the controller only knows its estimate at the trip.
                let measured = (controller.estimator == Kind::Sensored).then_some(speed);
                self.trip.update(&controller.trip, &controller.motor, u, measured);
            }
        }
    }
}
