//! No control sample is lost or doubled, regardless of the communication step and however the importer adds up its time.
//!
//! A model that counts its samples, through the C functions; the expected results are counted in integers. 1e7 steps of every
//! step size from every start with optimization. Without it, 1e7 steps of a third of a sample from one start, and a fortieth of that
//! in all other cases. `FMU_STEPS=n` selects another number.
#![allow(missing_docs, clippy::float_cmp)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

use fmu_core::unit::SECOND;
use fmu_core::{Block, Elapsed, Experiment, Exported, Fault, Info, Model, Row, SampleGrid, Step, Table, table};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use std::ffi::CString;
use std::ptr::null;

/// Counts the instants `k T_s` that have come.
#[derive(Clone, Serialize, Deserialize)]
struct Sampler {
    period: f64,
    count: u64,
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    count: i32,
}

impl Default for Sampler {
    fn default() -> Self {
        Self { period: 1e-4, count: 0 }
    }
}

type V = Row<Block<Sampler>>;

/// Value references.
const COUNT: u32 = 1;
const PERIOD: u32 = 2;

impl Model for Sampler {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "Sampler",
        version: "1",
        experiment: Experiment { stop: 1.0, step: 1e-4, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::integer_output("count", "Instants after the start that have come", |m| &mut m.out.count),
        V::parameter("T_s", &SECOND, "Sample period", |m| &mut m.model.period).above(0.0),
    ];

    fn initialize(&mut self) {
        self.count = 0;
    }

    fn output(&self, _: Elapsed, out: &mut Outputs) {
        out.count = i32::try_from(self.count).unwrap_or(i32::MAX);
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        let grid = SampleGrid { period: self.period };
        while grid.reached(self.count + 1, step.end()) {
            self.count += 1;
        }
        Ok(())
    }
}

fmu_export::export!(Sampler);
use fmi::*;

/// An instance of one of the standards after its initialization.
struct Fmu(u8, InstancePointer);

impl Fmu {
    fn started(version: u8, start: f64, period: f64) -> Self {
        // The library silences panics; a test needs its own.
        fmu_export::abi::quiet();
        drop(std::panic::take_hook());
        let token = CString::new(fmi::This::TOKEN.as_str()).unwrap();
        let (name, token) = (c"sampler".as_ptr(), token.as_ptr());
        let (no, no3) = (Fmi2Boolean(0), Fmi3Boolean(0));
        unsafe {
            let it = if version == 2 {
                fmi2Instantiate(name, 1, token, null(), null(), no, no)
            } else {
                let none = std::ptr::null_mut();
                fmi3InstantiateCoSimulation(name, token, null(), no3, no3, no3, no3, null(), 0, none, None, None)
            };
            assert!(!it.is_null());
            let fmu = Self(version, it);
            if version == 2 {
                assert_eq!(fmi2SetReal(it, &PERIOD, 1, &period), 0);
                assert_eq!(fmi2SetupExperiment(it, no, 0.0, start, no, 0.0), 0);
                assert_eq!((fmi2EnterInitializationMode(it), fmi2ExitInitializationMode(it)), (0, 0));
            } else {
                assert_eq!(fmi3SetFloat64(it, &PERIOD, 1, &period, 1), 0);
                assert_eq!(fmi3EnterInitializationMode(it, no3, 0.0, start, no3, 0.0), 0);
                assert_eq!(fmi3ExitInitializationMode(it), 0);
            }
            fmu
        }
    }

    fn step(&self, t: f64, h: f64) -> c_int {
        let (mut event, mut end, mut early, mut last) = (Fmi3Boolean(9), Fmi3Boolean(9), Fmi3Boolean(9), f64::NAN);
        unsafe {
            if self.0 == 2 {
                fmi2DoStep(self.1, t, h, Fmi2Boolean(1))
            } else {
                fmi3DoStep(self.1, t, h, Fmi3Boolean(1), &mut event, &mut end, &mut early, &mut last)
            }
        }
    }

    fn count(&self) -> u64 {
        let mut count = Fmi2Integer(0);
        let status = unsafe {
            if self.0 == 2 {
                fmi2GetInteger(self.1, &COUNT, 1, &mut count)
            } else {
                fmi3GetInt32(self.1, &COUNT, 1, &mut count.0, 1)
            }
        };
        assert_eq!(status, 0);
        u64::try_from(count.0).unwrap()
    }
}

impl Drop for Fmu {
    fn drop(&mut self) {
        unsafe { if self.0 == 2 { fmi2FreeInstance(self.1) } else { fmi3FreeInstance(self.1) } }
    }
}

/// How an importer computes the times of its steps.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Clock {
    /// t = t + h, h always the same.
    Accumulates,
    /// t = start + n h, h always the same.
    Multiplies,
    /// t = start + n h, and the step is the difference to the next t.
    Differs,
}

/// Step sizes as fractions of `T_s`.
const FRACTIONS: [(u32, u32); 4] = [(1, 1), (1, 3), (7, 10), (10, 1)];

fn steps() -> u32 {
    let asked = std::env::var("FMU_STEPS").ok();
    asked.map_or(10_000_000, |n| n.parse().unwrap_or_else(|_| panic!("FMU_STEPS = {n:?} is not a whole number")))
}

/// Runs and compares with integers after every step.
fn run(version: u8, clock: Clock, start: f64, period: f64, (over, under): (u32, u32), steps: u32) {
    let fmu = Fmu::started(version, start, period);
    let h = f64::from(over) * period / f64::from(under);
    let mut t = start;
    for n in 1..=u64::from(steps) {
        #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
        let next = if clock == Clock::Accumulates { t + h } else { start + n as f64 * h };
        let size = if clock == Clock::Differs { next - t } else { h };
        let status = fmu.step(t, size);
        let (count, expected) = (fmu.count(), n * u64::from(over) / u64::from(under));
        assert_eq!(
            (status, count),
            (0, expected),
            "FMI {version}, {clock:?}, start {start}, T_s {period}, h = {over}/{under} T_s: step {n} from {t}"
        );
        t = next;
    }
}

/// Every step size from every start, the standards in turn.
fn each(clock: Clock, periods: &[f64]) {
    for (i, start) in [0.0, -3.0, 1e6].into_iter().enumerate() {
        for (j, fraction) in FRACTIONS.into_iter().enumerate() {
            for &period in periods {
                let version = if (i + j) % 2 == 0 { 2 } else { 3 };
                let whole = !cfg!(debug_assertions) || (clock == Clock::Accumulates && (i, j) == (0, 1));
                run(version, clock, start, period, fraction, if whole { steps() } else { steps() / 40 });
            }
        }
    }
}

#[test]
fn time_that_is_accumulated() {
    each(Clock::Accumulates, &[1e-4]);
}

#[test]
fn time_that_is_multiplied() {
    each(Clock::Multiplies, &[1e-4, 5e-5]);
}

/// Where the number of samples fits an Integer of FMI 2.0.
#[test]
#[ignore = "takes minutes with optimization"]
fn a_billion_steps() {
    for (version, start, fraction) in [(2, 0.0, FRACTIONS[0]), (3, -3.0, FRACTIONS[1]), (2, 1e6, FRACTIONS[2])] {
        run(version, Clock::Accumulates, start, 1e-4, fraction, 1_000_000_000);
    }
}

/// The step sizes themselves are rounded as the times are: at 1e6 s to 1.2e-10 s.
#[test]
fn steps_that_are_differences_of_times() {
    each(Clock::Differs, &[1e-4, 5e-5]);
}
