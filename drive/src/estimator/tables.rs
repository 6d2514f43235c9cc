//! The estimators' parameters: one part each, under its own prefix.

use crate::estimator::emf::{EMF, EmfParameters};
use crate::estimator::follower::{FOLLOWER, FollowerParameters};
use crate::estimator::rasmussen::{OBSERVER, RasmussenParameters};
use crate::estimator::tracker::{TRACKER, TrackerParameters};
use fmu_core::{Part, Row, Table};
use serde::{Deserialize, Serialize};

/// Parameters of all estimators; each reads its own part.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EstimatorParameters {
    /// The Rasmussen observer.
    pub observer: RasmussenParameters,
    /// The tracker of those that find an angle error.
    pub tracker: TrackerParameters,
    /// Those on the EMF.
    pub emf: EmfParameters,
    /// Voltage model and current model.
    pub model: FollowerParameters,
}

type P = Row<EstimatorParameters>;

/// The estimators' variables, with their prefixes.
pub const ESTIMATOR_PARAMETERS: &Table<EstimatorParameters> = &Table::new(
    const {
        &[
            P::part("observer.", &Part { table: OBSERVER, lens: |p| &mut p.observer }),
            P::part("tracker.", &Part { table: TRACKER, lens: |p| &mut p.tracker }),
            P::part("emf.", &Part { table: EMF, lens: |p| &mut p.emf }),
            P::part("model.", &Part { table: FOLLOWER, lens: |p| &mut p.model }),
        ]
    },
);
