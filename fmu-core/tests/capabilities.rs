//! The table of capabilities: derived properties, and refusals.
#![allow(missing_docs)]

use fmu_core::unit::{ONE, PER_SECOND};
use fmu_core::*;
use serde::{Deserialize, Serialize};

/// A state in addition to a sampled part.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Both {
    x: f64,
    n: i32,
    samples: u64,
    shown: i32,
}

type V = Row<Block<Both>>;

impl Model for Both {
    type Outputs = ();
    const INFO: Info = Info { name: "Both", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> =
        table![V::output("x", &ONE, "", |m| &mut m.model.x), V::integer_output("n", "", |m| &mut m.model.n)];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::hybrid::<Self, 1>(self, step, 0.1)
    }
}

impl ContinuousTime for Both {
    const STATES: &'static [State<Self>] = &[State::new("x", &PER_SECOND, |m: &mut Self| &mut m.x)];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = f64::from(self.n);
        Ok(())
    }
}

impl Sampled for Both {
    fn period(&self) -> f64 {
        0.5
    }
    fn samples(&self) -> u64 {
        self.samples
    }
    fn show(&mut self) {
        self.shown = self.n;
    }
    fn sample(&mut self) -> Result<(), Fault> {
        self.samples += 1;
        self.n += 1;
        Ok(())
    }
}

const NONE: Capabilities<Both> = Capabilities::NONE;

/// Its step integrates between the samples, so it is not a model with samples only.
#[test]
fn event_mode_is_for_models_without_states() {
    assert!(NONE.Sampled().event_mode());
    assert!(!NONE.ContinuousTime().Sampled().event_mode() && !NONE.Sampled().ContinuousTime().event_mode());
    assert!(!NONE.model_exchange() && NONE.Sampled().model_exchange() && NONE.ContinuousTime().model_exchange());
}

#[test]
fn samples_and_states_advance_together() {
    let mut both = Both::default();
    for k in 0..4_u32 {
        both.advance(&Step { start: Elapsed::ZERO.plus(f64::from(k) * 0.7), h: 0.7 }).unwrap();
    }
    // Samples at 0, 0.5, ... 2.5 s: 0.5 s each with 1, 2, ... 5, and 0.3 s with 6.
    assert!(both.samples == 6 && (both.x - (7.5 + 1.8)).abs() < 1e-12, "{} {}", both.samples, both.x);
}

/// Its one clock: when it becomes active, the outputs of the last sample become visible; its tick is the next sample.
#[test]
fn a_sampled_model_acts_on_its_clock() {
    let clock = const { NONE.Clocked().clocked }.unwrap();
    let (mut both, now) = (Both { n: 3, ..Both::default() }, Elapsed::ZERO);
    (clock.activate)(&mut both, 0, now);
    assert_eq!((both.shown, both.samples), (3, 0));
    (clock.tick)(&mut both, 0, now).unwrap();
    assert_eq!((both.shown, both.samples, both.n), (3, 1, 4));
    // The importer alone determines its ticks.
    assert_eq!(
        ((clock.interval)(&both, 0, now), (clock.ticked)(&mut both, 0), clock.feedthrough),
        (None, false, false)
    );
}

#[test]
fn another_interface_is_another_token() {
    let tokens =
        [NONE, NONE.Sampled(), NONE.ContinuousTime(), NONE.ContinuousTime().Sampled()].map(|can| can.hash().guid());
    for (i, token) in tokens.iter().enumerate() {
        assert!(tokens[..i].iter().all(|other| other.as_str() != token.as_str()));
    }
    assert_eq!(NONE.hash().guid().as_str(), Both::HASH.guid().as_str());
}

/// A model that can do everything.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Whole {
    n: u64,
    x: Vec<f64>,
    accounts: u32,
}

type W = Row<Block<Whole>>;

impl Model for Whole {
    type Outputs = ();
    const INFO: Info = Info { name: "Whole", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        W::structural("n", "", |m| &mut m.model.n).at_most(2.0),
        W::array_output("x", &ONE, "", 2, |m| &mut m.model.x).sized(&["n"]),
        W::clock("tick", "", Clock::countdown()),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl ContinuousTime for Whole {
    const STATES: &'static [State<Self>] = &[State::array("x", &PER_SECOND, 2, |m: &mut Self| &mut m.x)];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx.fill(1.0);
        Ok(())
    }
}

impl Differentiable for Whole {
    fn tangent(&self, _: Elapsed, _: &Self, dx: &mut [f64], (): &mut ()) -> Result<(), Fault> {
        dx.fill(0.0);
        Ok(())
    }
}

impl Events for Whole {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: "z", description: "" }];
    fn event(&mut self, _: Elapsed) -> Result<Outcome, Fault> {
        Ok(Outcome::default())
    }
    fn next(&self, _: Elapsed) -> Next {
        Next::Never
    }
}

impl EventMode for Whole {
    fn to_event(&mut self, step: &Step) -> Result<Stop, Fault> {
        Ok(Stop { at: step.end(), event: true, settles: false })
    }
}

impl CompletedSteps for Whole {
    fn complete(&mut self, _: Elapsed) -> Result<(), Fault> {
        self.accounts += 1;
        Ok(())
    }
    fn account(&mut self, _: Account) {}
}

impl Clocked for Whole {
    const FEEDTHROUGH: bool = true;
    fn tick(&mut self, _: usize, _: Elapsed) -> Result<(), Fault> {
        Ok(())
    }
    fn interval(&self, _: usize, _: Elapsed) -> Option<f64> {
        Some(0.5)
    }
}

