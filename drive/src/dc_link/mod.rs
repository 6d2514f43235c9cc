//! The DC link of `PmsmDrive`: source with a resistance, capacitor, precharge and brake chopper.
//!
//! ```text
//! C du/dt = i_source - i_chopper - i_dc      i_source = (u_dc - u) / R      i_chopper = u / R_chopper while it is on
//! ```
//!
//! `u_dc` is then the voltage of the source; inverter and controller have the capacitor's voltage u. With
//! `dc_link.R_precharge` the capacitor is empty at the start and charges through this resistance in series with R_source,
//! until a sample measures 95 % of the source's voltage; until then, the controller rests. The chopper switches on at
//! `chopper.u_on` and off at `chopper.u_off`.
//!
//! In Co-Simulation the link advances with each interval of the plant's steps, from the energy transferred in it (`circuit`);
//! the plant has the voltage at the start of the interval. In Model Exchange u is a continuous state, the switching of the
//! chopper is a state event, and the energies follow from the same circuit between two points of the solution.

mod circuit;
mod parameters;
pub mod ripple;

pub use circuit::LinkEnergy;
use circuit::{Circuit, Piece};
use fmu_core::unit::{AMPERE, JOULE, VOLT, WATT};
use fmu_core::{Account, Dual, Elapsed, Kept, Row, Scalar, Table, table};
pub use parameters::{Chopper, DcLink, LINK, LinkParameters};
use serde::{Deserialize, Serialize};

/// Share of the source's voltage at which the precharge ends.
const CHARGED: f64 = 0.95;

/// Maximum number of switching events of the chopper in an interval; then it keeps its state until the end.
const MAX_SWITCHINGS: u32 = 1000;

/// Shift of the indicator toward the chopper's present state, so that it never stays at 0.
const SHIFT: f64 = 1e-9;

/// Maximum change of the voltage in an interval by the current of the inverter, as a share.
const LARGEST_CHANGE: f64 = 0.1;

/// Maximum number of intervals in a sample period.
const MAX_PARTS: f64 = 50.0;

/// Number of bisections to find a switching.
const BISECTIONS: u32 = 40;

/// State of the link.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Link {
    /// Voltage of the capacitor in V; 0 without the link.
    pub u: f64,
    /// The capacitor charges through the resistance of the precharge.
    pub precharges: bool,
    /// The chopper is on.
    pub chops: bool,
    /// Since the start.
    pub energy: LinkEnergy,
    /// Length in s of the communication step, and within it the charge from the source in C and the energy of the chopper in J.
    h: f64,
    charge: f64,
    chopped: f64,
    /// Energy in J that the inverter took from an empty capacitor.
    owed: f64,
    /// Model Exchange: the last point of the solution, and the counts of earlier ones.
    point: Counted,
    kept: Kept<(LinkEnergy, Counted)>,
}

/// The last point of the importer's solution, up to which the energies are counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Counted {
    time: Elapsed,
    u: f64,
    /// Voltage of the source in V.
    source: f64,
    /// Energy in J that the inverter had taken.
    taken: f64,
}

/// The link between two events: conductances in S.
#[derive(Clone, Copy, Debug)]
struct Conductances {
    source: f64,
    chopper: f64,
}

impl Link {
    /// At the start, on a source of `u_dc` (V).
    pub fn new(par: &LinkParameters, u_dc: f64) -> Self {
        if !par.dc_link.used {
            return Self::default();
        }
        let precharges = par.dc_link.R_precharge > 0.0;
        let u = if precharges { 0.0 } else { u_dc };
        let mut link =
            Self { u, precharges, point: Counted { u, source: u_dc, ..Counted::default() }, ..Self::default() };
        link.event(par);
        link
    }

    fn conductances(&self, par: &LinkParameters) -> Conductances {
        let DcLink { R_source, R_precharge, .. } = par.dc_link;
        let R = if self.precharges { R_source + R_precharge } else { R_source };
        Conductances { source: 1.0 / R, chopper: if self.chops { 1.0 / par.chopper.R } else { 0.0 } }
    }

    fn circuit(&self, par: &LinkParameters, U: f64) -> Circuit {
        let Conductances { source, chopper } = self.conductances(par);
        Circuit { C: par.dc_link.C, source, chopper, U }
    }

    /// Whether the chopper switches at the voltage `u` (V).
    fn switches(&self, par: &LinkParameters, u: f64) -> bool {
        let Chopper { used, u_on, u_off, .. } = par.chopper;
        used && if self.chops { u <= u_off } else { u >= u_on }
    }

