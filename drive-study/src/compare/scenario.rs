//! The scenarios. Each one is a row here; its function runs a drive and measures numbers.

use super::candidate::Candidate;
use super::measure::Outcome;
use super::{parameters, running, signal, weakening};
use drive_tools::tune::setting::Tuned;
use fmu_core::Fault;

pub use super::measure::Effort;

/// One scenario.
#[derive(Debug)]
pub struct Scenario {
    /// Its name on the command line.
    pub id: &'static str,
    /// The table that it belongs to.
    pub group: &'static str,
    /// The scenario in one sentence.
    pub title: &'static str,
    /// Runs it.
    pub run: ScenarioRun,
}

/// What a scenario runs.
#[derive(Clone, Copy, Debug)]
pub enum ScenarioRun {
    /// An estimator with the gains of the review's figures.
    Review(fn(&Candidate, Effort) -> Result<Outcome, Fault>),
    /// An estimator tuned for the user's machine.
    Machine(fn(&Tuned, Effort) -> Result<Outcome, Fault>),
}

const START: &str = "Start, ramp, reversal";
const LOAD: &str = "Load steps";
const RATED: &str = "Rated load held";
const LOWEST: &str = "Lowest speed at rated load";
const GENERATING: &str = "Rated load that drives, at low speed";
const WEAKENING: &str = "Field weakening";
const WRONG: &str = "Wrong parameters: mean angle error";
const DEAD: &str = "Dead time of 2 us";
const BANDWIDTH: &str = "Bandwidth of the speed loop";
const SIGNAL: &str = "Injected signal";

const fn row(
    id: &'static str,
    group: &'static str,
    title: &'static str,
    run: fn(&Candidate, Effort) -> Result<Outcome, Fault>,
) -> Scenario {
    Scenario { id, group, title, run: ScenarioRun::Review(run) }
}

/// All scenarios, in the order of the tables.
pub static SCENARIOS: &[Scenario] = &[
    row(
        "start",
        START,
        "standstill to ±0.5 pu (injection ±0.1) from 24 angles, dead time compensated, every other with 0.3 pu of load",
        running::start,
    ),
    row("ramp", START, "from standstill to 0.15 pu, then to 1 pu within 1 s, 0.3 pu of load", running::ramp),
    row(
        "reversal",
        START,
        "0.5 to -0.5 pu in 0.5 s with 0.3 pu of load (injection 0.1 to -0.1; Hybrid 0, 0.95, -0.95, 0 with 0.8): at light \
         load those that derive the sign of the speed from the EMF lose the rotor, as the review says",
        |s, _| running::reversal(s),
    ),
    row("load-0", LOAD, "100 % load step at standstill", |s, _| running::load_step(s, 0.0, 1.0)),
    row("load-0.1", LOAD, "50 % load step at 0.1 pu", |s, _| running::load_step(s, 0.1, 0.5)),
    row("load-0.5", LOAD, "50 % load step at 0.5 pu", |s, _| running::load_step(s, 0.5, 0.5)),
    row("load-1", LOAD, "50 % load step at 1 pu", |s, _| running::load_step(s, 1.0, 0.5)),
    row("rated-0", RATED, "rated load at standstill", |s, _| running::rated(s, 0.0)),
    row("rated-0.1", RATED, "rated load at 0.1 pu", |s, _| running::rated(s, 0.1)),
    row("rated-back", RATED, "rated load at -0.1 pu", |s, _| running::rated(s, -0.1)),
    row("rated-0.5", RATED, "rated load at 0.5 pu", |s, _| running::rated(s, 0.5)),
    row("rated-1", RATED, "rated load at 1 pu", |s, _| running::rated(s, 1.0)),
    row("lowest", LOWEST, "ideal inverter, the load applied at 0.5 pu (injection: at that speed)", running::lowest),
    row("lowest-dead", LOWEST, "the same with 2 us dead time, compensated", |s, e| {
        running::lowest(&s.with_dead_time(true), e)
    }),
    row("as-printed", LOWEST, "without the frame-speed term, as the review prints (18)", |s, _| running::as_printed(s)),
    row("arriving", LOWEST, "ideal inverter, the load applied at that speed within 0.3 s", running::arriving),
    row("generating-0.02", GENERATING, "applied within 0.3 s at 0.02 pu", |s, _| running::generating(s, 0.02)),
    row("generating-0.05", GENERATING, "applied within 0.3 s at 0.05 pu", |s, _| running::generating(s, 0.05)),
    row("generating-0.1", GENERATING, "applied within 0.3 s at 0.1 pu", |s, _| running::generating(s, 0.1)),
    row(
        "weakening",
        WEAKENING,
        "0.5 pu to 2.5 times the base speed n_b (Rasmussen 1.5: its machine ends at 1.62), then 1.1 times the load of the \
         envelope there; VoltageModel with 0.7 psi_M/L_d, VoltageFeedback with k_u = 0.9",
        |s, _| weakening::run(s),
    ),
    row("wrong-r", WRONG, "R at rated load and 0.1 pu", |s, _| parameters::wrong(s, 0.1, |m| &mut m.R_s)),
    row("wrong-l-q", WRONG, "L_q at rated load and 0.5 pu (injection 0.1)", |s, _| {
        parameters::wrong(s, 0.5, |m| &mut m.L_q)
    }),
    row("wrong-psi", WRONG, "psi_M at rated load and 0.5 pu (injection 0.1)", |s, _| {
        parameters::wrong(s, 0.5, |m| &mut m.psi_M)
    }),
    row("dead", DEAD, "uncompensated, rated load at 0.1 pu", |s, _| parameters::dead_time(s, false)),
    row("dead-compensated", DEAD, "compensated, rated load at 0.1 pu", |s, _| parameters::dead_time(s, true)),
    row("reversal-dead", DEAD, "compensated, the reversal", |s, _| running::reversal(&s.with_dead_time(true))),
    row("bandwidth", BANDWIDTH, "with the speed loop of all other scenarios, without noise", running::bandwidth),
    row(
        "bandwidth-fast",
        BANDWIDTH,
        "with the speed loop for which the review gives one, without noise",
        running::bandwidth_fast,
    ),
    row("signal", SIGNAL, "at standstill, without load and noise", |s, _| signal::cost(s)),
    row("signal-trace", SIGNAL, "Fig. 8 and 11: at 0.05 pu", |s, _| signal::response(s)),
];

/// The scenario with this name.
pub fn find(id: &str) -> Option<&'static Scenario> {
    SCENARIOS.iter().find(|s| s.id == id)
}
