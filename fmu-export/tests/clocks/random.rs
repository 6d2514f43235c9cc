//! Random calls of a model with clocks, against FMI 3.0.2, 2.2.8, 2.3.5 and 5, written down once more by hand.

use super::oracle::{Call, Importer, Oracle, State, Statuses, Turn, random_calls, verdict};
use super::*;
use State::{Activation, Continuous, Event, Initialization, Instantiated, Step, Terminated};
use fmu_core::draw::Draw;

const DISCARD: c_int = 2;

/// The expected state of an instance.
#[derive(Clone)]
struct Twin {
    kind: Kind,
    state: State,
    time: f64,
    model: Kinds,
    /// The clocks that the importer has activated, and those that have ticked in this Event Mode.
    active: [bool; 7],
    done: [bool; 7],
    /// Scheduled Execution: the last tick of each clock, and whether `trip` has ticked unseen.
    last: [f64; 7],
    trips: bool,
    /// Time of the last event.
    event: f64,
}

impl Twin {
    fn new(kind: Kind) -> Self {
        let (state, model, no) = (Instantiated, Kinds::default(), [false; 7]);
        Self { kind, state, time: 0.0, model, active: no, done: no, last: [-1.0; 7], trips: false, event: 0.0 }
    }

    fn is(&self, states: &[State]) -> bool {
        states.contains(&self.state)
    }

    /// The model ticks the clock `number`.
    fn tick(&mut self, number: usize, now: f64) {
        let model = &mut self.model;
        model.counts[number] += 1;
        match number {
            2 => model.computed = model.u + model.x,
            5 => model.due = None,
            6 => model.due = Some(now + 0.25),
            _ => {}
        }
        self.done[number] = true;
    }

    /// Active clocks tick.
    fn tick_all(&mut self) {
        for n in (0..7).filter(|n| self.active[*n]).collect::<Vec<_>>() {
            self.tick(n, self.time);
        }
        self.active = [false; 7];
    }

    /// Whether a variable can be set, or read.
    fn open(&self, vr: u32, sets: bool) -> bool {
        let ticking = match vr {
            U => self.active[2] || self.active[6],
            Y => self.active[2],
            _ => true,
        };
        match self.state {
            State::Error | Terminated => !sets,
            Event => ticking,
            Step | Continuous => ticking && (vr != U && vr != Y),
            _ => true,
        }
    }

    fn enter(&mut self, host: &Host) -> Statuses {
        let wanted = verdict(self.is(&[Instantiated]));
        self.state = Initialization;
        let no = Fmi3Boolean(0);
        [unsafe { fmi3EnterInitializationMode(host.it.get(), no, 0.0, 0.0, no, 0.0) }, wanted]
    }

    fn exit(&mut self, host: &Host) -> Statuses {
        let wanted = verdict(self.is(&[Initialization]));
        self.state = if self.kind == Kind::Se { Activation } else { Event };
        self.model.initialize();
        [host.exit(), wanted]
    }

    fn set_clock(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let (vr, active) = (clock(turn), !turn.rarely());
        turn.note((vr, active));
        let changes = |n: usize| if active { n >= 4 || !self.done[n] } else { !self.active[n] };
        let fits = self.is(&[Event]) && number(vr).is_some_and(changes);
        if let (true, true, Some(n)) = (fits, active, number(vr))
            && !std::mem::replace(&mut self.active[n], true)
            && n == 2
        {
            self.model.y = self.model.computed;
        }
        [turn.importer.set_clock(vr, active), verdict(fits)]
    }

    fn get_clock(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let vr = turn.draw.of(&CLOCKS);
        let fits = self.is(&[Event, Activation]);
        let expected = match number(vr) {
            Some(n) => self.active[n],
            None if self.kind == Kind::Se => std::mem::take(&mut self.trips),
            None => self.active[6] && self.model.counts[6] % 2 == 1,
        };
        let seen = turn.importer.clock(vr);
        assert!(!fits || seen == Some(expected), "{vr}: {seen:?}, not {expected} {}", turn.trace);
        [verdict(seen.is_some()), verdict(fits)]
    }

    fn interval(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let vr = clock(turn);
        turn.note(vr);
        let fits = match vr {
            CONSTANT | FRACTION | FIXED => self.is(&[Initialization]),
            TUNABLE => self.is(&[Initialization, Event, Activation]),
            CHANGING => self.is(&[Initialization]) || self.is(&[Event, Activation]) && self.done[4],
            COUNTDOWN => self.is(&[Initialization, Event]),
            _ => false,
        };
        let expected = match vr {
            TUNABLE => Some(self.model.tunable),
            CHANGING => Some(0.1 * f64::from(self.model.counts[4] + 1)),
            _ => None,
        };
        let seen = turn.importer.interval(vr);
        if let (Some(expected), Some((interval, _))) = (expected, seen) {
            assert_eq!(interval.to_bits(), expected.to_bits(), "{}", turn.trace);
        }
        [verdict(seen.is_some()), verdict(fits)]
    }

