//! An importer in Model Exchange with a given call order: the method of Dormand and Prince, roots by bisection.

use super::case::Case;
use super::instance::{Instance, Loaded};
use super::order::{Completes, Order, STRICT, Starts};
use fmu_import::raw::{Interface, Simple, Vector, take_events};
use model_description::{BaseType, Causality, FmiVersion, ModelDescription, Variability};

/// Result of a run: the case's outputs at its points, one row each, and the warnings.
pub struct Run {
    pub rows: Vec<Vec<f64>>,
    pub warnings: Vec<String>,
}

/// Relative tolerance of a step; the absolute one is this times the nominal value of each state.
const TOLERANCE: f64 = 1e-9;

struct Importer<'a> {
    it: Instance<'a>,
    case: &'a Case,
    order: Order,
    /// Decides on habits one by one, in a random order.
    draw: &'a mut dyn FnMut() -> bool,
    reals: Vec<u32>,
    booleans: Vec<u32>,
    outputs: Vec<u32>,
    others: Vec<(BaseType, Vec<u32>)>,
    recorded: Vec<(BaseType, u32)>,
    nominal: Vec<f64>,
    indicators: usize,
    continuous: bool,
    /// Time of the initialization, at which FMI 3.0 has no SetTime yet.
    initial: bool,
    next: Option<f64>,
    /// Time of the last event. Inputs jump only in events: the step before a jump ends with the value before it, or the plant
    /// would count that step's energy along a straight line to the new value.
    since: f64,
}

/// Runs the case in this order; `draw` decides for every forbidden call whether it is made; a constant `true` makes all of them.
pub fn run(fmu: &Loaded, case: &Case, order: Order, draw: &mut dyn FnMut() -> bool) -> Run {
    take_events();
    let it = Instance::new(fmu, Interface::ModelExchange);
    let d = &fmu.description;
    let find =
        |name: &str| d.variables.iter().find(|v| v.name == name).unwrap_or_else(|| panic!("no {name}")).value_reference;
    let of = |causality, base| -> Vec<u32> {
        let fits = |v: &&model_description::ModelVariable| {
            v.causality == causality && v.base == base && v.dimensions.is_empty()
        };
        d.variables.iter().filter(fits).map(|v| v.value_reference).collect()
    };
    let names =
        |base: BaseType| case.inputs.iter().filter(move |i| i.boolean == (base == BaseType::Boolean)).map(|i| i.name);
    let (nx, nz) = sizes(d);
    let mut importer = Importer {
        reals: names(BaseType::Float64).map(find).collect(),
        booleans: names(BaseType::Boolean).map(find).collect(),
        outputs: of(Causality::Output, BaseType::Float64),
        others: [BaseType::Int32, BaseType::Boolean].map(|base| (base, of(Causality::Output, base))).into(),
        recorded: recorded(d, case),
        nominal: vec![1.0; nx],
        indicators: nz,
        continuous: false,
        initial: true,
        next: None,
        since: 0.0,
        it,
        case,
        order,
        draw,
    };
    let rows = importer.simulate();
    importer.it.simple(Simple::Terminate);
    drop(importer);
    let warnings = take_events().into_iter().filter(|e| e.status == 1).filter_map(|e| e.text).collect();
    Run { rows, warnings }
}

fn recorded(d: &ModelDescription, case: &Case) -> Vec<(BaseType, u32)> {
    let found =
        |name: &&str| d.variables.iter().find(|v| v.name == *name).map(|v| (v.base, v.value_reference)).unwrap();
    case.outputs.iter().map(found).collect()
}

/// Numbers of states and of event indicators.
fn sizes(d: &ModelDescription) -> (usize, usize) {
    let states = d.variables.iter().filter(|v| v.derivative.is_some()).count();
    (states, d.number_of_event_indicators.map_or(d.event_indicators.len(), |n| n as usize))
}

