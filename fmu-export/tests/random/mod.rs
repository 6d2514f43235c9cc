//! Random calls of all interfaces, against FMI 2.0.5, 3.2.3 and 4.2.4 and FMI 3.0.2, 2.3, 3.2 and 4.2, written down once more by
//! hand, for the model that the test program exports.
#![allow(unreachable_pub, reason = "a module of several test programs")]
#![allow(clippy::float_cmp, reason = "values that are set or counted, to the last bit")]

mod reads;
mod turn;
mod twin;

use crate::oracle::{self, Call, Importer, Oracle, State, Statuses, Turn, bits};
use crate::solver::{DISCARD, ERROR, Fmu, Kind, OK, has_logger};
use State::{Continuous, Event, Initialization, Instantiated, Step, Terminated};
use fmu_core::draw::Draw;
use fmu_export::abi::types::{InstancePointer, c_int};
use turn::Attempt;
use twin::Snapshot;
pub(crate) use twin::Twin;

/// The letters of [`Fmu::state`].
const LETTERS: [(char, State); 7] = [
    ('i', Instantiated),
    ('n', Initialization),
    ('v', Event),
    ('c', Continuous),
    ('s', Step),
    ('t', Terminated),
    ('e', State::Error),
];

impl Importer for Fmu {
    fn it(&self) -> InstancePointer {
        self.it
    }

    fn version(&self) -> u8 {
        self.kind.version()
    }

    fn messages(&self) -> Option<Vec<String>> {
        let messages = self.messages().into_iter().map(|message| format!("{message:?}"));
        has_logger(self.kind.version()).then(|| messages.collect())
    }
}

impl<M: Twin> Oracle for Snapshot<M> {
    type Importer = Fmu;
    const CALLS: &'static [Call] = &[
        Call::Enter,
        Call::Exit,
        Call::Terminate,
        Call::Reset,
        Call::Event,
        Call::Update,
        Call::Leave,
        Call::SetTime,
        Call::SetStates,
        Call::Completed,
        Call::Step,
        Call::Set,
        Call::Get,
        Call::GetStates,
        Call::Derivatives,
        Call::Indicators,
        Call::Nominals,
        Call::Directional,
        Call::Save,
        Call::Restore,
        Call::New,
    ];
    const WILD: usize = 12;

    fn open(draw: &mut Draw) -> (Fmu, Self) {
        let kind = draw.of(M::KINDS);
        (Fmu::new(kind), Self::new(kind))
    }

    fn state(&mut self) -> &mut State {
        &mut self.state
    }

    fn next(&self) -> &'static [Call] {
        use Call::*;
        match self.state {
            Instantiated => &[Enter, Enter, Set, Save, Nominals],
            Initialization => &[Exit, Exit, Exit, Set, Set, Get, Save, Restore, GetStates, Indicators, Directional],
            State::Event if self.pending => {
                &[Set, Set, Update, Update, Update, Get, Restore, Directional, GetStates, Leave]
            }
            State::Event => &[Leave, Leave, Leave, Update, Set, Set, Save, Indicators, Nominals],
            Continuous => &[
                SetTime,
                SetTime,
                SetStates,
                SetStates,
                Set,
                Set,
                Derivatives,
                Completed,
                Completed,
                Event,
                Event,
                Get,
                Get,
                Save,
                Restore,
                GetStates,
                Indicators,
                Nominals,
                Directional,
            ],
            State::Step if self.kind.handles_events() => &[Step, Step, Step, Event, Event, Set, Get, Save, Restore],
            State::Step => &[Step, Step, Step, Set, Set, Get, Save, Restore],
            _ => &[Reset, Reset, Restore, Get, Directional],
        }
    }

    fn call(&mut self, call: Call, turn: &mut Turn<'_, Self>) -> Statuses {
        let mut attempt = Attempt { now: self, turn };
        match call {
            Call::Enter => attempt.enter(),
            Call::Exit => attempt.exit(),
            Call::Terminate => attempt.terminate(),
            Call::Reset => attempt.reset(),
            Call::Event => attempt.event(),
            Call::Update => attempt.update(),
            Call::Leave => attempt.leave(),
            Call::SetTime => attempt.set_time(),
            Call::SetStates => attempt.set_states(),
            Call::Completed => attempt.completed(),
            Call::Step => attempt.step(),
            Call::Set => attempt.set(),
            Call::Get => attempt.get(),
            Call::Directional => attempt.directional(),
            Call::GetStates | Call::Derivatives | Call::Indicators | Call::Nominals => attempt.values(call),
            Call::New => {
                (*attempt.turn.importer, *attempt.now) = Self::open(attempt.turn.draw);
                [OK, OK]
            }
            _ => unreachable!(),
        }
    }

    /// Every value and the state of the lifecycle.
    fn look(&mut self, fmu: &Fmu, trace: &str) {
        let version = self.kind.version();
        if version == 3 || !self.is(&[Instantiated]) {
            self.show();
            // Time is a variable only in FMI 3.0.
            let here = |r| usize::try_from(r).unwrap() <= M::TABLE.len() && (r > 0 || version == 3);
            let references: Vec<u32> = M::REALS.iter().copied().filter(|&r| here(r)).collect();
            let expected: Vec<f64> = references.iter().flat_map(|&r| self.reals(r).unwrap()).collect();
            let mut values = vec![f64::NAN; expected.len()];
            assert_eq!(fmu.try_get(&references, &mut values), OK, "{trace}");
            assert_eq!(bits(&values), bits(&expected), "{references:?} {trace}");
        }
        if self.block.model.is_healthy() {
            let state = fmu.state();
            assert!(LETTERS.contains(&(state, self.state)), "{state}, not {:?} at {} {trace}", self.state, self.end);
            fmu.messages();
        }
    }

    /// A reading call computes; the model may have done half of its work.
    fn failed(self, before: Self, call: Call) -> Self {
        use Call::*;
        let reads = matches!(call, Get | GetStates | Derivatives | Indicators | Nominals | Directional);
        if reads || matches!(call, Update | Leave | Step) { self } else { before }
    }

    fn saves(&mut self) {
        if !self.is(&[Instantiated, Initialization]) {
            self.show();
        } else if std::mem::take(&mut self.old) {
            self.observe();
        }
    }

    fn accepts(&self, saved: &Self) -> bool {
        interface(saved.kind) == interface(self.kind)
    }

    /// A NaN is refused.
    fn is_storable(&self) -> bool {
        self.is_storable()
    }

    fn restored(&mut self, saved: &Self) {
        *self = Self { kind: self.kind, ..saved.clone() };
    }

    /// A model without states has none to set, and no derivatives.
    fn can(call: Call) -> bool {
        call != Call::Directional || !M::CAN.states().is_empty()
    }
}

fn interface(kind: Kind) -> u8 {
    match kind {
        Kind::Me2 | Kind::Me3 => 0,
        Kind::Cs3 { event: true, .. } => 1,
        _ => 2,
    }
}

pub(crate) fn random_calls<M: Twin>() {
    oracle::random_calls::<Snapshot<M>>(100_000);
}
