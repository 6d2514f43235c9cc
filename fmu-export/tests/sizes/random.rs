//! Random calls of a model whose arrays change their sizes, against FMI 3.0.2, 2.3, 3.2 and 4.2, written down once more by hand.

use super::oracle::{Call, Importer, Oracle, State, Statuses, Turn, bits, random_calls, verdict};
use super::*;
use State::{Configuration, Continuous, Event, Initialization, Instantiated, Reconfiguration, Step, Terminated};
use fmu_core::draw::Draw;

const DISCARD: c_int = 2;

/// The expected state of an instance.
#[derive(Clone)]
struct Twin {
    exchange: bool,
    state: State,
    block: Block<Chain>,
    time: f64,
    elapsed: Elapsed,
    /// A value was set before the initialization, without a read since.
    set: bool,
    /// The initialization is over.
    begun: bool,
}

impl Twin {
    fn new(exchange: bool) -> Self {
        let (mut block, elapsed) = (Block::default(), Elapsed::ZERO);
        block.initialize();
        Self { exchange, state: Instantiated, block, time: 0.0, elapsed, set: false, begun: false }
    }

    fn is(&self, states: &[State]) -> bool {
        states.contains(&self.state)
    }

    /// Only in Model Exchange, and in these states.
    fn exchanges_in(&self, states: &[State]) -> bool {
        self.exchange && self.is(states)
    }

    /// The state in which the simulation runs.
    fn running(&self) -> State {
        if self.exchange { Event } else { Step }
    }

    /// Before the initialization ends, values match those set; in Model Exchange, outputs match the states.
    fn show(&mut self) {
        if self.is(&[Instantiated, Initialization]) && self.set {
            self.block.initialize();
            self.set = false;
        }
        if self.exchange && self.begun {
            self.block.model.output(self.elapsed, &mut self.block.out);
        }
    }

    fn number(&self) -> usize {
        self.block.model.x.len()
    }

    fn states(&self) -> Vec<f64> {
        [&self.block.model.x[..], &[self.block.model.z]].concat()
    }

    fn derivatives(&self) -> Vec<f64> {
        let mut dx = vec![0.0; self.number() + 1];
        self.block.model.derivatives(self.elapsed, &mut dx).unwrap();
        dx
    }

    fn values(&self, reference: u32) -> Vec<f64> {
        let (model, n) = (&self.block.model, self.number());
        match reference {
            GAINS => model.gains.clone(),
            X => model.x.clone(),
            Z => vec![model.z],
            Y => self.block.out.y.clone(),
            VALUES => model.map.values.clone(),
            DER_X => self.derivatives()[..n].to_vec(),
            _ => self.derivatives()[n..].to_vec(),
        }
    }

    /// Arrays get their sizes.
    fn resize(&mut self) -> c_int {
        let mut next = self.block.clone();
        if next.model.resize().is_err() {
            return ERROR;
        }
        if self.begun {
            next.model.output(self.elapsed, &mut next.out);
        } else {
            next.initialize();
        }
        self.block = next;
        OK
    }

    fn exit(&mut self, it: &It) -> Statuses {
        let wanted = verdict(self.is(&[Initialization]));
        if wanted == OK {
            self.block.initialize();
            (self.set, self.begun, self.state) = (false, true, self.running());
        }
        [unsafe { fmi3ExitInitializationMode(it.0) }, wanted]
    }

    fn configure(&mut self, it: &It) -> Statuses {
        let wanted = verdict(self.is(&[Instantiated, self.running()]));
        self.show();
        self.state = if self.is(&[Instantiated]) { Configuration } else { Reconfiguration };
        [it.enter(), wanted]
    }

    fn configured(&mut self, it: &It) -> Statuses {
        let wanted = if self.is(&[Configuration, Reconfiguration]) { self.resize() } else { ERROR };
        self.state = if self.is(&[Configuration]) { Instantiated } else { self.running() };
        [it.exit(), wanted]
    }

