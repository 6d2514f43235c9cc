//! Capabilities of a model beyond co-simulation: a table of its functions, built at compile time.
//!
//! A capability is a separate trait, named in the line that exports the model. A capability that is not named costs nothing:
//! its entry is `None` at compile time.

use crate::clock::Clocked;
use crate::continuous::{CompletedSteps, ContinuousTime, Differentiable, State};
use crate::events::{EventMode, Events, Indicator, Next, Outcome, Sampled, Stop};
use crate::intermediate::Intermediate;
use crate::log::Warnings;
use crate::model::Block;
use crate::row::Slot;
use crate::rules::can_be_state;
use crate::saved::{Keeps, Saved, Saving, Stored, Storing};
use crate::sizes::Resizable;
use crate::table::WIDE;
use crate::variable::Meta;
use crate::{Account, Elapsed, Fault, Hash, Model, Step};
use std::marker::PhantomData;

/// A model with warnings for the importer's log.
pub trait Warns: Model {
    /// Passes warnings for the user to `log`; called after every step and event while the importer has warnings switched on.
    /// Each message appears at most once in a second of simulated time.
    fn warn(&self, log: &mut Warnings<'_>);
}

/// The functions of [`ContinuousTime`].
pub struct Continuous<M: Model> {
    /// [`ContinuousTime::STATES`].
    pub states: &'static [State<M>],
    /// [`ContinuousTime::derivatives`].
    pub derivatives: fn(&M, Elapsed, &mut [f64]) -> Result<(), Fault>,
    /// [`ContinuousTime::settle`].
    pub settle: fn(&mut M),
    /// [`ContinuousTime::observe`].
    pub observe: fn(&M, Elapsed, &mut M::Outputs),
    /// [`ContinuousTime::integrands`].
    pub integrands: fn(&M, Elapsed, &mut M::Outputs),
}

/// The functions of [`Events`].
pub struct Eventful<M: Model> {
    /// [`Events::INDICATORS`].
    pub list: &'static [Indicator],
    /// [`Events::indicators`].
    pub indicators: fn(&M, Elapsed, &mut [f64]),
    /// [`Events::begin`].
    pub begin: fn(&mut M, Elapsed),
    /// [`Events::event`].
    pub event: fn(&mut M, Elapsed) -> Result<Outcome, Fault>,
    /// [`Events::next`].
    pub next: fn(&M, Elapsed) -> Next,
}

/// The functions of [`Sampled`].
pub struct Samples<M: Model> {
    /// [`Sampled::period`].
    pub period: fn(&M) -> f64,
    /// [`Sampled::samples`].
    pub samples: fn(&M) -> u64,
    /// [`Sampled::show`].
    pub show: fn(&mut M),
    /// [`Sampled::sample`].
    pub sample: fn(&mut M) -> Result<(), Fault>,
    /// [`bounded`](crate::events::bounded).
    pub bounded: fn(&M, Elapsed) -> Result<(), Fault>,
}

/// The functions of [`Clocked`].
pub struct ClockFunctions<M: Model> {
    /// [`Clocked::FEEDTHROUGH`].
    pub feedthrough: bool,
    /// [`Clocked::activate`].
    pub activate: fn(&mut M, usize, Elapsed),
    /// [`Clocked::tick`].
    pub tick: fn(&mut M, usize, Elapsed) -> Result<(), Fault>,
    /// [`Clocked::interval`].
    pub interval: fn(&M, usize, Elapsed) -> Option<f64>,
    /// [`Clocked::ticked`].
    pub ticked: fn(&mut M, usize) -> bool,
}

/// [`Differentiable::tangent`].
pub type Tangent<M> = fn(&M, Elapsed, &M, &mut [f64], &mut <M as Model>::Outputs) -> Result<(), Fault>;

/// The functions of [`CompletedSteps`].
pub struct Completing<M: Model> {
    /// [`CompletedSteps::complete`].
    pub complete: fn(&mut M, Elapsed) -> Result<(), Fault>,
    /// [`CompletedSteps::account`].
    pub account: fn(&mut M, Account),
}

/// [`Resizable::resize`].
pub type Resize<M> = fn(&mut M) -> Result<(), Fault>;

/// [`EventMode::to_event`].
pub type ToEvent<M> = fn(&mut M, &Step) -> Result<Stop, Fault>;

/// The capabilities of the model `M`: `Capabilities::NONE.ContinuousTime().Events()`. A method exists only if the model
/// implements the trait of its name.
pub struct Capabilities<M: Model> {
    /// Functions of a [`Saved`] model.
    pub saved: Option<Saving<M>>,
    /// Functions of a [`Stored`] model.
    pub stored: Option<Storing<M>>,
    /// Functions of a [`ContinuousTime`] model.
    pub continuous: Option<Continuous<M>>,
    /// Functions of a model with [`Events`].
    pub events: Option<Eventful<M>>,
    /// Functions of a [`Sampled`] model.
    pub samples: Option<Samples<M>>,
    /// Function of a model with [`EventMode`].
    pub to_event: Option<ToEvent<M>>,
    /// Functions of a [`Differentiable`] model.
    pub tangent: Option<Tangent<M>>,
    /// Functions of a model that follows [`CompletedSteps`].
    pub complete: Option<Completing<M>>,
    /// Functions of a [`Clocked`] model.
    pub clocked: Option<ClockFunctions<M>>,
    /// The partitions of a [`Clocked`] model can be scheduled one by one (Scheduled Execution).
    pub scheduled: bool,
    /// The model is not for Co-Simulation.
    pub exchange_only: bool,
    /// [`Resizable::resize`].
    pub resizable: Option<Resize<M>>,
    /// [`Intermediate::longest`].
    pub intermediate: Option<fn(&M) -> f64>,
    /// Function of a model that [`Warns`].
    pub warn: Option<fn(&M, &mut Warnings<'_>)>,
}

impl<M: Stored> Capabilities<M> {
    /// Co-simulation only; an importer can save and store the state.
    pub const NONE: Self = Self::stored();
}

#[allow(non_snake_case, reason = "each method has the name of its trait, as in the line that exports a model")]
impl<M: Model> Capabilities<M> {
    /// Co-simulation only, for a model without `Clone`: an importer can neither save nor store its state.
    pub const fn unsaved() -> Self {
        Self {
            saved: None,
            stored: None,
            continuous: None,
            events: None,
            samples: None,
            to_event: None,
            tangent: None,
            complete: None,
            clocked: None,
            scheduled: false,
            exchange_only: false,
            resizable: None,
            intermediate: None,
            warn: None,
        }
    }

