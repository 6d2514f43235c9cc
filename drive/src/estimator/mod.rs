//! Estimators of rotor angle and speed: one file each, one row in the list here.
//!
//! At sample k an estimator gets a [`Sample`], the currents of that instant and the voltage that acted since the last
//! one, and gives an [`Estimate`]: angle and speed at that instant, the current to control, and, if it injects a
//! carrier, the voltage to add to this sample's command. What it needs of other parts (machine estimates, inertia, its
//! parameters) comes in a [`Context`].
//!
//! A new estimator implements [`Estimating`], has a row in the list at the end of this file and, for parameters of its
//! own, a row in [`tables`]. The row says what the method is ([`Class`]) and whether it holds standstill. The estimator then
//! appears in the enumeration, the FMUs, their documentation and every scenario of the comparison.

pub mod carrier;
pub mod current_model;
pub mod direct_emf;
pub mod emf;
pub mod emf_observer;
pub mod extended_emf;
pub mod follower;
pub mod hybrid;
pub mod interval;
pub mod kalman;
pub mod near_pwm;
pub mod pulsating;
pub mod rasmussen;
pub mod rotating;
pub mod saliency;
pub mod sensored;
pub mod square_wave;
pub mod tables;
#[cfg(test)]
pub(crate) mod testing;
pub mod tracker;
pub mod voltage_feedback;
pub mod voltage_model;

use crate::control::current::CurrentLoop;
use crate::frame::{AlphaBeta, DqHat};
use crate::motor::Motor;
use fmu_core::{Fault, enumeration};
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use tables::ESTIMATOR_PARAMETERS;
pub use tables::EstimatorParameters;

/// What a controller knows at sample k.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Number of the sample, 0 at the start.
    pub k: u64,
    /// Stator current measured at sample k, in A.
    pub i: AlphaBeta,
    /// Stator current measured at sample k - 1, in A; at the first sample that of sample 0.
    pub i_last: AlphaBeta,
    /// Stator voltage command that acted in [k - 1, k), in V: limited, injection included, without dead-time
    /// compensation. Held in stator axes. It is the command of sample k - 1 - delay, and so is the injection in it: a
    /// carrier is told from `u_injected`, never from the sign that was asked for last.
    pub u: AlphaBeta,
    /// The injected part of `u`, in V, reduced as `u` was where the limit cut it.
    pub u_injected: AlphaBeta,
    /// Output of the current PI at sample k - 1, without feed-forward and injection, in V.
    pub u_pi: DqHat,
    /// Current references of sample k - 1, in A.
    pub i_ref: DqHat,
    /// Torque reference of sample k - 1, limited, in N.m.
    pub tau_ref: f64,
    /// Electrical angle of a sensor in rad.
    pub theta_meas: f64,
    /// Electrical speed of a sensor in rad/s.
    pub w_meas: f64,
    /// DC-link voltage in V.
    pub u_dc: f64,
}

/// What an estimator may know besides the sample: parameters and the controller's estimates.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a> {
    /// The estimators' parameters.
    pub par: &'a EstimatorParameters,
    /// Estimates of the machine.
    pub motor: &'a Motor,
    /// Parameters of the current loop.
    pub current: &'a CurrentLoop,
    /// Estimate of the inertia in kg.m2.
    pub J: f64,
    /// Sample period in s.
    pub T_s: f64,
    /// Samples from taking the currents to the voltage acting: the command of sample k acts in
    /// [k + delay, k + delay + 1).
    pub delay: f64,
}

impl Context<'_> {
    /// Name, value and unit of one of the estimators' parameters, for messages.
    pub fn tell<T>(&self, get: impl FnOnce(&mut EstimatorParameters) -> &mut T) -> String {
        ESTIMATOR_PARAMETERS.tell(self.par, get)
    }

    /// The fault that one of the estimators' parameters is not what is `allowed`.
    pub fn fault<T>(&self, get: impl FnOnce(&mut EstimatorParameters) -> &mut T, allowed: impl Display) -> Fault {
        ESTIMATOR_PARAMETERS.fault(self.par, get, allowed)
    }
}

