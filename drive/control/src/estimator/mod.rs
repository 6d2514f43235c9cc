//! Estimators of rotor angle and speed: each has one file and one row in the list in this module.
//!
//! At sample k an estimator receives a [`Sample`]: the currents at that instant and the voltage that acted since the
//! previous sample. It returns an [`Estimate`]: angle and speed at that instant, the current to control, and, if it
//! injects a carrier, the voltage to add to this sample's command. A [`Context`] supplies the other inputs (machine
//! estimates, inertia, its parameters).
//!
//! A new estimator implements [`Estimating`] and adds a row to the list at the end of this file. If it has parameters
//! of its own, it also adds a row to [`tables`]. The list row states the method's type ([`Class`]) and whether it holds
//! standstill. The estimator then appears in the enumeration, the FMUs, their documentation and every scenario of the
//! comparison.

pub mod carrier;
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
mod setup;
pub mod sliding_mode;
pub mod square_wave;
pub mod tables;
#[cfg(test)]
pub(crate) mod testing;
pub mod tracker;
pub mod voltage_feedback;
pub mod voltage_model;

use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated, Turn};
use drive_base::motor::Motor;
use fmu_core::{Fault, enumeration};
use serde::{Deserialize, Serialize};
pub use setup::Setup;
pub use tables::EstimatorParameters;

/// The controller's inputs to an estimator at sample k.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Sample number, 0 at the start.
    pub k: u64,
    /// Stator current measured at sample k, in A.
    pub i: AlphaBeta,
    /// Stator current measured at sample k - 1, in A; the first sample repeats the current of sample 0.
    pub i_last: AlphaBeta,
    /// Stator voltage command that acted in [k - 1, k), in V: limited, with injection, without dead-time compensation
    /// (with `compensation.observe`: with it, less what the legs lose at the measured currents), held in stator axes. It
    /// is the command of sample k - 1 - delay, and so is the injection in it: identify the carrier from `u_injected`, not
    /// from the most recently requested sign.
    pub u: AlphaBeta,
    /// The injected part of `u`, in V, reduced in the same way as `u` if the voltage limit applied.
    pub u_injected: AlphaBeta,
    /// Output of the current PI at sample k - 1, without feed-forward and injection, in V.
    pub u_pi: DqHat,
    /// Current references of sample k - 1, in A.
    pub i_ref: DqHat,
    /// Torque reference of sample k - 1, limited, in N.m.
    pub tau_ref: f64,
    /// Least bandwidth of a tracker in rad/s that field weakening requires; 0: none.
    pub rho: f64,
    /// Electrical angle from a sensor in rad.
    pub theta_meas: f64,
    /// Electrical speed from a sensor in rad/s.
    pub w_meas: f64,
    /// DC-link voltage in V.
    pub u_dc: f64,
    /// Mechanical speed reference in rad/s; none in torque mode.
    pub speed_ref: Option<f64>,
}

/// An estimator's inputs in addition to the sample: parameters and the controller's estimates.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a> {
    /// The estimators' parameters.
    pub par: &'a EstimatorParameters,
    /// Estimates of the machine.
    pub motor: &'a Motor,
    /// Estimate of the inertia in kg.m2.
    pub J: f64,
    /// Sample period in s.
    pub T_s: f64,
}

/// A voltage to add to this sample's command, in V.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Injection {
    /// None.
    #[default]
    None,
    /// In stator axes.
    Stator(AlphaBeta),
    /// In the estimated rotor frame, transformed like the command: at the angle in the middle of the interval in which
    /// it acts.
    Estimated(DqHat),
}

impl Injection {
    /// Its magnitude in V.
    #[inline]
    pub fn magnitude(self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Stator(u) => u.magnitude(),
            Self::Estimated(u) => u.magnitude(),
        }
    }
}