    fn set_sizes(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let references = [N, K, ROWS, turn.mostly(&[N], &[GAINS])];
        let first = turn.draw.below(3);
        let references = &references[first..][..=turn.draw.below(2)];
        let sizes: Vec<u64> = references.iter().map(|_| turn.draw.of(&[0, 1, 2, 3, 4, 5, 3, 2])).collect();
        turn.note((references, &sizes));
        let fits = references.iter().zip(&sizes).all(|(reference, size)| self.set_size(*reference, *size));
        // Before the initialization, each call is a Configuration Mode.
        let fits = fits && (!self.is(&[Instantiated]) || self.resize() == OK);
        self.set |= self.is(&[Instantiated]);
        [turn.importer.set_sizes(references, &sizes), verdict(fits)]
    }

    fn set_size(&mut self, reference: u32, size: u64) -> bool {
        let model = &mut self.block.model;
        let (place, range, tunable) = match reference {
            N => (&mut model.n, 0..=5, true),
            K => (&mut model.k, 0..=4, false),
            ROWS => (&mut model.map.rows, 1..=200, false),
            _ => return false,
        };
        *place = size;
        range.contains(&size) && (self.is(&[Instantiated, Configuration]) || self.is(&[Reconfiguration]) && tunable)
    }

    /// A tunable array, or a fixed one (the map).
    fn set_array(&mut self, reference: u32, turn: &mut Turn<'_, Self>) -> Statuses {
        let before = self.values(reference);
        let n = turn.count(before.len());
        let mut value = || if turn.draw.below(60) == 0 { f64::NAN } else { turn.draw.of(&[1.0, -2.0, 0.5]) };
        let values: Vec<f64> = (0..n).map(|_| value()).collect();
        turn.note(n);
        let tunes = reference == GAINS && self.is(&[Step, Event]);
        let open = self.is(&[Instantiated, Initialization]) || tunes;
        let fits = n == before.len() && values.iter().all(|x| x.is_finite());
        // A fixed parameter, and in Continuous-Time Mode a tunable one, may be set to its present value.
        let kept = self.is(&[Step, Event, Continuous]) && n > 0 && values == before;
        let none = n == 0 && before.is_empty() && !self.is(&[Terminated, State::Error]);
        let model = &mut self.block.model;
        let place = if reference == GAINS { &mut model.gains } else { &mut model.map.values };
        place.clone_from(&values);
        self.set |= self.is(&[Instantiated, Initialization]);
        [turn.importer.set(reference, &values), verdict((open || kept) && fits || none)]
    }

    fn set_marks(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let right = self.block.model.marks.len();
        let n = turn.count(right);
        let marks: Vec<i32> = (1..).take(n).collect();
        let open = self.is(&[Instantiated, Initialization]);
        let kept = n > 0 && marks == self.block.model.marks && self.is(&[Step, Event, Continuous]);
        let none = n == 0 && !self.is(&[Terminated, State::Error]);
        self.block.model.marks.clone_from(&marks);
        self.set |= open;
        let status = unsafe { fmi3SetInt32(turn.importer.0, &MARKS, 1, marks.as_ptr(), n) };
        [status, verdict(n == right && (open || kept || none))]
    }

    fn get(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let reference = turn.draw.of(&[GAINS, X, Z, Y, VALUES, DER_X, DER_Z]);
        self.show();
        let expected = self.values(reference);
        let n = turn.count(expected.len());
        turn.note((reference, n));
        let known = !(self.is(&[Configuration, Reconfiguration]) && [DER_X, DER_Z].contains(&reference));
        // Without values there is nothing to read.
        let fits = n == expected.len() && (known || n == 0);
        let (status, values) = turn.importer.get(reference, n);
        assert!(status != OK || !fits || bits(&values) == bits(&expected), "{}", turn.trace);
        [status, verdict(fits)]
    }

