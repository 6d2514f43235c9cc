//! The DC link of `PmsmDrive`: source with a resistance, capacitor, precharge and brake chopper.
//!
//! ```text
//! C du/dt = i_source - i_chopper - i_dc      i_source = (u_dc - u) / R      i_chopper = u / R_chopper while it is on
//! ```
//!
//! `u_dc` is then the voltage of the source; inverter and controller have the capacitor's voltage u. With
//! `dc_link.R_precharge` the capacitor is empty at the start and charges through this resistance in series with R_source,
//! until a sample measures 95 % of the source's voltage; until then, the controller rests. The chopper switches on at
//! `chopper.u_on` and off at `chopper.u_off`. Beyond the limits of a battery its current is constant, and a rectifier blocks.
//!
//! In Co-Simulation the link advances with each interval of the plant's steps, from the energy transferred in it (`circuit`);
//! the plant has the voltage at the start of the interval. In Model Exchange u is a continuous state, the switching of the
//! chopper is a state event, and the energies follow from the same circuit between two points of the solution.

mod circuit;
mod link;
mod outputs;
mod parameters;
pub mod ripple;
mod settled;
mod source;

pub use circuit::LinkEnergy;
pub use link::Link;
pub use outputs::{LINK_OUTPUTS, LinkOutputs};
pub use parameters::{Chopper, DcLink, DcSource, LINK, LinkParameters};
pub(crate) use settled::SettledLink;