    fn set_interval(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let vr = turn.draw.of(&[FIXED, TUNABLE, TUNABLE, CONSTANT, TRIGGERED]);
        let x = turn.draw.of(&[0.4, 0.2, 0.5, 0.0, f64::NAN]);
        turn.note((vr, x));
        let open =
            vr == FIXED && self.is(&[Initialization]) || vr == TUNABLE && self.is(&[Initialization, Event, Activation]);
        *(if vr == FIXED { &mut self.model.fixed } else { &mut self.model.tunable }) = x;
        [turn.importer.set_interval(vr, x), verdict(open && x > 0.0)]
    }

    fn shift(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let vr = clock(turn);
        let fits = self.is(&[Initialization]) && vr <= TUNABLE;
        let mut shift = -7.0;
        let status = unsafe { fmi3GetShiftDecimal(turn.importer.it.get(), &vr, 1, &mut shift) };
        assert!(!fits || shift == [0.05, 1.0, 0.0, 0.0][vr as usize - 1], "{}", turn.trace);
        [status, verdict(fits)]
    }

    fn update(&mut self, host: &Host) -> Statuses {
        let wanted = verdict(self.is(&[Event]));
        self.tick_all();
        [host.update(), wanted]
    }

    /// Active clocks tick, whether the importer updates or not.
    fn leave(&mut self, host: &Host) -> Statuses {
        let wanted = verdict(self.is(&[Event]));
        self.tick_all();
        self.state = if self.kind == Kind::Me { Continuous } else { Step };
        [host.leave(), wanted]
    }

    /// FMI 3.0 does not allow `SetTime` in Event Mode; importers call it.
    fn advance(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let h = f64::from(u8::try_from(turn.draw.below(5) + 1).unwrap()) * 0.0625;
        let it = turn.importer.it.get();
        let (from, to) = (self.time, self.time + h);
        self.time = to;
        if self.kind == Kind::Me {
            return [unsafe { fmi3SetTime(it, to) }, verdict(self.is(&[Continuous, Event]))];
        }
        let ([mut a, mut b, mut c], mut last) = ([Fmi3Boolean(9); 3], 0.0);
        let status = unsafe { fmi3DoStep(it, from, h, Fmi3Boolean(0), &mut a, &mut b, &mut c, &mut last) };
        [status, verdict(self.is(&[Step]))]
    }

    /// The same applies to `EnterEventMode`, which has no effect if no time has passed.
    fn event(&mut self, host: &Host) -> Statuses {
        let again = self.is(&[Event]) && self.kind == Kind::Me;
        let wanted = verdict(self.is(&[Step, Continuous]) || again);
        if !again || self.time > self.event {
            (self.active, self.done, self.event) = ([false; 7], [false; 7], self.time);
        }
        self.state = Event;
        [unsafe { fmi3EnterEventMode(host.it.get()) }, wanted]
    }

    fn activate(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let vr = clock(turn);
        let t = number(vr).map_or(1.0, |n| self.last[n].max(0.0)) + turn.mostly(&[0.125], &[0.0]);
        turn.note((vr, t));
        let fits = self.is(&[Activation]) && number(vr).is_some_and(|n| t > self.last[n]);
        if let (true, Some(n)) = (fits, number(vr)) {
            if n == 2 {
                self.model.y = self.model.computed;
            }
            self.tick(n, t);
            self.done = [false; 7];
            (self.done[n], self.last[n]) = (true, t);
            self.trips |= n == 6 && self.model.counts[6] % 2 == 0;
        }
        [turn.importer.activate(vr, t), verdict(fits)]
    }

    fn set(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let (vr, x) = (turn.draw.of(&[U, X, X, Y]), turn.mostly(&[1.0, -2.0, 0.5], &[f64::INFINITY]));
        turn.note((vr, x));
        let fits = self.open(vr, true) && vr != Y && x.is_finite();
        *(if vr == U { &mut self.model.u } else { &mut self.model.x }) = x;
        let status = turn.importer.set(vr, x);
        // A solver may try values in Continuous-Time Mode.
        let tried = !fits && self.is(&[Continuous]) && status == DISCARD;
        [status, if tried { DISCARD } else { verdict(fits) }]
    }