impl Resizable for Whole {
    fn resize(&mut self) -> Result<(), Fault> {
        self.x.resize(usize::try_from(self.n).unwrap(), 0.0);
        Ok(())
    }
}

impl Intermediate for Whole {
    fn longest(&self) -> f64 {
        0.125
    }
}

/// Each addition to an interface changes what an importer sees of it, and its token.
#[test]
fn every_capability_has_its_own_function_and_token() {
    type Can = Capabilities<Whole>;
    let base = || Can::stored().ContinuousTime().Events();
    let all = [
        Can::stored(),
        Can::unstored(),
        Can::unsaved(),
        Can::stored().ContinuousTime(),
        base(),
        Can::unstored().ContinuousTime().Events(),
        base().EventMode(),
        base().ModelExchangeOnly(),
        base().CompletedSteps(),
        base().Clocked(),
        base().Clocked().ScheduledExecution(),
    ];
    for (i, can) in all.iter().enumerate() {
        let same = |other: &Can| other.hash().guid().as_str() == can.hash().guid().as_str();
        assert_eq!(all.iter().position(same), Some(i));
    }
    let keeps = [0, 1, 2].map(|i: usize| all[i].keeps());
    assert_eq!(keeps, [Keeps::Stored, Keeps::Saved, Keeps::Nothing]);
    // These do not change the token: the importer makes the same calls, or reads the capability in the description.
    for can in [base().Differentiable(), base().Resizable(), base().Intermediate()] {
        assert_eq!(can.hash().guid().as_str(), base().hash().guid().as_str());
    }
    assert!(!base().event_mode() && base().EventMode().event_mode() && base().Clocked().event_mode());

    let (mut whole, step) = (Whole { n: 2, ..Whole::default() }, Step { start: Elapsed::ZERO, h: 0.5 });
    (base().Resizable().resizable.unwrap())(&mut whole).unwrap();
    assert_eq!(whole.x.len(), 2);
    assert!((base().EventMode().to_event.unwrap())(&mut whole, &step).unwrap().event);
    (base().CompletedSteps().complete.unwrap().complete)(&mut whole, Elapsed::ZERO).unwrap();
    assert_eq!(whole.accounts, 1);
    let clocked = base().Clocked().clocked.unwrap();
    assert!(clocked.feedthrough && (clocked.interval)(&whole, 0, Elapsed::ZERO) == Some(0.5));
    assert!((base().Intermediate().intermediate.unwrap())(&whole) <= 0.125);
    let (saving, storing) = (Can::stored().saved.unwrap(), Can::stored().stored.unwrap());
    let mut copy = saving.model(&whole);
    assert_eq!((copy.n, copy.x.len(), copy.accounts), (2, 2, 1));
    whole.accounts = 7;
    saving.overwrite(&mut copy, &whole);
    assert_eq!((copy.n, copy.accounts), (2, 7));
    let mut bytes = [0; 64];
    let n = (storing.write)(&whole, &mut bytes).unwrap();
    assert_eq!((storing.size)(&whole).unwrap(), n);
    let (read, rest) = (storing.read)(&bytes).unwrap();
    assert_eq!((read.n, read.x, read.accounts, rest.len()), (2, vec![0.0; 2], 7, 64 - n));
    assert!((storing.read)(&bytes[..n - 1]).err().unwrap().message().starts_with("content: "));
    let short = (storing.write)(&whole, &mut bytes[..n - 1]).unwrap_err();
    assert!(short.message().starts_with("the state cannot be serialized: "), "{short}");
}

/// An integer row.
const WRONG: &[State<Both>] = &[State::new("n", &PER_SECOND, |m: &mut Both| &mut m.x)];

struct Nameless;

impl Exported for Nameless {
    type Model = Both;
    const CAN: Capabilities<Both> = {
        let mut can = NONE.ContinuousTime();
        if let Some(continuous) = &mut can.continuous {
            continuous.states = WRONG;
        }
        can
    };
}

#[test]
fn a_state_needs_a_continuous_row() {
    let fault = Description::exported::<Nameless>().unwrap_err();
    assert_eq!(fault.message(), "the state n has no continuous real output or state in the table");
}

/// A model with one event indicator, whose name depends on `LOW`.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Indicated<const LOW: bool>;

impl<const LOW: bool> Model for Indicated<LOW> {
    type Outputs = ();
    const INFO: Info = Info { name: "Indicated", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![Row::constant("k", &ONE, "", 1.0)];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl<const LOW: bool> ContinuousTime for Indicated<LOW> {
    const STATES: &'static [State<Self>] = &[];
    fn derivatives(&self, _: Elapsed, _: &mut [f64]) -> Result<(), Fault> {
        Ok(())
    }
}

impl<const LOW: bool> Events for Indicated<LOW> {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: if LOW { "low" } else { "high" }, description: "" }];
    fn event(&mut self, _: Elapsed) -> Result<Outcome, Fault> {
        Ok(Outcome::default())
    }
    fn next(&self, _: Elapsed) -> Next {
        Next::Never
    }
}

#[test]
fn another_indicator_is_another_token() {
    let low = Capabilities::<Indicated<true>>::NONE.ContinuousTime().Events().hash().guid();
    let high = Capabilities::<Indicated<false>>::NONE.ContinuousTime().Events().hash().guid();
    assert_ne!(low.as_str(), high.as_str());
}