    fn step(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let (wrong, h) = (turn.mostly(&[0.0], &[1.0]), turn.draw.of(&[0.01, 0.1]));
        let wanted = verdict(self.is(&[Step]) && wrong == 0.0);
        let t = self.time;
        if wanted == OK {
            self.block.model.advance(&fmu_core::Step { start: self.elapsed, h }).unwrap();
            (self.elapsed, self.time) = (self.elapsed.plus(h), t + h);
            self.block.model.output(self.elapsed, &mut self.block.out);
        }
        [turn.importer.step(t + wrong, h), wanted]
    }

    fn set_states(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let n = turn.count(self.number() + 1);
        let x: Vec<f64> = (0..n).map(|_| turn.draw.of(&[0.0, 1.0, -3.0, 0.1, 7.0, -2e3])).collect();
        let wild = x.iter().take(self.number()).any(|x| *x < -1e3);
        let wanted = match (self.exchanges_in(&[Continuous, Event]) && n == self.number() + 1, wild) {
            (false, _) => ERROR,
            (true, true) => DISCARD,
            (true, false) => OK,
        };
        if wanted == OK {
            let (z, array) = x.split_last().unwrap();
            self.block.model.x.copy_from_slice(array);
            self.block.model.z = *z;
        }
        [unsafe { fmi3SetContinuousStates(turn.importer.0, x.as_ptr(), n) }, wanted]
    }

    /// States, derivatives or nominal values.
    fn vector(&mut self, call: Call, turn: &mut Turn<'_, Self>) -> Statuses {
        if call != Call::Nominals {
            self.show();
        }
        let expected = match call {
            Call::GetStates => self.states(),
            Call::Derivatives => self.derivatives(),
            _ => [vec![2.0; self.number()], vec![3.0]].concat(),
        };
        let n = turn.count(expected.len());
        let fits = self.exchanges_in(&[Initialization, Event, Continuous, Terminated]) && n == expected.len();
        let mut values = vec![-7.0; n + 1];
        let (it, out) = (turn.importer.0, values.as_mut_ptr());
        let status = unsafe {
            match call {
                Call::GetStates => fmi3GetContinuousStates(it, out, n),
                Call::Derivatives => fmi3GetContinuousStateDerivatives(it, out, n),
                _ => fmi3GetNominalsOfContinuousStates(it, out, n),
            }
        };
        assert_eq!(values.pop(), Some(-7.0), "{}", turn.trace);
        assert!(status != OK || !fits || bits(&values) == bits(&expected), "{}", turn.trace);
        [status, verdict(fits)]
    }

    /// A call without arguments: its states, and the state that it leads to.
    fn plain(&mut self, allowed: bool, next: State, status: c_int) -> Statuses {
        self.state = next;
        [status, verdict(allowed)]
    }
}

impl Importer for It {
    fn it(&self) -> InstancePointer {
        self.0
    }
}