    /// Co-simulation only, for a model without serde: an importer can save its state, but not store it.
    pub const fn unstored() -> Self
    where
        M: Saved,
    {
        Self { saved: Some(Saving::FUNCTIONS), ..Self::unsaved() }
    }

    /// Co-simulation only: [`NONE`](Self::NONE).
    pub const fn stored() -> Self
    where
        M: Stored,
    {
        Self { stored: Some(Storing::FUNCTIONS), ..Self::unstored() }
    }

    /// Adds [`ContinuousTime`].
    pub const fn ContinuousTime(self) -> Self
    where
        M: ContinuousTime,
    {
        let continuous = Continuous {
            states: M::STATES,
            derivatives: M::derivatives,
            settle: M::settle,
            observe: M::observe,
            integrands: M::integrands,
        };
        Self { continuous: Some(continuous), ..self }
    }

    /// Adds [`Events`].
    pub const fn Events(self) -> Self
    where
        M: Events,
    {
        let events = Eventful {
            list: M::INDICATORS,
            indicators: M::indicators,
            begin: M::begin,
            event: M::event,
            next: M::next,
        };
        Self { events: Some(events), ..self }
    }

    /// Adds [`Sampled`], and with it [`Events`].
    pub const fn Sampled(self) -> Self
    where
        M: Sampled,
    {
        let samples = Samples {
            period: M::period,
            samples: M::samples,
            show: M::show,
            sample: M::sample,
            bounded: crate::events::bounded::<M>,
        };
        Self { samples: Some(samples), ..self.Events() }
    }