    /// At a sample, on a source of `u_dc` (V): the precharge may end.
    pub fn sample(&mut self, u_dc: f64) {
        if self.precharges && u_dc > 0.0 && self.u >= CHARGED * u_dc {
            self.precharges = false;
        }
    }

    /// At an event: the chopper may switch.
    pub fn event(&mut self, par: &LinkParameters) {
        if self.switches(par, self.u) {
            self.chops = !self.chops;
        }
    }

    /// A communication step of `h` (s) begins.
    #[inline]
    pub fn begin(&mut self, h: f64) {
        (self.h, self.charge, self.chopped) = (h, 0.0, 0.0);
    }

    /// The maximum interval in s, within the remaining `h` (s) of a sample period `T_s` (s), in which the current `i_dc` (A) of
    /// the inverter changes the voltage by at most a tenth: the inverter has the voltage at its start. A stiff source keeps the
    /// voltage constant for any capacitor.
    #[inline(never)]
    pub fn longest(&self, par: &LinkParameters, h: f64, T_s: f64, i_dc: f64) -> f64 {
        let parts = (self.circuit(par, 0.0).change(h, i_dc) / (LARGEST_CHANGE * self.u)).ceil();
        // Without a voltage, the minimum; NaN is one part.
        (h / parts.max(1.0)).max(T_s / MAX_PARTS).min(h)
    }

    /// Advances by `h` (s) on a source of `U` (V), while the inverter draws `energy` (J).
    pub fn advance(&mut self, par: &LinkParameters, U: f64, h: f64, energy: f64) {
        let power = (energy + std::mem::take(&mut self.owed)) / h;
        let mut left = h;
        for _ in 0..MAX_SWITCHINGS {
            self.event(par);
            let circuit = self.circuit(par, U);
            let over = |t: f64| circuit.over(self.u, t, power * t);
            let piece = over(left);
            if !self.switches(par, piece.u) {
                return self.take(&piece);
            }
            let (mut before, mut after) = (0.0, left);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (before + after);
                *(if self.switches(par, over(middle).u) { &mut after } else { &mut before }) = middle;
            }
            let piece = over(after);
            self.take(&piece);
            left -= after;
            if left <= 0.0 {
                return;
            }
        }
        let piece = self.circuit(par, U).over(self.u, left, power * left);
        self.take(&piece);
    }

    fn take(&mut self, piece: &Piece) {
        self.u = piece.u;
        self.energy.add(&piece.energy);
        self.charge += piece.charge;
        self.chopped += piece.energy.chopper;
        self.owed += piece.owed;
    }

    /// Model Exchange: a point of the solution, when the inverter has `taken` this energy (J) since the start, on a source of
    /// `U` (V). The losses since the last point are computed for a constant power; with the voltage of the solution, the energy
    /// of the source follows from the balance, which then holds for any step and any tolerance of the solver.
    pub fn complete(&mut self, par: &LinkParameters, now: Elapsed, U: f64, taken: f64) {
        let h = now.since(self.point.time);
        if h > 0.0 {
            let Counted { u, source, taken: before, .. } = self.point;
            let LinkEnergy { resistor, chopper, .. } =
                self.circuit(par, 0.5 * (source + U)).over(u, h, taken - before).energy;
            let stored = 0.5 * par.dc_link.C * (self.u * self.u - u * u);
            self.energy.add(&LinkEnergy { source: resistor + chopper + taken - before + stored, resistor, chopper });
        }
        self.point = Counted { time: now, u: self.u, source: U, taken };
    }

    /// Model Exchange: keeps the counts at the points of the solution, or restores earlier ones.
    pub fn account(&mut self, account: Account) {
        let mut counts = (self.energy, self.point);
        self.kept.follow(account, &mut counts);
        (self.energy, self.point) = counts;
    }

    /// Derivative of the voltage `u` (V) in V/s, on a source of `U` (V), with the current `i_dc` (A) of the inverter. The diodes of
    /// the inverter keep it from falling below 0.
    pub fn slope<S: Scalar>(&self, par: &LinkParameters, (u, U, i_dc): (S, S, S)) -> S {
        let Conductances { source, chopper } = self.conductances(par);
        let slope = ((U - u) * source - u * chopper - i_dc) * (1.0 / par.dc_link.C);
        if u.value() <= 0.0 && slope.value() < 0.0 { 0.0.into() } else { slope }
    }

    /// Model Exchange: the outputs at an instant with the voltage `u` (V), on a source of `U` (V).
    pub fn shown<S: Scalar>(&self, par: &LinkParameters, u: S, U: S) -> LinkOutputs<S> {
        let Conductances { source, chopper } = self.conductances(par);
        LinkOutputs { i_source: (U - u) * source, p_chopper: u * u * chopper, ..self.outputs(u) }
    }

    /// The outputs at the end of a communication step, on a source of `U` (V); before the first step, at the instant.
    pub fn reached(&self, par: &LinkParameters, U: f64) -> LinkOutputs {
        let Self { h, charge, chopped, .. } = *self;
        if h > 0.0 {
            LinkOutputs { i_source: charge / h, p_chopper: chopped / h, ..self.outputs(self.u) }
        } else {
            self.shown(par, self.u, U)
        }
    }

    fn outputs<S: Scalar>(&self, u: S) -> LinkOutputs<S> {
        let &Self { precharges, chops, energy, .. } = self;
        LinkOutputs { u, precharges, chops, energy, ..LinkOutputs::none() }
    }

    /// The indicator of the chopper's switching.
    pub fn indicator(&self, par: &LinkParameters) -> f64 {
        let Chopper { used, u_on, u_off, .. } = par.chopper;
        if !used {
            return 1.0;
        }
        let (threshold, shift) = if self.chops { (u_off, SHIFT) } else { (u_on, -SHIFT) };
        let z = self.u / threshold - 1.0 + shift;
        if z == 0.0 { shift } else { z }
    }
}