/// An estimator's results at sample k, and the voltage it requests.
#[derive(Clone, Copy, Debug, Default)]
pub struct Estimate {
    /// Electrical rotor angle in rad, not wrapped.
    pub theta: f64,
    /// The estimated d-axis at this angle.
    pub axis: Axis<Estimated>,
    /// Electrical speed in rad/s.
    pub w: f64,
    /// The rotation by `w` in half a sample, if the estimator has needed it.
    pub half: Option<Turn>,
    /// Stator current to control in A: the measured current without the carrier.
    pub i: AlphaBeta,
    /// Voltage to add.
    pub injection: Injection,
}

impl Estimate {
    /// Angle (rad) and speed (rad/s) without injection: the drive controls the measured current.
    #[inline]
    pub fn new(theta: f64, w: f64, sample: &Sample) -> Self {
        Self::injecting(theta, w, sample.i, Injection::None)
    }

    /// Angle (rad) and speed (rad/s), the current `i` (A) to control and the voltage to add.
    #[inline]
    pub fn injecting(theta: f64, w: f64, i: AlphaBeta, injection: Injection) -> Self {
        Self { theta, axis: Axis::at(theta), w, half: None, i, injection }
    }
}

/// The interface of an estimator: it starts at the first sample and updates at each later one. A step does not
/// allocate.
pub trait Estimating: Sized {
    /// The estimator at the first sample, at the electrical angle `theta` (rad) and speed `w` (rad/s).
    fn start(context: &Context, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate);

    /// Processes one sample.
    fn update(&mut self, context: &Context, sample: &Sample) -> Estimate;

    /// Sets the estimate at sample k to an electrical angle (rad) and speed (rad/s) from another source: during an I-f
    /// start, which leads the rotor, and by half a turn when the magnet polarity turns out to be reversed.
    fn place(&mut self, context: &Context, sample: &Sample, theta: f64, w: f64) {
        *self = Self::start(context, sample, theta, w).0;
    }

    /// Adapts the state after the parameters changed from `old` to `new` after this sample. The estimate stays the
    /// same; where a gain acts directly on angle or speed, the state absorbs the difference.
    fn retune(&mut self, old: &Context, new: &Context) {
        let _ = (old, new);
    }

    /// Stator resistance in Ohm that the estimator uses: the estimate `R_s` of the motor, unless it adapts it; called only
    /// with `adaptation.resistance`.
    fn resistance(&self, par: &EstimatorParameters, motor: &Motor) -> f64 {
        let _ = par;
        motor.R_s
    }

    /// Checks that this estimator can work in the controller.
    ///
    /// # Errors
    /// States which parameters are unsuitable, and why.
    fn validate(setup: &Setup) -> Result<(), Fault> {
        let _ = setup;
        Ok(())
    }
}

/// The signal from which a method finds the rotor; it determines how a drive starts and which scenarios it can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// The stator flux. The method starts by itself and holds standstill with the d-axis current of `zero_speed`.
    FluxObserver,
    /// The back EMF, which vanishes at standstill: an I-f start accelerates the rotor until the EMF is large enough.
    BackEmf,
    /// The saliency, by an injected voltage: for standstill and low speed, as far as the voltage suffices.
    Injection,
    /// Injection at low speed, the back EMF above.
    Hybrid,
    /// A sensor: the reference for all others.
    Sensored,
}

impl Class {
    /// Whether the method injects a voltage that finds the d-axis at standstill.
    pub fn injects(self) -> bool {
        matches!(self, Self::Injection | Self::Hybrid)
    }
}

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
            /// The signal from which it finds the rotor.
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

            /// Checks that this estimator can work in the controller.
            ///
            /// # Errors
            /// Those of [`Estimating::validate`]; an option that the estimator does not have; a tracker that cannot work.
            pub fn validate(self, setup: &Setup) -> Result<(), Fault> {
                tracker::validate(setup)?;
                options::validate(setup)?;
                resistance::validate(setup)?;
                match self {
                    $(Self::$name => <$state>::validate(setup),)*
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
            pub fn resistance(&self, par: &EstimatorParameters, motor: &Motor) -> f64 {
                if !par.adaptation.resistance {
                    return motor.R_s;
                }
                match self {
                    $(Self::$name(state) => state.resistance(par, motor),)*
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