    /// Adds [`EventMode`].
    pub const fn EventMode(self) -> Self
    where
        M: EventMode,
    {
        Self { to_event: Some(M::to_event), ..self }
    }

    /// Adds [`Differentiable`].
    pub const fn Differentiable(self) -> Self
    where
        M: Differentiable,
    {
        Self { tangent: Some(M::tangent), ..self }
    }

    /// Adds [`CompletedSteps`].
    pub const fn CompletedSteps(self) -> Self
    where
        M: CompletedSteps,
    {
        Self { complete: Some(Completing { complete: M::complete, account: M::account }), ..self }
    }

    /// Adds [`Clocked`].
    pub const fn Clocked(self) -> Self
    where
        M: Clocked,
    {
        let clocked = ClockFunctions {
            feedthrough: M::FEEDTHROUGH,
            activate: M::activate,
            tick: M::tick,
            interval: M::interval,
            ticked: M::ticked,
        };
        Self { clocked: Some(clocked), ..self }
    }

    /// Adds Scheduled Execution to a [`Clocked`] model: the importer's scheduler decides when each clock is activated. Every
    /// clock that the importer ticks needs a priority.
    pub const fn ScheduledExecution(self) -> Self
    where
        M: Clocked,
    {
        Self { scheduled: true, ..self }
    }

    /// Leaves out Co-Simulation: for equations that need the importer's solver. [`Model::advance`] is never called.
    pub const fn ModelExchangeOnly(self) -> Self {
        Self { exchange_only: true, ..self }
    }

    /// Adds [`Resizable`].
    pub const fn Resizable(self) -> Self
    where
        M: Resizable,
    {
        Self { resizable: Some(M::resize), ..self }
    }

    /// Adds [`Intermediate`].
    pub const fn Intermediate(self) -> Self
    where
        M: Intermediate,
    {
        Self { intermediate: Some(M::longest), ..self }
    }

    /// Adds [`Warns`].
    pub const fn Warns(self) -> Self
    where
        M: Warns,
    {
        Self { warn: Some(M::warn), ..self }
    }
}

impl<M: Model> Capabilities<M> {
    /// What an importer can keep of the state.
    pub const fn keeps(&self) -> Keeps {
        match (&self.saved, &self.stored) {
            (None, _) => Keeps::Nothing,
            (Some(_), None) => Keeps::Saved,
            _ => Keeps::Stored,
        }
    }

    /// The model can be exported for Model Exchange.
    pub const fn model_exchange(&self) -> bool {
        self.continuous.is_some() || self.events.is_some() || self.clocked.is_some()
    }

    /// Co-simulation with Event Mode (FMI 3.0): for a model with clocks, and with early return for a sampled model without states
    /// and for one with [`EventMode`].
    pub const fn event_mode(&self) -> bool {
        let sampled = self.samples.is_some() && self.continuous.is_none();
        self.to_event.is_some() || sampled || self.clocked.is_some()
    }

    /// The states; none for a model without [`ContinuousTime`].
    pub const fn states(&self) -> &'static [State<M>] {
        match &self.continuous {
            Some(continuous) => continuous.states,
            None => &[],
        }
    }

    /// The event indicators; none for a model without [`Events`].
    pub const fn indicators(&self) -> &'static [Indicator] {
        match &self.events {
            Some(events) => events.list,
            None => &[],
        }
    }