impl Importer<'_> {
    /// Whether a habit of this order applies now.
    fn does(&mut self, habit: bool) -> bool {
        habit && (self.draw)()
    }

    fn simulate(&mut self) -> Vec<Vec<f64>> {
        let (raw, it) = (&self.it.fmu.raw, self.it.it);
        let stop = self.case.stop();
        self.it.ok("the experiment", raw.experiment(it, None, 0.0, Some(stop)));
        if self.it.version() == FmiVersion::V2 {
            self.it.simple(Simple::EnterInitializationMode);
        }
        if self.order.starts == Starts::Before {
            self.it.set_starts();
        }
        self.set_inputs(0.0, true);
        self.it.simple(Simple::ExitInitializationMode);
        if self.order.starts == Starts::After && (self.draw)() {
            self.it.set_starts();
        }
        let mut x = vec![0.0; self.nominal.len()];
        if !x.is_empty() {
            self.it.vector(Vector::GetContinuousStates, &mut x);
            let mut nominal = std::mem::take(&mut self.nominal);
            self.it.vector(Vector::GetNominalsOfContinuousStates, &mut nominal);
            self.nominal = nominal;
        }
        if self.order.settles {
            self.update(&mut x, 0.0);
        } else {
            // The first event is a root just after the start; the FMU is in Event Mode until then.
            self.initial = false;
            for t in [0.0, 1e-6, 5e-7, 2e-9] {
                self.evaluate(t, &x);
            }
            self.event(1e-10, &mut x);
        }
        self.initial = false;
        let mut rows = Vec::new();
        let (mut t, mut h, mut k) = (if self.order.settles { 0.0 } else { 1e-10 }, 1e-6, 1);
        let jumps = self.case.jumps();
        while k <= self.case.points {
            let grid = self.case.point(k);
            let jump = jumps.iter().copied().find(|jump| *jump > t);
            let mut limit = jump.map_or(grid, |jump| jump.min(grid));
            if self.order.late == 0.0 {
                limit = self.next.map_or(limit, |next| next.min(limit));
            }
            let (end, hit) = if t + 1.01 * h >= limit { (limit, true) } else { (t + h, false) };
            let Some((x1, grow)) = self.step(t, &x, end) else {
                h = (end - t) * 0.3;
                if self.order.returns {
                    self.evaluate(t, &x);
                }
                continue;
            };
            let event = self.locate(t, &x, end, &x1);
            let (reached, found) = event.map_or((end, false), |at| (at, true));
            if found {
                let (at, _) = self.step(t, &x, reached).unwrap_or((x1, 1.0));
                x = at;
            } else {
                x = x1;
            }
            if !hit || grow < 1.0 {
                h = (end - t) * grow;
            }
            t = reached;
            self.place(t, &x);
            if self.order.completes != Completes::Never && self.continuous {
                self.complete();
            }
            let due = self.order.late == 0.0 && self.next.is_some_and(|next| t >= next);
            if found || due || jump.is_some_and(|jump| t >= jump) {
                self.event(t, &mut x);
                h = h.min(1e-5);
            } else if t >= grid {
                self.place(t, &x);
                rows.push(self.it.numbers(&self.recorded));
                k += 1;
            }
        }
        rows
    }

    /// Inputs at a time: all, or those that a solver sets.
    fn set_inputs(&mut self, t: f64, discrete: bool) {
        let (mut references, mut values) = (Vec::new(), Vec::new());
        let reals = self.case.inputs.iter().filter(|i| !i.boolean).zip(&self.reals);
        for (input, reference) in reals.filter(|(input, _)| discrete || !input.discrete) {
            references.push(*reference);
            values.push(input.at(if input.linear { t } else { self.since }).to_bits());
        }
        if !references.is_empty() {
            self.it.set(BaseType::Float64, &references, &values);
        }
        if discrete && !self.booleans.is_empty() {
            let values: Vec<u64> =
                self.case.inputs.iter().filter(|i| i.boolean).map(|i| u64::from(i.at(self.since) != 0.0)).collect();
            self.it.set(BaseType::Boolean, &self.booleans, &values);
        }
    }

    /// Time, inputs and states of a point.
    fn place(&mut self, t: f64, x: &[f64]) {
        if self.continuous || !self.initial {
            self.it.ok("SetTime", self.it.fmu.raw.set_time(self.it.it, t));
        }
        let discrete = !self.continuous && self.order.discrete_inputs;
        self.set_inputs(t, discrete);
        if !x.is_empty() && (self.continuous || self.does(self.order.states_in_event)) {
            self.it.vector(Vector::SetContinuousStates, &mut x.to_vec());
        }
    }

    fn complete(&self) {
        let (status, flags) = self.it.fmu.raw.completed_integrator_step(self.it.it, true, false).expect("the function");
        self.it.ok("CompletedIntegratorStep", Some(status));
        assert_eq!(flags, [0, 0]);
    }

    /// Derivatives and indicators at a point.
    fn evaluate(&mut self, t: f64, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut found = (vec![0.0; x.len()], vec![0.0; self.indicators]);
        for _ in 0..self.order.repeats {
            self.place(t, x);
            if !x.is_empty() && (self.continuous || self.order.derivatives_in_event) {
                let v2 = self.it.version() == FmiVersion::V2;
                let name = if v2 { Vector::GetDerivatives } else { Vector::GetContinuousStateDerivatives };
                self.it.vector(name, &mut found.0);
            }
            if self.indicators > 0 {
                self.it.vector(Vector::GetEventIndicators, &mut found.1);
            }
            if self.order.repeats > 1 {
                self.it.reals(&self.outputs);
                for (base, references) in self.others.iter().filter(|(_, references)| !references.is_empty()) {
                    self.it.get(*base, references);
                }
            }
            if self.continuous && self.does(self.order.completes == Completes::Evaluations) {
                self.complete();
            }
        }
        found
    }

    /// A step of the method of Dormand and Prince, and how much longer the next may be; `None`: rejected.
    fn step(&mut self, t: f64, x: &[f64], end: f64) -> Option<(Vec<f64>, f64)> {
        const C: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
        const A: [&[f64]; 7] = [
            &[],
            &[0.2],
            &[3.0 / 40.0, 9.0 / 40.0],
            &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
            &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
            &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
            &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
        ];
        const E: [f64; 7] =
            [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339_200.0, 22.0 / 525.0, -1.0 / 40.0];
        if x.is_empty() {
            self.evaluate(end, x);
            return Some((Vec::new(), 5.0));
        }
        let h = end - t;
        let mut k: Vec<Vec<f64>> = Vec::new();
        let mut y = x.to_vec();
        for (c, a) in C.iter().zip(A) {
            for (i, y) in y.iter_mut().enumerate() {
                *y = x[i] + h * a.iter().zip(&k).map(|(a, k)| a * k[i]).sum::<f64>();
            }
            let at = if *c < 1.0 { t + c * h } else { end };
            k.push(self.evaluate(at, &y).0);
        }
        let scaled = |i: usize| {
            let error: f64 = h * E.iter().zip(&k).map(|(e, k)| e * k[i]).sum::<f64>();
            error / (TOLERANCE * x[i].abs().max(y[i].abs()).max(self.nominal[i]))
        };
        let error = (0..x.len()).map(scaled).fold(0.0, |a: f64, b| a.max(b.abs()));
        let factor = (0.9 * error.powf(-0.2)).clamp(0.2, 5.0);
        if error <= 1.0 || h < 1e-11 { Some((y, factor)) } else { None }
    }

    /// The first instant, if any, after which an indicator has changed sign or a time event has passed.
    fn locate(&mut self, t: f64, x: &[f64], end: f64, x1: &[f64]) -> Option<f64> {
        let late = self.order.late;
        let next = self.next.filter(|next| late > 0.0 && *next > t);
        if next.is_none_or(|next| next >= end) && self.indicators == 0 {
            return None;
        }
        let (d0, z0) = self.evaluate(t, x);
        let (d1, z1) = self.evaluate(end, x1);
        let passed = |at: f64, z: &[f64]| {
            next.is_some_and(|next| next < at) || z0.iter().zip(z).any(|(a, b)| (*a > 0.0) != (*b > 0.0))
        };
        if !passed(end, &z1) {
            return None;
        }
        let (mut low, mut high, width) = (t, end, late.max(1e-10));
        while high - low > width {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            let (h, s) = (end - t, (middle - t) / (end - t));
            let (s2, s3) = (s * s, s * s * s);
            let between = |i: usize| {
                (2.0 * s3 - 3.0 * s2 + 1.0) * x[i]
                    + (s3 - 2.0 * s2 + s) * h * d0[i]
                    + (3.0 * s2 - 2.0 * s3) * x1[i]
                    + (s3 - s2) * h * d1[i]
            };
            let x: Vec<f64> = (0..x.len()).map(between).collect();
            let (_, z) = self.evaluate(middle, &x);
            if passed(middle, &z) { high = middle } else { low = middle }
        }
        Some(high)
    }

    fn event(&mut self, t: f64, x: &mut [f64]) {
        self.place(t, x);
        self.it.simple(Simple::EnterEventMode);
        self.continuous = false;
        self.update(x, t);
    }

    /// From Event Mode to Continuous-Time Mode.
    fn update(&mut self, x: &mut [f64], t: f64) {
        self.since = t;
        self.set_inputs(t, true);
        if !x.is_empty() && self.does(self.order.states_in_event) {
            self.it.vector(Vector::SetContinuousStates, x);
        }
        loop {
            let (status, update) = self.it.fmu.raw.update_discrete_states(self.it.it, false).expect("the function");
            self.it.ok("the update of discrete states", Some(status));
            assert_eq!(update.terminate, 0);
            let known = self.order.blind || update.next_event_time_defined == 1;
            self.next = known.then_some(update.next_event_time).filter(|next| *next > t);
            if update.again == 0 || !self.order.iterates {
                break;
            }
        }
        if !x.is_empty() {
            self.it.vector(Vector::GetContinuousStates, x);
        }
        self.it.simple(Simple::EnterContinuousTimeMode);
        self.continuous = true;
    }
}