/// Outputs of the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinkOutputs<S = f64> {
    /// Voltage of the capacitor in V.
    pub u: S,
    /// Current from the source in A.
    pub i_source: S,
    /// Power of the chopper in W.
    pub p_chopper: S,
    /// Ripple current of the capacitor in A (rms).
    pub i_rms: S,
    /// The capacitor charges through the resistance of the precharge.
    pub precharges: bool,
    /// The chopper is on.
    pub chops: bool,
    /// Energies since the start.
    pub energy: LinkEnergy,
}

impl<S: Scalar> LinkOutputs<S> {
    /// Outputs without a link.
    pub fn none() -> Self {
        let none = S::from(0.0);
        let energy = LinkEnergy::default();
        Self { u: none, i_source: none, p_chopper: none, i_rms: none, precharges: false, chops: false, energy }
    }
}

impl LinkOutputs<Dual> {
    /// The change of the outputs; energies and switching states do not change.
    pub fn change(&self) -> LinkOutputs {
        let &Self { u, i_source, p_chopper, i_rms, .. } = self;
        let [u, i_source, p_chopper, i_rms] = [u, i_source, p_chopper, i_rms].map(|x| x.change);
        LinkOutputs { u, i_source, p_chopper, i_rms, ..LinkOutputs::none() }
    }
}

type O = Row<LinkOutputs>;

/// The link's outputs.
pub const LINK_OUTPUTS: &Table<LinkOutputs> = table![
            O::output("u_cap", &VOLT, "Voltage of the DC-link capacitor, which is a state; 0 without dc_link.use", |o| {
                &mut o.u
            })
            .nominal(100.0),
            O::output(
                "i_source",
                &AMPERE,
                "Current from the source of the DC link, mean over the last communication step (Model Exchange: at the instant); \
                 without dc_link.use as i_dc",
                |o| &mut o.i_source,
            )
            .mean(),
            O::output(
                "p_chopper",
                &WATT,
                "Power of the brake chopper, mean over the last communication step (Model Exchange: at the instant)",
                |o| &mut o.p_chopper,
            )
            .mean(),
            O::output(
                "i_cap_rms",
                &AMPERE,
                "Ripple current of the DC-link capacitor (rms), from currents and modulation at the instant; 0 without dc_link.use",
                |o| &mut o.i_rms,
            ),
            O::output(
                "energy_source",
                &JOULE,
                "Energy from the source of the DC link since the start; 0 without dc_link.use; in Model Exchange as energy_in",
                |o| &mut o.energy.source,
            ),
            O::output(
                "energy_resistor",
                &JOULE,
                "Energy lost in R_source and R_precharge since the start; in Model Exchange as energy_in",
                |o| &mut o.energy.resistor,
            ),
            O::output(
                "energy_chopper",
                &JOULE,
                "Energy lost in the brake chopper since the start; in Model Exchange as energy_in",
                |o| &mut o.energy.chopper,
            ),
            O::boolean_output("precharging", "The capacitor charges through R_precharge; the controller rests", |o| {
                &mut o.precharges
            }),
            O::boolean_output("chopper_on", "The brake chopper conducts", |o| &mut o.chops),
        ];
