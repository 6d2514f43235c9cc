//! Capabilities of a model with differential equations: its states and derivatives, and their tangent.

use crate::{Account, Elapsed, Fault, Model, unit::Quantity};
use std::slice;

/// Location of a state in the model `M`.
enum Place<M: 'static> {
    One(fn(&mut M) -> &mut f64),
    /// Maximum number of elements, and their location.
    Many(usize, fn(&mut M) -> &mut [f64]),
}

/// A continuous state of the model `M`, or an array of states.
pub struct State<M: 'static> {
    /// Name of a continuous real row of the table: an output, or a row made by [`Row::state`](crate::Row::state). The
    /// row's nominal value scales the solver's error.
    pub name: &'static str,
    /// Quantity of the derivative, `der(name)`.
    pub rate: &'static Quantity,
    /// An event may change it.
    pub reinit: bool,
    place: Place<M>,
}

impl<M: 'static> State<M> {
    /// A state that no event changes.
    pub const fn new(name: &'static str, rate: &'static Quantity, at: fn(&mut M) -> &mut f64) -> Self {
        Self { name, rate, reinit: false, place: Place::One(at) }
    }

    /// An array of states that no event changes: `name` is a row of an array with `dimension` elements. The elements are
    /// consecutive in all calls, and their number is that in the model: see [`Resizable`](crate::Resizable).
    pub const fn array(
        name: &'static str,
        rate: &'static Quantity,
        dimension: usize,
        at: fn(&mut M) -> &mut [f64],
    ) -> Self {
        Self { name, rate, reinit: false, place: Place::Many(dimension, at) }
    }

    /// The state `of` a part of the model that has the rows of its table under the same names.
    pub const fn of_part<P>(of: &State<P>, at: fn(&mut M) -> &mut f64) -> Self {
        Self { name: of.name, rate: of.rate, reinit: of.reinit, place: Place::One(at) }
    }

    /// Marks the state as one that an event may change.
    pub const fn reinit(mut self) -> Self {
        self.reinit = true;
        self
    }

    /// Maximum number of elements of an array; `None` for a scalar state.
    pub const fn dimension(&self) -> Option<usize> {
        match self.place {
            Place::One(_) => None,
            Place::Many(dimension, _) => Some(dimension),
        }
    }

    /// Maximum number of its scalar states.
    pub const fn most(&self) -> usize {
        match self.place {
            Place::One(_) => 1,
            Place::Many(dimension, _) => dimension,
        }
    }

    /// The value in the model.
    ///
    /// # Panics
    /// The state is an array.
    #[inline]
    pub fn at<'a>(&self, model: &'a mut M) -> &'a mut f64 {
        match self.place {
            Place::One(at) => at(model),
            Place::Many(..) => panic!("the state {} is an array", self.name),
        }
    }

    /// The values in the model: one, or all of an array.
    #[inline]
    pub fn all<'a>(&self, model: &'a mut M) -> &'a mut [f64] {
        match self.place {
            Place::One(at) => slice::from_mut(at(model)),
            Place::Many(_, at) => at(model),
        }
    }
}

/// Number of scalar states, with the maximum sizes of arrays.
pub(crate) const fn scalars<M>(states: &[State<M>]) -> usize {
    let (mut sum, mut i) = (0, 0);
    while i < states.len() {
        (sum, i) = (sum + states[i].most(), i + 1);
    }
    sum
}

/// A model with continuous states: dx/dt = f(x, u, t). It can be exported for Model Exchange, and gives derivatives of
/// its outputs.
///
/// Between two events, f is continuous: a relation that switches an equation is a discrete variable that only
/// [`Events::event`](crate::Events::event) changes.
pub trait ContinuousTime: Model {
    /// The states, in the order of all calls.
    const STATES: &'static [State<Self>];

    /// Number of scalar states, with the maximum sizes of arrays. An integrator takes it, as in
    /// `integrate::smooth::<Self, { Self::SCALARS }>`, so that the number need not be written.
    const SCALARS: usize = scalars(Self::STATES);

    /// Writes the derivatives dx/dt for the present states and inputs to `dx`, in the order of [`STATES`](Self::STATES); an
    /// array has one for each of its elements in the model. It does not allocate, and its result does not depend on earlier
    /// steps.
    ///
    /// # Errors
    /// The derivatives do not exist here: the solver tries a shorter step.
    fn derivatives(&self, now: Elapsed, dx: &mut [f64]) -> Result<(), Fault>;

    /// Called after the importer has set states; recomputes the values that the model derives from them.
    fn settle(&mut self) {}

    /// The outputs at an instant, in Model Exchange: a mean over a step becomes the instantaneous value.
    fn observe(&self, now: Elapsed, outputs: &mut Self::Outputs) {
        self.output(now, outputs);
    }

    /// Writes the rate of every output that accumulates, such as an energy counter, to the field of that output, and leaves the
    /// other fields alone. The rates are part of the output derivatives of Co-Simulation.
    fn integrands(&self, _now: Elapsed, _outputs: &mut Self::Outputs) {}
}

/// A continuous model that is called at every accepted point of the solution in Model Exchange, for example to integrate a
/// quantity between two points.
///
/// A solver also tries states that it later rejects, and a model without this trait cannot distinguish them from accepted ones.
/// In Co-Simulation, [`Model::advance`] computes the solution, and this trait is not used.
pub trait CompletedSteps: ContinuousTime {
    /// The solution passes through the present states, inputs and time: a step of the importer's solver is complete, or Event
    /// Mode begins (before [`Events::begin`](crate::Events::begin)) or ends. Time does not decrease from call to call, unless
    /// [`account`](Self::account) takes counts back. An importer that ignores the request for completed steps calls at events
    /// only.
    ///
    /// # Errors
    /// Returns the reason why the model cannot continue.
    fn complete(&mut self, now: Elapsed) -> Result<(), Fault>;

    /// Copies the counts after [`complete`](Self::complete), or restores earlier ones: some importers complete
    /// steps that their solver then rejects. [`Kept`](crate::Kept) does both.
    fn account(&mut self, account: Account);
}

/// A continuous model with its own tangent, for example by [`Dual`](crate::Dual) numbers. Without it, the exporter uses central
/// differences.
pub trait Differentiable: ContinuousTime {
    /// The directional derivative of the derivatives (to `dx`) and of the continuous outputs (to `outputs`) along `along`,
    /// which has a component for each state and continuous input. The real outputs are zero before the call.
    ///
    /// # Errors
    /// The derivatives do not exist here.
    fn tangent(&self, now: Elapsed, along: &Self, dx: &mut [f64], outputs: &mut Self::Outputs) -> Result<(), Fault>;
}