    fn get(&self, turn: &mut Turn<'_, Self>) -> Statuses {
        let vr = turn.draw.of(&[U, X, Y, FREE]);
        turn.note(vr);
        let fits = self.open(vr, false);
        let model = &self.model;
        let expected = match vr {
            U => model.u,
            X => model.x,
            Y => model.y,
            _ => model.computed,
        };
        let seen = turn.importer.get(vr);
        let same = seen.map(f64::to_bits) == Some(expected.to_bits());
        assert!(!fits || same, "{vr}: {seen:?} {expected} {}", turn.trace);
        [verdict(seen.is_some()), verdict(fits)]
    }
}

/// A clock that the importer ticks; rarely the other one, a variable or no reference.
fn clock(turn: &mut Turn<'_, Twin>) -> u32 {
    turn.mostly(&CLOCKS[..7], &[TRIP, X, 99])
}

/// The number of a clock that the importer ticks.
fn number(vr: u32) -> Option<usize> {
    CLOCKS[..7].iter().position(|clock| *clock == vr)
}

impl Importer for Rc<Host> {
    fn it(&self) -> InstancePointer {
        self.it.get()
    }

    fn messages(&self) -> Option<Vec<String>> {
        Some(self.errors())
    }
}

impl Oracle for Twin {
    type Importer = Rc<Host>;
    const CALLS: &'static [Call] = &[
        Call::Enter,
        Call::Exit,
        Call::SetClock,
        Call::GetClock,
        Call::Interval,
        Call::SetInterval,
        Call::Shift,
        Call::Update,
        Call::Leave,
        Call::Step,
        Call::Event,
        Call::Activate,
        Call::Set,
        Call::Get,
        Call::Terminate,
        Call::Reset,
        Call::Save,
        Call::Restore,
    ];
    const WILD: usize = 40;

    fn open(draw: &mut Draw) -> (Rc<Host>, Self) {
        let kind = draw.of(&[Kind::Cs, Kind::Me, Kind::Se]);
        (Host::open(kind), Self::new(kind))
    }

    fn state(&mut self) -> &mut State {
        &mut self.state
    }

    fn next(&self) -> &'static [Call] {
        use Call::*;
        match self.state {
            Instantiated => &[Enter, Enter, Set, Get, Save, Restore],
            Initialization => &[Exit, Exit, Set, Get, Interval, SetInterval, Shift, Save],
            State::Event => {
                &[SetClock, SetClock, GetClock, Set, Get, Interval, SetInterval, Update, Update, Leave, Save, Restore]
            }
            State::Step | Continuous => &[Step, Event, Event, Get, Set, Save, Restore],
            Activation => &[Activate, Activate, Activate, Set, Get, GetClock, Interval, SetInterval, Save, Restore],
            _ => &[Get, Reset, Reset, Restore],
        }
    }

    fn call(&mut self, call: Call, turn: &mut Turn<'_, Self>) -> Statuses {
        let host = turn.importer.clone();
        match call {
            Call::Enter => self.enter(&host),
            Call::Exit => self.exit(&host),
            Call::SetClock => self.set_clock(turn),
            Call::GetClock => self.get_clock(turn),
            Call::Interval => self.interval(turn),
            Call::SetInterval => self.set_interval(turn),
            Call::Shift => self.shift(turn),
            Call::Update => self.update(&host),
            Call::Leave => self.leave(&host),
            Call::Step => self.advance(turn),
            Call::Event => self.event(&host),
            Call::Activate => self.activate(turn),
            Call::Set => self.set(turn),
            Call::Get => self.get(turn),
            Call::Terminate => {
                let wanted = verdict(self.is(&[Event, Step, Continuous, Activation]));
                self.state = Terminated;
                [unsafe { fmi3Terminate(host.it.get()) }, wanted]
            }
            Call::Reset => {
                *self = Self::new(self.kind);
                [unsafe { fmi3Reset(host.it.get()) }, OK]
            }
            _ => unreachable!(),
        }
    }

    fn accepts(&self, saved: &Self) -> bool {
        saved.kind == self.kind
    }

    /// Variables that can always be read.
    fn look(&mut self, host: &Rc<Host>, trace: &str) {
        assert_eq!(host.ticks(), self.model.counts.iter().sum::<i32>(), "{trace}");
        assert_eq!(host.get(FREE).map(f64::to_bits), Some(self.model.computed.to_bits()), "{trace}");
    }
}

#[test]
fn random_calls_with_clocks() {
    random_calls::<Twin>(20_000);
}
