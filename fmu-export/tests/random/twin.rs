//! The state machine of FMI, written down once more by hand, with the model run natively.

use super::{DISCARD, ERROR, OK, c_int};
use crate::oracle::State;
use crate::solver::{Kind, Stepped, Update};
use State::{Continuous, Event, Initialization, Instantiated};
use fmu_core::{
    Block, Capabilities, Causality, Elapsed, Meta, Next, SampleGrid, Slot, Step, Stored, Variability,
    capability::ToEvent,
};

/// Facts about a model for the driver, in addition to its capabilities.
pub trait Twin: Stored + PartialEq {
    const CAN: Capabilities<Self>;
    /// Interfaces that the FMU has.
    const KINDS: &'static [Kind];
    /// References of all reals in the table, of arrays the first.
    const REALS: &'static [u32];
    /// The most frequently set variables.
    const SET: &'static [u32];
    /// Valid values for them.
    const VALUES: &'static [f64];
    /// Whether the next call of the model can succeed: parameters are consistent, inputs cause no fault.
    fn is_healthy(&self) -> bool;
    /// The parameters are consistent.
    fn fits(&self) -> bool;
}

#[derive(Clone)]
#[expect(clippy::struct_excessive_bools, reason = "independent facts")]
pub struct Snapshot<M: Twin> {
    pub kind: Kind,
    pub state: State,
    pub start: Option<f64>,
    pub elapsed: Elapsed,
    pub end: f64,
    /// Time of the last event.
    pub settled: f64,
    /// States were set in Initialization Mode.
    pub stated: bool,
    /// In Initialization Mode, the outputs do not belong to these states.
    pub old: bool,
    pub pending: bool,
    pub fresh: bool,
    /// Initialization is over.
    pub running: bool,
    pub block: Block<M>,
}

impl<M: Twin> Snapshot<M> {
    pub fn is(&self, states: &[State]) -> bool {
        states.contains(&self.state)
    }

    pub fn new(kind: Kind) -> Self {
        let start = M::INFO.experiment.start;
        Self {
            kind,
            state: Instantiated,
            start: None,
            elapsed: Elapsed::ZERO,
            end: start,
            settled: start,
            stated: false,
            old: false,
            pending: false,
            fresh: true,
            running: false,
            block: Block::default(),
        }
    }

    /// The value of a getter.
    pub fn show(&mut self) {
        if self.is(&[Instantiated, Initialization]) && self.fresh {
            self.initialize();
        }
        if std::mem::take(&mut self.old)
            || !self.is(&[Instantiated, Initialization]) && self.kind.exchanges() && self.running
        {
            self.observe();
        }
    }

    pub fn initialize(&mut self) {
        self.block.initialize();
        (self.fresh, self.stated) = (false, false);
    }

    /// The outputs of this instant, in Model Exchange.
    pub fn observe(&mut self) {
        match &M::CAN.continuous {
            Some(continuous) => (continuous.observe)(&self.block.model, self.elapsed, &mut self.block.out),
            None => self.block.model.output(self.elapsed, &mut self.block.out),
        }
    }

    /// No variable is NaN.
    pub fn is_storable(&self) -> bool {
        let mut block = self.block.clone();
        let real = |i| !matches!(M::TABLE.entry(&mut block, i), Some((_, Slot::Real(x))) if x.is_nan());
        (0..M::TABLE.len()).all(real)
    }

    pub fn derivatives(&mut self) -> Result<Vec<f64>, c_int> {
        let mut dx = vec![0.0; M::CAN.states().len()];
        if let Some(continuous) = &M::CAN.continuous {
            (continuous.derivatives)(&self.block.model, self.elapsed, &mut dx).map_err(|_| DISCARD)?;
        }
        if dx.iter().all(|x| x.is_finite()) { Ok(dx) } else { Err(DISCARD) }
    }

    pub fn indicators(&self) -> Vec<f64> {
        let mut z = vec![0.0; M::CAN.indicators().len()];
        if let Some(events) = &M::CAN.events {
            (events.indicators)(&self.block.model, self.elapsed, &mut z);
        }
        z
    }

    pub fn states(&mut self) -> Vec<f64> {
        M::CAN.states().iter().map(|state| *state.at(&mut self.block.model)).collect()
    }

