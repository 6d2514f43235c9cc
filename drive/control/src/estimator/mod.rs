//! Estimators of rotor angle and speed: each has one file and one row in the list in this module.
//!
//! At sample k an estimator receives a [`Sample`]: the currents at that instant and the voltage that acted since the
//! previous sample. It returns an [`Estimate`]: angle and speed at that instant, the current to control, and, if it
//! injects a carrier, the voltage to add to this sample's command. A [`Context`] supplies the other inputs (machine
//! estimates, inertia, its parameters).
//!
//! A new estimator implements [`Estimating`] and adds a row to the list at the end of this file. If it has new
//! parameters, it also adds a row to [`tables`]. The list row states the method's type ([`Class`]) and whether it works at
//! standstill. The estimator then appears in the enumeration, the FMUs, their documentation and every scenario of the
//! comparison.

pub mod carrier;
pub mod contract;
pub mod current_model;
pub mod direct_emf;
pub mod emf;
pub mod emf_observer;
pub mod extended_emf;
pub mod flux_observer;
pub mod follower;
pub mod gradient;
pub mod hybrid;
pub mod interval;
pub mod kalman;
pub mod near_pwm;
pub mod options;
pub mod pulsating;
pub mod rasmussen;
pub mod resistance;
pub mod rotating;
pub mod saliency;
pub mod sensored;
pub mod sliding_mode;
pub mod square_wave;
pub mod tables;
#[cfg(test)]
pub(crate) mod testing;
pub mod tracker;
pub mod voltage_feedback;
pub mod voltage_model;

pub use contract::{Class, Estimate, Estimating, Injection, Sample};
use fmu_core::{Fault, enumeration};
use serde::{Deserialize, Serialize};
pub use tables::EstimatorParameters;

/// An estimator's inputs in addition to the sample, with the parameters of all estimators.
pub type Context<'a> = contract::ContextOf<'a, EstimatorParameters>;

/// The controller around an estimator, with the parameters of all estimators.
pub type Setup<'a> = contract::SetupOf<'a, EstimatorParameters>;

/// The list: value, name, state, class, standstill and description define the enumeration and the single dispatch.
macro_rules! estimators {
    ($($value:literal $name:ident($state:ty): $class:ident, standstill $standstill:literal, $description:literal;)*) => {
        enumeration! {
            /// The estimators, in the order of the interface: values never change; new estimators are appended.
            #[derive(Serialize, Deserialize)]
            pub enum Kind("Estimator", "Estimator of rotor angle and speed") {
                $($value $name $description;)*
            }
        }

        impl Kind {
            /// The signal used to locate the rotor.
            pub fn class(self) -> Class {
                match self {
                    $(Self::$name => Class::$class,)*
                }
            }

            /// Whether it can hold a loaded rotor at standstill.
            pub fn holds_standstill(self) -> bool {
                match self {
                    $(Self::$name => $standstill,)*
                }
            }

            /// Checks that this estimator can work in the controller.
            ///
            /// # Errors
            /// Those of [`Estimating::validate`], and of the resistance adaptation.
            pub fn validate(self, setup: &Setup) -> Result<(), Fault> {
                resistance::validate(setup)?;
                match self {
                    $(Self::$name => <$state as Estimating<EstimatorParameters>>::validate(setup),)*
                }
            }
        }

        /// The state of the active estimator.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub enum Estimator {
            $(#[doc = $description] $name($state),)*
        }

        impl Estimator {
            /// See [`Estimating::start`].
            pub fn start(kind: Kind, context: &Context, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
                match kind {
                    $(Kind::$name => {
                        let (state, estimate) = <$state>::start(context, sample, theta, w);
                        (Self::$name(state), estimate)
                    })*
                }
            }

            /// See [`Estimating::update`].
            #[inline]
            pub fn update(&mut self, context: &Context, sample: &Sample) -> Estimate {
                match self {
                    $(Self::$name(state) => state.update(context, sample),)*
                }
            }

            /// See [`Estimating::retune`].
            pub fn retune(&mut self, old: &Context, new: &Context) {
                match self {
                    $(Self::$name(state) => state.retune(old, new),)*
                }
            }

            /// See [`Estimating::resistance`].
            #[inline]
            pub fn resistance(&self, context: &Context) -> f64 {
                if !context.par.adaptation.resistance {
                    return context.motor.R_s;
                }
                match self {
                    $(Self::$name(state) => state.resistance(context),)*
                }
            }

            /// See [`Estimating::place`].
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
    15 FluxObserver(flux_observer::FluxObserver): FluxObserver, standstill true,
        "Flux observer in stator axes with adaptation of resistance and magnet flux, Hinkkanen et al. 2018";
    16 GradientObserver(gradient::GradientObserver): BackEmf, standstill false,
        "Gradient observer of the stator flux, Ortega et al. 2011, or its clamped form";
    17 SlidingMode(sliding_mode::SlidingMode): BackEmf, standstill false,
        "Sliding-mode observer of the back EMF in stator axes, of application notes";
}

impl Default for Estimator {
    fn default() -> Self {
        Self::Rasmussen(rasmussen::Rasmussen::default())
    }
}
