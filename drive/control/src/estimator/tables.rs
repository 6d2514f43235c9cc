//! The estimators' parameters: each part has its own prefix.

use crate::estimator::carrier::{CARRIER, CarrierParameters};
use crate::estimator::emf::{EMF, EmfParameters};
use crate::estimator::flux_observer::{FLUX_OBSERVER, FluxObserverParameters};
use crate::estimator::follower::{MATSUI, MatsuiParameters};
use crate::estimator::gradient::{GRADIENT, GradientParameters};
use crate::estimator::hybrid::{HYBRID, HybridParameters};
use crate::estimator::kalman::{KALMAN, KalmanParameters};
use crate::estimator::near_pwm::{NEAR_PWM, NearPwmParameters};
use crate::estimator::pulsating::{PULSATING, PulsatingParameters};
use crate::estimator::rasmussen::{RASMUSSEN, RasmussenParameters};
use crate::estimator::resistance::{ADAPTATION, ResistanceParameters};
use crate::estimator::sliding_mode::{SLIDING_MODE, SlidingModeParameters};
use crate::estimator::square_wave::{SQUARE_WAVE, SquareWaveParameters};
use crate::estimator::tracker::{TRACKER, TrackerParameters};
use fmu_core::{Part, Row, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters of all estimators; each estimator reads its own part.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EstimatorParameters {
    /// The Rasmussen observer.
    pub rasmussen: RasmussenParameters,
    /// Adaptation of the resistance.
    pub adaptation: ResistanceParameters,
    /// The flux observer.
    pub flux_observer: FluxObserverParameters,
    /// The tracker of the estimators that calculate an angle error.
    pub tracker: TrackerParameters,
    /// The back-EMF estimators.
    pub emf: EmfParameters,
    /// Voltage model and current model.
    pub matsui: MatsuiParameters,
    /// The Kalman filter.
    pub kalman: KalmanParameters,
    /// The gradient observer.
    pub gradient: GradientParameters,
    /// The sliding-mode observer.
    pub sliding_mode: SlidingModeParameters,
    /// The sinusoidal carrier of rotating and pulsating injection.
    pub carrier: CarrierParameters,
    /// Pulsating injection.
    pub pulsating: PulsatingParameters,
    /// Square-wave injection.
    pub square_wave: SquareWaveParameters,
    /// Injection near the PWM frequency.
    pub near_pwm: NearPwmParameters,
    /// The hybrid.
    pub hybrid: HybridParameters,
}

type P = Row<EstimatorParameters>;

/// The estimators' variables, with their prefixes: the flux observers, the back-EMF methods, the injection methods, and the
/// hybrid of two.
pub const ESTIMATOR_PARAMETERS: &Table<EstimatorParameters> = table![
    P::part("rasmussen.", &Part { table: RASMUSSEN, lens: |p| &mut p.rasmussen }),
    P::part("adaptation.", &Part { table: ADAPTATION, lens: |p| &mut p.adaptation }),
    P::part("flux_observer.", &Part { table: FLUX_OBSERVER, lens: |p| &mut p.flux_observer }),
    P::part("tracker.", &Part { table: TRACKER, lens: |p| &mut p.tracker }),
    P::part("emf.", &Part { table: EMF, lens: |p| &mut p.emf }),
    P::part("matsui.", &Part { table: MATSUI, lens: |p| &mut p.matsui }),
    P::part("kalman.", &Part { table: KALMAN, lens: |p| &mut p.kalman }),
    P::part("gradient.", &Part { table: GRADIENT, lens: |p| &mut p.gradient }),
    P::part("sliding_mode.", &Part { table: SLIDING_MODE, lens: |p| &mut p.sliding_mode }),
    P::part("carrier.", &Part { table: CARRIER, lens: |p| &mut p.carrier }),
    P::part("pulsating.", &Part { table: PULSATING, lens: |p| &mut p.pulsating }),
    P::part("square_wave.", &Part { table: SQUARE_WAVE, lens: |p| &mut p.square_wave }),
    P::part("near_pwm.", &Part { table: NEAR_PWM, lens: |p| &mut p.near_pwm }),
    P::part("hybrid.", &Part { table: HYBRID, lens: |p| &mut p.hybrid }),
];

/// Each method takes its own part.
macro_rules! parts {
    ($($field:ident: $part:ty,)*) => {
        $(impl AsRef<$part> for EstimatorParameters {
            #[inline]
            fn as_ref(&self) -> &$part {
                &self.$field
            }
        })*
    };
}

parts! {
    rasmussen: RasmussenParameters,
    adaptation: ResistanceParameters,
    flux_observer: FluxObserverParameters,
    tracker: TrackerParameters,
    emf: EmfParameters,
    matsui: MatsuiParameters,
    kalman: KalmanParameters,
    gradient: GradientParameters,
    sliding_mode: SlidingModeParameters,
    carrier: CarrierParameters,
    pulsating: PulsatingParameters,
    square_wave: SquareWaveParameters,
    near_pwm: NearPwmParameters,
    hybrid: HybridParameters,
}