    /// The values of a real reference.
    pub fn reals(&mut self, reference: u32) -> Result<Vec<f64>, c_int> {
        let (table, states) = (M::TABLE.len(), M::CAN.states().len());
        let index = match reference.checked_sub(1) {
            None if self.kind.version() == 2 => return Err(ERROR),
            None => return Ok(vec![self.end]),
            Some(index) => usize::try_from(index).unwrap(),
        };
        let (flat, element) = (self.kind.version() == 2, M::TABLE.element(index));
        if index < table {
            let n = M::TABLE.entry(&mut self.block, index).unwrap().0.dimension.filter(|_| !flat).unwrap_or(1);
            if !flat && element.is_some_and(|element| element > 0) {
                return Err(ERROR);
            }
            let one = |i| match M::TABLE.entry(&mut self.block, i) {
                Some((_, Slot::Real(x))) => Ok(*x),
                _ => Err(ERROR),
            };
            return (index..index + n).map(one).collect();
        }
        if index < table + states {
            return self.derivatives().map(|dx| vec![dx[index - table]]);
        }
        // Event indicators are variables in FMI 3.0 only.
        if flat {
            return Err(ERROR);
        }
        self.indicators().get(index - table - states).map(|z| vec![*z]).ok_or(ERROR)
    }

    fn due(&self, k: u64, at: Elapsed) -> bool {
        M::CAN.samples.as_ref().is_some_and(|s| SampleGrid { period: (s.period)(&self.block.model) }.reached(k, at))
    }

    fn tune(&mut self) -> Result<(), c_int> {
        if self.fresh {
            if !self.block.model.fits() {
                return Err(ERROR);
            }
            self.block.model.derive();
            self.fresh = false;
        }
        Ok(())
    }

    pub fn begin(&mut self) {
        self.settled = self.settled.max(self.end);
        self.pending = true;
        if let Some(events) = &M::CAN.events {
            (events.begin)(&mut self.block.model, self.elapsed);
        }
        self.output();
    }

    /// In Co-Simulation, outputs come from the last step or event.
    fn output(&mut self) {
        self.block.model.output(self.elapsed, &mut self.block.out);
    }

    pub fn update(&mut self) -> Result<Update, c_int> {
        self.tune()?;
        let events = M::CAN.events.as_ref().unwrap();
        let outcome = (events.event)(&mut self.block.model, self.elapsed).map_err(|_| ERROR)?;
        let start = self.start.unwrap();
        let next = match (events.next)(&self.block.model, self.elapsed) {
            Next::Never => None,
            Next::Grid { k, period } => Some(f64::mul_add(f64::from(u32::try_from(k).unwrap()), period, start)),
            Next::At(time) => Some(start + time.seconds()),
        };
        self.pending = outcome.again;
        self.output();
        Ok(Update { again: outcome.again, terminate: outcome.terminate, states_changed: outcome.states_changed, next })
    }

    /// FMI 3.0.2, 4.2.1; the first instant that the step meets ends it, if it may.
    pub fn step(&mut self, t: f64, h: f64) -> Result<Stepped, c_int> {
        let rounding = 2.0 * f64::EPSILON * t.abs();
        let fits = h > 0.0 && h.is_finite() && t.is_finite() && t + h > t;
        if !fits || (t - self.end).abs() > h / 100.0 + rounding {
            return Err(ERROR);
        }
        self.tune()?;
        let (start, end, last) = (self.elapsed, self.elapsed.plus(h), self.end);
        let (event, early) = match self.kind {
            Kind::Cs3 { event, early } if M::CAN.event_mode() => (event, early),
            _ => (false, false),
        };
        if let (true, Some(to_event)) = (event || early, M::CAN.to_event) {
            return self.stop(to_event, (event, early), t, h);
        }
        let mut stepped = Stepped { end: t + h, ..Stepped::default() };
        self.end = t + h;
        let mut reached = end;
        if event || early {
            let samples = M::CAN.samples.as_ref().unwrap();
            let period = (samples.period)(&self.block.model);
            let before = |k: u64, model: &Self| model.due(k, end) && SampleGrid { period }.passed(k, end);
            loop {
                let k = (samples.samples)(&self.block.model);
                let at_start = self.due(k, start);
                if before(k, self) && (at_start || !early) {
                    (samples.show)(&mut self.block.model);
                    if (samples.sample)(&mut self.block.model).is_err() {
                        // Time has not passed.
                        self.end = last;
                        return Err(ERROR);
                    }
                } else if self.due(k, end) {
                    stepped.event = event;
                    if before(k, self) {
                        stepped.early = true;
                        reached = Elapsed::periods(k, period);
                        stepped.end = f64::mul_add(f64::from(u32::try_from(k).unwrap()), period, self.start.unwrap());
                        self.end = stepped.end;
                    }
                    if !event {
                        (samples.show)(&mut self.block.model);
                    }
                    break;
                } else {
                    break;
                }
            }
        } else if self.block.model.advance(&Step { start, h }).is_err() {
            self.end = last;
            return Err(ERROR);
        }
        self.elapsed = reached;
        self.output();
        Ok(stepped)
    }