/// A voltage to be added to the command of this sample, in V.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Injection {
    /// None.
    #[default]
    None,
    /// In stator axes.
    Stator(AlphaBeta),
    /// In the estimated rotor frame, turned as the command is: to the middle of the interval in which it acts.
    Estimated(DqHat),
}

/// What an estimator knows at sample k, and what it asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Electrical rotor angle in rad, not wrapped.
    pub theta: f64,
    /// Electrical speed in rad/s.
    pub w: f64,
    /// Stator current to control in A: the measured one without the carrier.
    pub i: AlphaBeta,
    /// Voltage to add.
    pub injection: Injection,
}

impl Estimate {
    /// Angle (rad) and speed (rad/s) without injection: the measured current is controlled.
    #[inline]
    pub fn new(theta: f64, w: f64, sample: &Sample) -> Self {
        Self { theta, w, i: sample.i, injection: Injection::None }
    }
}

/// The life of an estimator: started at the first sample, updated at each later one. A step does not allocate.
pub trait Estimating: Sized {
    /// The estimator at the first sample, at the electrical angle `theta` (rad) and speed `w` (rad/s).
    fn start(context: &Context, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate);

    /// One sample.
    fn update(&mut self, context: &Context, sample: &Sample) -> Estimate;

    /// Puts the estimate at sample k to another electrical angle (rad) and speed (rad/s), known from elsewhere: while an
    /// I-f start leads the rotor, and by half a turn when a magnet turns out to point the other way.
    fn place(&mut self, context: &Context, sample: &Sample, theta: f64, w: f64) {
        *self = Self::start(context, sample, theta, w).0;
    }

    /// Parameters went from those of `old` to those of `new` after this sample. What the estimate was stays; where a gain
    /// acts directly on angle or speed the state takes up the difference.
    fn retune(&mut self, old: &Context, new: &Context) {
        let _ = (old, new);
    }

    /// Whether the parameters suit this estimator.
    ///
    /// # Errors
    /// Says which parameters do not, and why.
    fn validate(context: &Context) -> Result<(), Fault> {
        let _ = context;
        Ok(())
    }
}

/// The signal that a method finds the rotor by; it decides how a drive starts and which scenarios it can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// The stator flux. Starts by itself and holds standstill with the d-axis current of `zero_speed`.
    FluxObserver,
    /// The back EMF, which vanishes at standstill: an I-f start takes the rotor to a speed that shows it.
    BackEmf,
    /// The saliency, by an injected voltage: standstill and low speed, as far as the voltage suffices.
    Injection,
    /// Injection at low speed, the back EMF above.
    Hybrid,
    /// A sensor: the reference for all others.
    Sensored,
}

impl Class {
    /// Whether the method injects a voltage that finds the d axis at standstill.
    pub fn injects(self) -> bool {
        matches!(self, Self::Injection | Self::Hybrid)
    }
}

