//! The start with the gates on: 0 V, where a turning rotor shows, then the pulses of the [probe](super::probe).

use super::bench::{Bench, Part, Sample};
use super::probe::{Probe, Probed};
use super::status::CommissionFault as Fault;
use drive_base::frame::AlphaBeta;
use serde::{Deserialize, Serialize};

/// 0 V, then pulses.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Probing {
    /// Samples with 0 V.
    k: f64,
    /// 0 V is over.
    pulses: bool,
    probe: Probe,
}

impl Probing {
    /// One sample; at the end, the probe, and the bench has the inductances.
    pub(super) fn update(&mut self, bench: &mut Bench, sample: &Sample) -> Result<Part<Probe>, Fault> {
        if self.pulses {
            return match self.probe.update(bench, sample) {
                Probed::Voltage(u) => Ok(Part::Voltage(u)),
                Probed::Refused(fault) => Err(fault),
                Probed::Done(L_c, tensor) => {
                    (bench.L_c, bench.tensor) = (L_c, tensor);
                    Ok(Part::Over(self.probe.clone()))
                }
            };
        }
        self.k += 1.0;
        if sample.i.magnitude() > 0.05 * bench.I + 4.0 * bench.sigma {
            return Err(Fault::NotFollowing);
        }
        self.pulses = self.k * bench.T > 0.02 && self.k >= 200.0;
        Ok(Part::Voltage(AlphaBeta::ZERO))
    }
}
