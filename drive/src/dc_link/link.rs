//! The link over time: in Co-Simulation the solution of its circuit between two events, in Model Exchange its equation.

use super::circuit::{Circuit, LinkEnergy, Piece};
use super::outputs::LinkOutputs;
use super::parameters::{Chopper, DcLink, DcSource, LinkParameters};
use super::source::Flow;
use fmu_core::{Account, Elapsed, Kept, Scalar};
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

/// The link between two events: conductances in S, and a constant current of the source in A.
#[derive(Clone, Copy, Debug)]
struct Conductances {
    source: f64,
    fixed: f64,
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

    /// Charged to `u` (V), at the end of a precharge.
    pub fn charge(&mut self, u: f64) {
        (self.u, self.precharges, self.point.u) = (u, false, u);
    }

    /// Begins anew where it is, on a source of `u_dc` (V): the counters are 0.
    #[must_use]
    pub fn begun(self, u_dc: f64) -> Self {
        let point = Counted { u: self.u, source: u_dc, ..Counted::default() };
        Self { u: self.u, precharges: self.precharges, chops: self.chops, point, ..Self::default() }
    }

    /// Resistance (Ohm) between the source and the capacitor.
    fn resistance(&self, par: &LinkParameters) -> f64 {
        let DcLink { R_source, R_precharge, .. } = par.dc_link;
        if self.precharges { R_source + R_precharge } else { R_source }
    }

    /// How the source of the voltage `U` (V) supplies a capacitor of `u` (V).
    fn flow(&self, par: &LinkParameters, u: f64, U: f64) -> Flow {
        par.dc_link.flow(self.resistance(par), u, U)
    }

    fn conductances(&self, par: &LinkParameters, u: f64, U: f64) -> Conductances {
        let (source, fixed) = match self.flow(par, u, U) {
            Flow::Free => (1.0 / self.resistance(par), 0.0),
            Flow::Blocked => (0.0, 0.0),
            Flow::Maximum => (0.0, par.dc_link.i_max),
            Flow::Minimum => (0.0, par.dc_link.i_min),
        };
        Conductances { source, fixed, chopper: if self.chops { 1.0 / par.chopper.R } else { 0.0 } }
    }

    /// The circuit at the voltage `u` (V), on a source of `U` (V).
    fn circuit(&self, par: &LinkParameters, u: f64, U: f64) -> Circuit {
        let Conductances { source, fixed, chopper } = self.conductances(par, u, U);
        Circuit { C: par.dc_link.C, source, fixed, chopper, U }
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
    /// voltage constant for any capacitor, unless it has limits.
    #[inline(never)]
    pub fn longest(&self, par: &LinkParameters, h: f64, T_s: f64, i_dc: f64) -> f64 {
        let mut circuit = self.circuit(par, self.u, 0.0);
        if par.dc_link.source != DcSource::Ideal {
            circuit.source = 0.0;
        }
        let parts = (circuit.change(h, i_dc) / (LARGEST_CHANGE * self.u)).ceil();
        // Without a voltage, the minimum; NaN is one part.
        (h / parts.max(1.0)).max(T_s / MAX_PARTS).min(h)
    }

    /// Advances by `h` (s) from the time `t` (s) on a source of the amplitude `u_dc` (V), while the inverter draws `energy` (J).
    pub fn advance(&mut self, par: &LinkParameters, u_dc: f64, (t, h): (f64, f64), energy: f64) {
        let n = par.dc_link.parts(h);
        let (h, energy) = (h / n, energy / n);
        let mut k = 0.0;
        while k < n {
            self.pass(par, u_dc * par.dc_link.wave(t + (k + 0.5) * h), h, energy);
            k += 1.0;
        }
    }

    /// Advances by `h` (s) on a source of the constant voltage `U` (V).
    fn pass(&mut self, par: &LinkParameters, U: f64, h: f64, energy: f64) {
        let power = (energy + std::mem::take(&mut self.owed)) / h;
        let mut left = h;
        for _ in 0..MAX_SWITCHINGS {
            self.event(par);
            let (circuit, flow) = (self.circuit(par, self.u, U), self.flow(par, self.u, U));
            let over = |t: f64| circuit.over(self.u, t, power * t);
            let ends = |u: f64| self.switches(par, u) || self.flow(par, u, U) != flow;
            let piece = over(left);
            if !ends(piece.u) {
                return self.take(&piece);
            }
            let (mut before, mut after) = (0.0, left);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (before + after);
                *(if ends(over(middle).u) { &mut after } else { &mut before }) = middle;
            }
            let piece = over(after);
            self.take(&piece);
            left -= after;
            if left <= 0.0 {
                return;
            }
        }
        let piece = self.circuit(par, self.u, U).over(self.u, left, power * left);
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
            // Without an event in between, the source supplies the middle as it supplies the whole interval.
            let circuit = self.circuit(par, 0.5 * (u + self.u), 0.5 * (source + U));
            let LinkEnergy { resistor, chopper, .. } = circuit.over(u, h, taken - before).energy;
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
        let Conductances { source, fixed, chopper } = self.conductances(par, u.value(), U.value());
        let slope = ((U - u) * source + fixed.into() - u * chopper - i_dc) * (1.0 / par.dc_link.C);
        if u.value() <= 0.0 && slope.value() < 0.0 { 0.0.into() } else { slope }
    }

    /// Model Exchange: the outputs at an instant with the voltage `u` (V), on a source of `U` (V).
    pub fn shown<S: Scalar>(&self, par: &LinkParameters, u: S, U: S) -> LinkOutputs<S> {
        let Conductances { source, fixed, chopper } = self.conductances(par, u.value(), U.value());
        LinkOutputs { i_source: (U - u) * source + fixed.into(), p_chopper: u * u * chopper, ..self.outputs(u) }
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

    /// The indicator of the limits of the source of `U` (V), whose amplitude is `u_dc` (V).
    pub fn source_indicator(&self, par: &LinkParameters, U: f64, u_dc: f64) -> f64 {
        let DcLink { source, i_max, i_min, .. } = par.dc_link;
        let z = match source {
            DcSource::Ideal => 1.0,
            DcSource::Battery => {
                let (i, span) = ((U - self.u) / self.resistance(par), i_max - i_min);
                (i_max - i) * (i - i_min) / (span * span)
            }
            DcSource::RectifierSingle | DcSource::RectifierThree => (self.u - U) / u_dc.max(1.0),
        };
        if z == 0.0 { SHIFT } else { z }
    }
}