    /// Table indices of the states' rows: one for each scalar state.
    ///
    /// # Errors
    /// Names a state without a continuous real row that is an output or local.
    pub fn rows(&self) -> Result<Vec<usize>, Fault> {
        let row = |state: &State<M>| {
            let fits = |name: &str, meta: &Meta| name == state.name && can_be_state(meta, state.dimension());
            let named = |index: &usize| M::TABLE.locate(*index).is_some_and(|(name, meta, _)| fits(&name, meta));
            let none =
                || Fault::new(format!("the state {} has no continuous real output or state in the table", state.name));
            let first = M::TABLE.indices().find(named).ok_or_else(none)?;
            Ok(first..first + state.most())
        };
        let rows: Result<Vec<_>, Fault> = self.states().iter().map(row).collect();
        Ok(rows?.into_iter().flatten().collect())
    }

    /// Value reference of a table index. Below the length of the table it is the index plus one; derivatives and event
    /// indicators follow, then the elements of wide arrays.
    pub fn reference(&self, index: usize) -> u32 {
        let beside = if index < WIDE { 0 } else { M::TABLE.len() + self.scalars() + self.indicators().len() };
        u32::try_from(index % WIDE + beside + 1).unwrap_or(u32::MAX)
    }

    /// The index that has this value reference, where [`reference`](Self::reference) is known to belong to a variable.
    #[inline]
    pub const fn index(&self, reference: u32) -> usize {
        let index = (reference as usize).wrapping_sub(1);
        if M::TABLE.wide() == 0 {
            return index;
        }
        let beside = M::TABLE.len() + self.scalars() + self.indicators().len();
        if index >= beside && index < beside + M::TABLE.wide() { index - beside + WIDE } else { index }
    }

    /// The variable `index` and the location of its start value; for the row of a state, this is the state itself. `rows` comes
    /// from [`rows`](Self::rows).
    pub fn place<'a>(
        &self,
        block: &'a mut Block<M>,
        rows: &[usize],
        index: usize,
    ) -> Option<(&'static Meta, Slot<'a>)> {
        let Some(number) = rows.iter().position(|&row| row == index) else { return M::TABLE.entry(block, index) };
        let (meta, _) = M::TABLE.entry(block, index)?;
        Some((meta, Slot::Real(self.scalar(&mut block.model, number)?)))
    }

    /// Hash of the model's table and of the parts of the interface that its capabilities add.
    pub const fn hash(&self) -> Hash {
        let mut hash = match self.keeps() {
            Keeps::Stored => M::HASH,
            Keeps::Saved => M::HASH.text("Unstored"),
            Keeps::Nothing => M::HASH.text("Unsaved"),
        };
        if !self.model_exchange() {
            return hash;
        }
        hash =
            hash.bytes(&[self.continuous.is_some() as u8, self.events.is_some() as u8, self.samples.is_some() as u8]);
        let mut i = 0;
        while i < self.states().len() {
            let state = &self.states()[i];
            hash = hash.text(state.name).quantity(state.rate).bytes(&[state.reinit as u8]);
            if state.dimension().is_some() {
                hash = hash.text("array");
            }
            i += 1;
        }
        i = 0;
        while i < self.indicators().len() {
            hash = hash.text(self.indicators()[i].name);
            i += 1;
        }
        if self.to_event.is_some() {
            hash = hash.text("EventMode");
        }
        if self.exchange_only {
            hash = hash.text("ModelExchangeOnly");
        }
        if self.complete.is_some() {
            hash = hash.text("CompletedSteps");
        }
        if self.clocked.is_some() {
            hash = hash.text("Clocked").bytes(&[self.scheduled as u8]);
        }
        hash
    }
}

/// A model as it is exported: with its capabilities. The line that exports a model implements it.
pub trait Exported: Sized + 'static {
    /// The model.
    type Model: Model;

    /// Its capabilities.
    const CAN: Capabilities<Self::Model>;

    /// The instantiation token: a hash of name, version, table and capabilities.
    const TOKEN: crate::Token = Self::CAN.hash().guid();
}

/// A model without capabilities, which `export!(M)` exports.
pub struct Plain<M>(PhantomData<M>);

impl<M: Stored> Exported for Plain<M> {
    type Model = M;
    const CAN: Capabilities<M> = Capabilities::NONE;
}