    /// The step of a model with states: the first event inside it ends it if early return is allowed; otherwise the step
    /// continues from there. Without Event Mode, those at the end are left to the model.
    fn stop(&mut self, to_event: ToEvent<M>, (event, early): (bool, bool), t: f64, h: f64) -> Result<Stepped, c_int> {
        let (events, end) = (M::CAN.events.as_ref().unwrap(), self.elapsed.plus(h));
        let model = &mut self.block.model;
        let mut step = Step { start: self.elapsed, h };
        let (stop, inside) = loop {
            let stop = to_event(model, &step).map_err(|_| ERROR)?;
            let inside = stop.event && end.since(stop.at) > f64::EPSILON * h;
            if early || !inside {
                break (stop, inside);
            }
            step = Step { start: stop.at, h: end.since(stop.at) };
        };
        if !event {
            (events.begin)(model, stop.at);
            while stop.settles && !inside && (events.event)(model, stop.at).map_err(|_| ERROR)?.again {}
        }
        (self.elapsed, self.end) = (end, t + h);
        if inside {
            (self.elapsed, self.end) = (stop.at, self.start.unwrap() + stop.at.seconds());
        }
        self.output();
        Ok(Stepped { event: stop.event && event, early: inside, end: self.end })
    }

    /// The status of setting one value, without setting it.
    fn judge(&mut self, index: usize, value: f64) -> c_int {
        let (state, exchanges) = (self.state, self.kind.exchanges());
        let is = |states: &[State]| states.contains(&state);
        let row = M::CAN.rows().unwrap().contains(&index);
        let Some((meta, Slot::Real(x))) = M::TABLE.entry(&mut self.block, index) else { return ERROR };
        let Meta { causality, variability, range, exact, .. } = *meta;
        let may = match (causality, variability) {
            _ if exact && is(&[Instantiated, Initialization]) => true,
            (Causality::Input, Variability::Continuous) => {
                is(&[Instantiated, Initialization, Event, Continuous, State::Step])
            }
            (Causality::Input, _) => {
                is(&[Instantiated, Initialization, Event, State::Step])
                    || (exchanges && state == Continuous && *x == value)
            }
            (Causality::Parameter, Variability::Tunable) => is(&[Instantiated, Initialization, Event, State::Step]),
            (Causality::Parameter, _) => is(&[Instantiated, Initialization]),
            _ => exchanges && row && is(&[Event, Continuous]),
        };
        // Habits of importers: a parameter is set to its own value when it is too late.
        let stays =
            is(&[Event, Continuous, State::Step]) && (causality == Causality::Parameter || exact) && *x == value;
        match (may || stays, range.contains(value)) {
            (true, true) => OK,
            (true, false) if may && state == Continuous => DISCARD,
            _ if exchanges && state == Continuous && causality == Causality::Input => DISCARD,
            _ => ERROR,
        }
    }

    /// The value equals the variable's, which cannot change now.
    fn is_held(&mut self, index: usize, value: f64) -> bool {
        let tunes = self.state != Continuous;
        match M::TABLE.entry(&mut self.block, index) {
            Some((meta, Slot::Real(x))) if meta.causality == Causality::Parameter => {
                !(meta.variability == Variability::Tunable && tunes) && *x == value
            }
            Some((meta, Slot::Real(x))) => meta.exact && !self.kind.exchanges() && *x == value,
            _ => false,
        }
    }

    pub fn set(&mut self, references: &[u32], values: &[f64]) -> c_int {
        let mut places = Vec::new();
        let mut next = values.iter();
        for &reference in references {
            let index = usize::try_from(reference).unwrap().wrapping_sub(1);
            let of = M::TABLE.entry(&mut self.block, index).and_then(|(meta, _)| meta.dimension);
            let n = of.filter(|_| self.kind.version() == 3).unwrap_or(1);
            places.extend((0..n).zip(next.by_ref()).map(|(i, value)| (index.wrapping_add(i), *value)));
        }
        for &(index, value) in &places {
            match self.judge(index, value) {
                OK => {}
                status => return status,
            }
        }
        let rows = M::CAN.rows().unwrap();
        for (index, value) in places {
            if self.is(&[Event, Continuous, State::Step]) && self.is_held(index, value) {
                continue;
            }
            self.fresh |= self.is(&[Instantiated, Initialization]);
            if let Some(i) = rows.iter().position(|row| *row == index) {
                *M::CAN.states()[i].at(&mut self.block.model) = value;
            } else if let Some((meta, Slot::Real(x))) = M::TABLE.entry(&mut self.block, index) {
                *x = value;
                self.fresh |= meta.causality == Causality::Parameter;
            }
        }
        OK
    }
}
