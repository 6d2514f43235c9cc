//! Intermediate updates: the importer exchanges values with a model within a communication step.

use crate::Model;

/// A continuous model that shows its outputs, and takes inputs, inside a communication step (intermediate update, FMI 3.0.2,
/// 4.2.2): an importer that requests it is called after each part of a step, where it reads and sets the rows that are marked
/// with [`intermediate`](crate::Row::intermediate), and may end the step.
///
/// Other importers get whole steps.
///
/// ```
/// # use fmu_core::unit::{METER, METER_PER_S, NEWTON};
/// # use fmu_core::*;
/// # use serde::{Deserialize, Serialize};
/// # #[derive(Clone, Default, Serialize, Deserialize)]
/// # struct Mass { force: f64, v: f64 }
/// # type V = Row<Block<Mass>>;
/// impl Model for Mass {
///     # type Outputs = f64;
///     # const INFO: Info = Info { name: "Mass", ..Info::DEFAULT };
///     # fn initialize(&mut self) {}
///     # fn output(&self, _: Elapsed, v: &mut f64) { *v = self.v; }
///     const TABLE: &'static Table<Block<Self>> = table![
///         V::input("force", &NEWTON, "Force", |m| &mut m.model.force).intermediate(),
///         V::output("v", &METER_PER_S, "Velocity", |m| &mut m.out).intermediate(),
///     ];
///
///     fn advance(&mut self, step: &Step) -> Result<(), Fault> {
///         integrate::smooth::<Self, { Self::SCALARS }>(self, step, 1e-3)
///     }
/// # }
/// # impl ContinuousTime for Mass {
/// #     const STATES: &'static [State<Self>] = &[State::new("v", &unit::METER_PER_S2, |m| &mut m.v)];
/// #     fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> { dx[0] = self.force; Ok(()) }
///     // ...
/// }
///
/// impl Intermediate for Mass {
///     fn longest(&self) -> f64 {
///         1e-3 // the substeps of `advance`
///     }
/// }
/// # const CAN: Capabilities<Mass> = Capabilities::NONE.ContinuousTime().Intermediate();
/// # assert!(CAN.intermediate.is_some());
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no intermediate updates: it lacks the capability `Intermediate`",
    note = "write `impl Intermediate for {Self}`, or remove `Intermediate` from the line that exports the model"
)]
pub trait Intermediate: Model {
    /// The longest part of a communication step (s). A step is divided into the minimum number of equal parts, and
    /// [`advance`](Model::advance) runs for each of them. If this is the length of the substeps of `advance`, as in the
    /// integrators of [`integrate`](mod@crate::integrate), the parts together give the bits of the whole step.
    fn longest(&self) -> f64;
}