/// The list: value, name, state, class, standstill and description make the enumeration and the one place of dispatch.
macro_rules! estimators {
    ($($value:literal $name:ident($state:ty): $class:ident, standstill $standstill:literal, $description:literal;)*) => {
        enumeration! {
            /// The estimators, in the order of the interface: a value never changes, new ones are appended.
            #[derive(Serialize, Deserialize)]
            pub enum Kind("Estimator", "Estimator of rotor angle and speed") {
                $($value $name $description;)*
            }
        }

        impl Kind {
            /// The signal that it finds the rotor by.
            pub fn class(self) -> Class {
                match self {
                    $(Self::$name => Class::$class,)*
                }
            }

            /// Whether it holds a loaded rotor at standstill.
            pub fn holds_standstill(self) -> bool {
                match self {
                    $(Self::$name => $standstill,)*
                }
            }

            /// Whether the parameters suit this estimator.
            ///
            /// # Errors
            /// As [`Estimating::validate`]; the tracker cannot work.
            pub fn validate(self, context: &Context) -> Result<(), Fault> {
                tracker::validate(context)?;
                match self {
                    $(Self::$name => <$state>::validate(context),)*
                }
            }
        }

        /// The state of the estimator that is at work.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub enum Estimator {
            $(#[doc = $description] $name($state),)*
        }

        impl Estimator {
            /// As [`Estimating::start`].
            pub fn start(kind: Kind, context: &Context, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
                match kind {
                    $(Kind::$name => {
                        let (state, estimate) = <$state>::start(context, sample, theta, w);
                        (Self::$name(state), estimate)
                    })*
                }
            }

            /// As [`Estimating::update`].
            #[inline]
            pub fn update(&mut self, context: &Context, sample: &Sample) -> Estimate {
                match self {
                    $(Self::$name(state) => state.update(context, sample),)*
                }
            }

            /// As [`Estimating::retune`].
            pub fn retune(&mut self, old: &Context, new: &Context) {
                match self {
                    $(Self::$name(state) => state.retune(old, new),)*
                }
            }

            /// As [`Estimating::place`].
            pub fn place(&mut self, context: &Context, sample: &Sample, theta: f64, w: f64) {
                match self {
                    $(Self::$name(state) => state.place(context, sample, theta, w),)*
                }
            }
        }
    };
}

estimators! {
    1 Rasmussen(rasmussen::Rasmussen): FluxObserver, standstill true,
        "Full-order flux observer with PI speed adaptation, Rasmussen 2006, eq (16) and (21)";
    2 DirectEmf(direct_emf::DirectEmf): BackEmf, standstill false,
        "Back EMF calculated from the voltage equation, Kim & Sul 2011, eq (11) to (13)";
    3 EmfObserver(emf_observer::EmfObserver): BackEmf, standstill false,
        "State observer of the back EMF, Kim & Sul 2011, eq (14) and (15)";
    4 ExtendedEmf(extended_emf::ExtendedEmf): BackEmf, standstill false,
        "State observer of the extended EMF, Kim & Sul 2011, eq (16) to (23)";
    5 VoltageModel(voltage_model::VoltageModel): BackEmf, standstill false,
        "Voltage model, Kim & Sul 2011, eq (24) to (27)";
    6 CurrentModel(current_model::CurrentModel): BackEmf, standstill false,
        "Current model, Kim & Sul 2011, eq (28) to (30)";
    7 VoltageFeedback(voltage_feedback::VoltageFeedback): BackEmf, standstill false,
        "Feedback of the current controller's d-axis voltage, Kim & Sul 2011, eq (31) and (32)";
    8 RotatingInjection(rotating::RotatingInjection): Injection, standstill true,
        "Rotating voltage in stator axes, heterodyne, Kim & Sul 2011, eq (38) to (40)";
    9 PulsatingInjection(pulsating::PulsatingInjection): Injection, standstill true,
        "Pulsating voltage on the estimated d axis, Kim & Sul 2011, eq (42) to (45)";
    10 SquareWaveInjection(square_wave::SquareWaveInjection): Injection, standstill true,
        "Square-wave voltage at half the PWM frequency, Kim & Sul 2011, section III";
    11 NearPwmInjection(near_pwm::NearPwmInjection): Injection, standstill true,
        "Voltage with a period of three samples, Kim & Sul 2011, section III";
    12 Hybrid(hybrid::Hybrid): Hybrid, standstill true,
        "Square-wave injection at low speed, extended EMF above, Kim & Sul 2011, section IV";
    13 Sensored(sensored::Sensored): Sensored, standstill true,
        "Angle and speed of a sensor, theta_meas and speed_meas, Kim & Sul 2011, Fig. 1a";
    14 KalmanFilter(kalman::Kalman): BackEmf, standstill false,
        "Extended Kalman filter on stator flux, speed and angle, Kim & Sul 2011, section II.A";
}

impl Default for Estimator {
    fn default() -> Self {
        Self::Rasmussen(rasmussen::Rasmussen::default())
    }
}