/// A run in the order of the standards.
pub fn strict(fmu: &Loaded, case: &Case) -> Run {
    run(fmu, case, STRICT, &mut || true)
}

/// Co-Simulation with the calls of Simulink and Modelica-FMI: parameters before the initialization, inputs held over a step,
/// outputs after it.
pub fn stepped(fmu: &Loaded, case: &Case, (delayed, starts): (bool, bool)) -> Run {
    take_events();
    let it = Instance::new(fmu, Interface::CoSimulation);
    let d = &fmu.description;
    let find =
        |name: &str| d.variables.iter().find(|v| v.name == name).unwrap_or_else(|| panic!("no {name}")).value_reference;
    let v2 = it.version() == FmiVersion::V2;
    if starts {
        it.set_starts();
    }
    it.ok("the experiment", fmu.raw.experiment(it.it, None, 0.0, Some(case.stop() + 1.0)));
    if v2 {
        it.simple(Simple::EnterInitializationMode);
    }
    it.simple(Simple::ExitInitializationMode);
    if starts {
        // Set again with the inputs at the first step, as in gemseo-fmu.
        it.set_starts();
    }
    let recorded = recorded(d, case);
    let mut rows = Vec::new();
    for k in 1..=case.points {
        let t = case.point(k - 1);
        let at = if delayed { case.point((k - 1).saturating_sub(1)) } else { t };
        for input in case.inputs {
            let base = if input.boolean { BaseType::Boolean } else { BaseType::Float64 };
            let x = input.at(at);
            it.set(base, &[find(input.name)], &[if input.boolean { u64::from(x != 0.0) } else { x.to_bits() }]);
        }
        let (status, _) = fmu.raw.do_step(it.it, t, case.apart, true, [true; 4]).expect("the function");
        it.ok("DoStep", Some(status));
        rows.push(it.numbers(&recorded));
    }
    drop(it);
    let warnings = take_events().into_iter().filter(|e| e.status == 1).filter_map(|e| e.text).collect();
    Run { rows, warnings }
}

/// Whether a parameter of a type that FMI 2.0 passes as an Integer is tunable: importers that pass enumerations unconverted
/// fail there.
pub fn tunable_enumerations(d: &ModelDescription) -> Vec<&str> {
    let fits = |v: &&model_description::ModelVariable| {
        v.causality == Causality::Parameter && v.variability == Variability::Tunable && v.base == BaseType::Enumeration
    };
    d.variables.iter().filter(fits).map(|v| v.name.as_str()).collect()
}