impl Oracle for Twin {
    type Importer = It;
    const CALLS: &'static [Call] = &[
        Call::Enter,
        Call::Exit,
        Call::Configure,
        Call::Configured,
        Call::SetSizes,
        Call::Set,
        Call::SetIntegers,
        Call::SetMap,
        Call::Get,
        Call::Step,
        Call::Event,
        Call::Update,
        Call::Leave,
        Call::SetStates,
        Call::GetStates,
        Call::Derivatives,
        Call::Nominals,
        Call::Count,
        Call::Terminate,
        Call::Reset,
        Call::Save,
        Call::Restore,
    ];
    const WILD: usize = 15;

    fn open(draw: &mut Draw) -> (It, Self) {
        let exchange = draw.below(2) == 0;
        (It::new(exchange), Self::new(exchange))
    }

    fn state(&mut self) -> &mut State {
        &mut self.state
    }

    fn next(&self) -> &'static [Call] {
        use Call::*;
        match self.state {
            Instantiated => &[Configure, SetSizes, Set, SetMap, Get, Enter, Save, Restore, SetIntegers],
            Configuration => &[SetSizes, SetSizes, Get, Configured, Save],
            Initialization => &[Set, SetMap, Get, Exit, SetIntegers, Save],
            State::Step => &[Step, Step, Get, Set, Configure, Save, Restore],
            State::Event => &[Configure, Update, Leave, Set, Get, Count, Restore],
            Continuous => &[SetStates, GetStates, Derivatives, Get, Event, Nominals, Count, Save],
            Reconfiguration => &[SetSizes, Configured, Get, Configured, Save, Restore],
            _ => &[Get, Reset, Reset, Restore, Reset],
        }
    }

    fn call(&mut self, call: Call, turn: &mut Turn<'_, Self>) -> Statuses {
        let it = turn.importer.0;
        match call {
            Call::Enter => {
                let status = unsafe { fmi3EnterInitializationMode(it, NO, 0.0, 0.0, NO, 0.0) };
                self.plain(self.is(&[Instantiated]), Initialization, status)
            }
            Call::Exit => self.exit(turn.importer),
            Call::Configure => self.configure(turn.importer),
            Call::Configured => self.configured(turn.importer),
            Call::SetSizes => self.set_sizes(turn),
            Call::Set => self.set_array(GAINS, turn),
            Call::SetMap => self.set_array(VALUES, turn),
            Call::SetIntegers => self.set_marks(turn),
            Call::Get => self.get(turn),
            Call::Step => self.step(turn),
            Call::Event => {
                self.plain(self.exchanges_in(&[Continuous, Event]), Event, unsafe { fmi3EnterEventMode(it) })
            }
            Call::Update => {
                let (mut flags, mut next) = ([NO; 5], 0.0);
                let [a, b, c, d, e] = &mut flags;
                let status = unsafe { fmi3UpdateDiscreteStates(it, a, b, c, d, e, &mut next) };
                self.plain(self.exchanges_in(&[Event]), Event, status)
            }
            Call::Leave => {
                self.plain(self.exchanges_in(&[Event]), Continuous, unsafe { fmi3EnterContinuousTimeMode(it) })
            }
            Call::SetStates => self.set_states(turn),
            Call::GetStates | Call::Derivatives | Call::Nominals => self.vector(call, turn),
            Call::Count => {
                let fits = self.exchanges_in(&[Instantiated, Initialization, Event, Continuous, Terminated]);
                let mut n = 0;
                let status = unsafe { fmi3GetNumberOfContinuousStates(it, &mut n) };
                assert!(status != OK || n == self.number() + 1, "{}", turn.trace);
                [status, verdict(fits)]
            }
            Call::Terminate => {
                let fits = self.is(&[Step, Event, Continuous, Reconfiguration]);
                self.plain(fits, Terminated, unsafe { fmi3Terminate(it) })
            }
            Call::Reset => {
                *self = Self::new(self.exchange);
                [unsafe { fmi3Reset(it) }, OK]
            }
            _ => unreachable!(),
        }
    }

    fn saves(&mut self) {
        if self.begun {
            self.show();
        }
    }

    fn accepts(&self, saved: &Self) -> bool {
        saved.exchange == self.exchange
    }

    /// Every size and every value.
    fn look(&mut self, it: &It, trace: &str) {
        self.show();
        let model = &self.block.model;
        assert_eq!([it.size(N), it.size(K), it.size(ROWS)], [model.n, model.k, model.map.rows], "{trace}");
        for reference in [GAINS, X, Z, Y, VALUES] {
            let expected = self.values(reference);
            let values = it.values(reference, expected.len());
            assert_eq!(bits(&values), bits(&expected), "{reference} in {:?} {trace}", self.state);
        }
    }
}

#[test]
fn random_calls_with_sizes() {
    random_calls::<Twin>(20_000);
}
