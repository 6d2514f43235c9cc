//! The interface that every estimator implements: its inputs from the controller, its results, and the controller data that it
//! may read.

use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated, Turn};
use drive_base::motor::Motor;
use fmu_core::Fault;
use std::fmt::Display;

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
    /// Minimum bandwidth of a tracker in rad/s that field weakening requires; 0: none.
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
#[derive(Debug)]
pub struct ContextOf<'a, All> {
    /// The estimators' parameters: each estimator takes the parts that it names.
    pub par: &'a All,
    /// Estimates of the machine.
    pub motor: &'a Motor,
    /// Estimate of the inertia in kg.m2.
    pub J: f64,
    /// Sample period in s.
    pub T_s: f64,
}

impl<All> Clone for ContextOf<'_, All> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<All> Copy for ContextOf<'_, All> {}

impl<'a, All> ContextOf<'a, All> {
    /// The part of the parameters that belongs to one method.
    #[inline]
    pub fn of<T: 'a>(&self) -> &'a T
    where
        All: AsRef<T>,
    {
        self.par.as_ref()
    }
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
/// allocate. `All` contains the parameters of all estimators; an implementation names those that it reads.
pub trait Estimating<All>: Sized {
    /// The estimator at the first sample, at the electrical angle `theta` (rad) and speed `w` (rad/s).
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate);

    /// Processes one sample.
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate;

    /// Sets the estimate at sample k to an electrical angle (rad) and speed (rad/s) from another source: during an I-f
    /// start, which leads the rotor, and by half a turn when the magnet polarity turns out to be reversed.
    fn place(&mut self, context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) {
        *self = Self::start(context, sample, theta, w).0;
    }

    /// Adapts the state after the parameters changed from `old` to `new` after this sample. The estimate stays the
    /// same; where a gain acts directly on angle or speed, the state absorbs the difference.
    fn retune(&mut self, old: &ContextOf<All>, new: &ContextOf<All>) {
        let _ = (old, new);
    }

    /// Stator resistance in Ohm that the estimator uses: the estimate `R_s` of the motor, unless it adapts it; called only
    /// with `adaptation.resistance`.
    fn resistance(&self, context: &ContextOf<All>) -> f64 {
        context.motor.R_s
    }

    /// Checks that this estimator can work in the controller.
    ///
    /// # Errors
    /// States which parameters are unsuitable, and why.
    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        let _ = setup;
        Ok(())
    }
}

/// The signal used to locate the rotor; it determines how a drive starts and which scenarios it can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// The stator flux. The method starts on its own power and works at standstill with the d-axis current of `zero_speed`.
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
    /// Whether the method finds the d-axis at standstill by injecting a voltage.
    pub fn injects(self) -> bool {
        matches!(self, Self::Injection | Self::Hybrid)
    }
}

/// The controller around an estimator.
#[expect(clippy::struct_excessive_bools, reason = "settings of the controller, each on its own")]
pub struct SetupOf<'a, All> {
    /// The estimators' parameters.
    pub par: &'a All,
    /// Estimates of the machine.
    pub motor: &'a Motor,
    /// Estimate of the inertia in kg.m2.
    pub J: f64,
    /// Sample period in s.
    pub T_s: f64,
    /// The current loop decouples with the references.
    pub reference_feed_forward: bool,
    /// The current loop has an active resistance.
    pub active_resistance: bool,
    /// The start locates the rotor by injection.
    pub starts_by_injection: bool,
    /// Whether the current at standstill follows the torque.
    pub by_need: bool,
    /// Field weakening is in use.
    pub weakens: bool,
    /// Overmodulation is in use.
    pub overmodulates: bool,
    /// Name, value and unit of the controller's variable with this name.
    pub tell: &'a dyn Fn(&str) -> String,
}

impl<'a, All> SetupOf<'a, All> {
    /// The part of the parameters that belongs to one method.
    pub fn of<T: 'a>(&self) -> &'a T
    where
        All: AsRef<T>,
    {
        self.par.as_ref()
    }

    /// Name, value and unit of the controller's variable `name`: for messages.
    pub fn tell(&self, name: &str) -> String {
        (self.tell)(name)
    }

    /// A fault of the variable `name`: its name, value and unit, and what is `allowed`.
    pub fn fault(&self, name: &str, allowed: impl Display) -> Fault {
        Fault::new(format!("{} is not allowed: {allowed}", self.tell(name)))
    }
}
