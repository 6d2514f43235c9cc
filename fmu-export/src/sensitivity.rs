//! Derivatives of a model's equations: directional and adjoint derivatives, derivatives of outputs with respect to time, and
//! steps with inputs that change at a given rate.
//!
//! A model with a [tangent](fmu_core::Differentiable) gives exact values. For other models, and in Initialization Mode, a
//! central difference of fourth order along the whole direction is taken on a copy,
//!
//! ```text
//! f' = (2/3 (f(+eps) - f(-eps)) - 1/12 (f(+2 eps) - f(-2 eps))) / eps
//! ```
//!
//! with eps = cbrt(2^-52) of a nominal size: its error of rounding is about 1e-10 of a value of nominal size, and a curve that
//! bends within a thousandth of the nominal size, such as friction near standstill, keeps an error of this order.
//! FMI 2.0.5, 2.1.9; FMI 3.0.2, 2.2.12.

use crate::access::index;
use crate::instance::{Instance, Refusal};
use crate::lifecycle::{Standard, State};
use crate::message;
use crate::snapshot::{Snapshot, ramps};
use fmu_core::{Block, Causality, Constant, Elapsed, Exported, Fault, Kind, Meta, Model, Slot, Step, Variability};

/// Number of parts of a step with changing inputs: each uses the inputs at its middle.
const PARTS: u32 = 32;

/// Memory for the derivatives.
pub struct Scratch<M: Model> {
    /// A copy of the model, or the direction.
    block: Block<M>,
    /// The derivatives there, or along the direction.
    dx: Vec<f64>,
    /// The direction: the change of the states, and of inputs and parameters by reference.
    rates: Vec<f64>,
    others: Vec<(u32, f64)>,
    /// A column of the adjoint derivative.
    column: Vec<f64>,
    /// The elements of unknowns and knowns.
    sides: [Vec<u32>; 2],
}

impl<E: Exported> Instance<E> {
    /// Directional derivative: the change of `unknowns` per unit of a change of `knowns` by `seed`.
    ///
    /// # Errors
    /// A variable that is not a known or unknown in this state, a duplicate variable, a seed of the wrong length (Error);
    /// derivatives that do not exist here (Discard). Nothing changes.
    pub fn directional(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        out: &mut [f64],
    ) -> Result<(), Refusal> {
        supported::<E>(match self.standard {
            Standard::Fmi2 => "providesDirectionalDerivative = false",
            Standard::Fmi3 => "providesDirectionalDerivatives = false",
        })?;
        self.with_elements(unknowns, knowns, |instance, unknowns, knowns| {
            instance.check_sides(unknowns, knowns)?;
            check_sizes(seed, knowns.len(), (out.len(), unknowns.len()))?;
            instance.column(unknowns, knowns, seed, out)
        })
    }

    /// Adjoint derivative: for each of `knowns`, the change of the sum of `unknowns` weighted with `seed`.
    ///
    /// # Errors
    /// As [`directional`](Self::directional).
    pub fn adjoint(&mut self, unknowns: &[u32], knowns: &[u32], seed: &[f64], out: &mut [f64]) -> Result<(), Refusal> {
        supported::<E>("providesAdjointDerivatives = false")?;
        self.with_elements(unknowns, knowns, |instance, unknowns, knowns| {
            instance.check_sides(unknowns, knowns)?;
            check_sizes(seed, unknowns.len(), (out.len(), knowns.len()))?;
            let mut column = zeros(&mut instance.scratch().1.column, unknowns.len());
            for (known, out) in knowns.iter().zip(out) {
                instance.column(unknowns, std::slice::from_ref(known), &[1.0], &mut column)?;
                *out = column.iter().zip(seed).map(|(x, w)| x * w).sum();
            }
            instance.scratch().1.column = column;
            Ok(())
        })
    }

    /// First derivatives of continuous outputs with respect to time, with constant inputs.
    ///
    /// # Errors
    /// A variable other than a continuous output, or an order other than 1 (Error); derivatives that do not exist (Discard).
    pub fn output_derivatives(&mut self, unknowns: &[u32], orders: &[i32], out: &mut [f64]) -> Result<(), Refusal> {
        supported::<E>("maxOutputDerivativeOrder = 0")?;
        if let Some(order) = orders.iter().find(|&&order| order != 1) {
            return Err(Fault::value("order", order, "1: maxOutputDerivativeOrder = 1").into());
        }
        self.with_elements(unknowns, &[], |instance, unknowns, _| instance.rates(unknowns, out))
    }

    /// The derivatives of continuous outputs.
    fn rates(&mut self, unknowns: &[u32], out: &mut [f64]) -> Result<(), Refusal> {
        check_sizes(&[], 0, (out.len(), unknowns.len()))?;
        for &unknown in unknowns {
            if !self.is_output(unknown, false) {
                return Err(Self::no_side(unknown, "a continuous output").into());
            }
        }
        let mut rates = zeros(&mut self.scratch().1.rates, E::CAN.scalars());
        let now = self.state_count();
        let found = self.derivatives(&mut rates[..now]);
        E::CAN.spread(&mut self.current.block.model, &mut rates);
        let done = found.and_then(|()| self.along(unknowns, &[], &rates, 1.0, out));
        self.scratch().1.rates = rates;
        done?;
        self.add_integrands(unknowns, out);
        Ok(())
    }

    /// Adds the rates of outputs that grow with time.
    fn add_integrands(&mut self, unknowns: &[u32], out: &mut [f64]) {
        let Some(continuous) = &E::CAN.continuous else { return };
        let (current, scratch) = self.scratch();
        for sign in [-1.0, 1.0] {
            scratch.block.out = <E::Model as Model>::Outputs::default();
            if sign > 0.0 {
                (continuous.integrands)(&current.block.model, current.elapsed, &mut scratch.block.out);
            }
            for (&unknown, out) in unknowns.iter().zip(out.iter_mut()) {
                // New outputs lack the elements of arrays with structural sizes.
                if let Some((_, Slot::Real(x))) = E::Model::TABLE.entry(&mut scratch.block, index::<E>(unknown)) {
                    *out += sign * *x;
                }
            }
        }
    }

    /// Sets first derivatives of continuous inputs; they apply to the next step (FMI 2.0.5, 4.2.1).
    ///
    /// # Errors
    /// A variable other than a continuous real input, an order other than 1, a value that is not finite: nothing changes.
    pub fn input_derivatives(&mut self, knowns: &[u32], orders: &[i32], values: &[f64]) -> Result<(), Fault> {
        supported::<E>("canInterpolateInputs = false")?;
        for ((&known, order), value) in knowns.iter().zip(orders).zip(values) {
            if !self.is_continuous_input(known) {
                return Err(Self::no_side(known, "a continuous real input"));
            }
            if *order != 1 {
                return Err(Fault::value("order", order, "1"));
            }
            if !value.is_finite() {
                let name = format!("the derivative of {}", message::name::<E::Model>(index::<E>(known)));
                return Err(Fault::value(&name, value, "a finite number"));
            }
        }
        for (&known, &value) in knowns.iter().zip(values) {
            let row = u32::try_from(index::<E>(known)).unwrap_or(u32::MAX);
            self.current.slopes.retain(|(other, _)| *other != row);
            self.current.slopes.push((row, value));
        }
        Ok(())
    }

    /// One step of `h` (s) with inputs that change at the rates that were set. Afterwards the inputs have the values set by the
    /// importer.
    pub(crate) fn step_on_slopes(&mut self, h: f64) -> Result<(), Fault> {
        let table = E::Model::TABLE;
        let is_mean = |&index: &usize| table.locate(index).is_some_and(|(_, meta, _)| meta.mean);
        let mut means: Vec<(usize, f64)> = table.indices().filter(is_mean).map(|index| (index, 0.0)).collect();
        let current = &mut self.current;
        let slopes = std::mem::take(&mut current.slopes);
        let Some(saving) = &E::CAN.saved else { return Ok(()) };
        let mut block = saving.block(&current.block);
        let (mut now, part, mut done) = (current.elapsed, h / f64::from(PARTS), Ok(()));
        for k in 0..PARTS {
            let middle = part * (f64::from(k) + 0.5);
            for &(row, slope) in &slopes {
                let held = real(&mut current.block, row as usize);
                let changed = held + slope * middle;
                match table.entry(&mut block, row as usize) {
                    Some((meta, Slot::Real(x))) if meta.range.contains(changed) => *x = changed,
                    _ => {
                        let what = format!("{} + {slope} t", message::name::<E::Model>(row as usize));
                        return Err(Fault::value(&what, changed, "inside the range of the input"));
                    }
                }
            }
            done = block.step(&Step { start: now, h: part });
            match &done {
                Err(fault) if fault.ends().is_some() => break,
                Err(_) => return done,
                Ok(()) => {}
            }
            for (index, mean) in &mut means {
                *mean += real(&mut block, *index) / f64::from(PARTS);
            }
            now = now.plus(part);
        }
        for &(row, _) in &slopes {
            let held = real(&mut current.block, row as usize);
            put(&mut block, row as usize, held);
        }
        block.model.output(current.elapsed.plus(h), &mut block.out);
        for (index, mean) in means {
            put(&mut block, index, mean);
        }
        current.block = block;
        done
    }

    /// Expands references of arrays in FMI 3.0 to references of all elements.
    fn with_elements(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        work: impl FnOnce(&mut Self, &[u32], &[u32]) -> Result<(), Refusal>,
    ) -> Result<(), Refusal> {
        if !self.arrays {
            return work(self, unknowns, knowns);
        }
        let mut sides = std::mem::take(&mut self.scratch().1.sides);
        let done = self.each(unknowns, &mut sides[0]).and_then(|()| self.each(knowns, &mut sides[1]));
        let done = done.map_err(Refusal::from).and_then(|()| work(self, &sides[0], &sides[1]));
        self.scratch().1.sides = sides;
        done
    }

    fn each(&mut self, references: &[u32], all: &mut Vec<u32>) -> Result<(), Fault> {
        all.clear();
        for &reference in references {
            let elements = self.elements(reference)?;
            all.extend((0..).zip(0..elements).map(|(i, _)| reference.wrapping_add(i)));
        }
        Ok(())
    }

    /// The instance's values and the memory for derivatives.
    fn scratch(&mut self) -> (&mut Snapshot<E::Model>, &mut Scratch<E::Model>) {
        let Self { current, scratch, .. } = self;
        let new = || Scratch {
            block: E::CAN.saved.as_ref().map_or_else(Block::default, |saving| saving.block(&current.block)),
            dx: vec![0.0; E::CAN.scalars()],
            rates: Vec::new(),
            others: Vec::new(),
            column: Vec::new(),
            sides: [Vec::new(), Vec::new()],
        };
        let scratch = scratch.get_or_insert_with(|| Box::new(new()));
        (current, scratch)
    }

    /// Divides the knowns into states and others, and computes the derivative.
    fn column(&mut self, unknowns: &[u32], knowns: &[u32], seed: &[f64], out: &mut [f64]) -> Result<(), Refusal> {
        let (_, scratch) = self.scratch();
        let mut rates = zeros(&mut scratch.rates, E::CAN.scalars());
        let mut others = std::mem::take(&mut scratch.others);
        others.clear();
        for (&known, &seed) in knowns.iter().zip(seed) {
            match self.states.iter().position(|&row| row == index::<E>(known)) {
                Some(i) => rates[i] = seed,
                None => others.push((known, seed)),
            }
        }
        let done = self.along(unknowns, &others, &rates, 0.0, out);
        let (_, scratch) = self.scratch();
        (scratch.rates, scratch.others) = (rates, others);
        done
    }

    /// The change of `unknowns` along a direction: the states by `rates`, the inputs and parameters `others`, and time.
    fn along(
        &mut self,
        unknowns: &[u32],
        others: &[(u32, f64)],
        rates: &[f64],
        time: f64,
        out: &mut [f64],
    ) -> Result<(), Refusal> {
        out.fill(0.0);
        let initial = self.current.life.state() == State::Initialization;
        self.refresh();
        let exact = others.iter().all(|&(known, _)| self.is_continuous_input(known))
            && unknowns.iter().all(|&unknown| Self::is_derivative(unknown) || self.is_output(unknown, false));
        let Some(tangent) = E::CAN.tangent.filter(|_| exact && !initial) else {
            return self.difference(unknowns, others, rates, time, out);
        };
        if time != 0.0 {
            // A tangent is along states and inputs.
            self.difference(unknowns, &[], &[], time, out)?;
        }
        let (current, scratch) = self.scratch();
        let direction = &mut scratch.block;
        clear::<E>(direction);
        for &(known, seed) in others {
            put(direction, index::<E>(known), seed);
        }
        if !rates.is_empty() {
            E::CAN.each_state(&mut direction.model, |number, x| *x = rates[number]);
        }
        let now = E::CAN.count_states(&mut direction.model);
        let (along, change) = (&direction.model, &mut direction.out);
        let dx = &mut scratch.dx;
        tangent(&current.block.model, current.elapsed, along, &mut dx[..now], change).map_err(Refusal::Discard)?;
        E::CAN.spread(&mut direction.model, dx);
        for (&unknown, out) in unknowns.iter().zip(out.iter_mut()) {
            // A computed output is discrete, so it is constant.
            if !matches!(E::Model::TABLE.entry(&mut scratch.block, index::<E>(unknown)), Some((_, Slot::Constant(_)))) {
                *out += pick::<E>(&mut scratch.block, &scratch.dx, index::<E>(unknown));
            }
        }
        Self::finite(unknowns, out)
    }

    /// Approximates the derivative by a central difference.
    fn difference(
        &mut self,
        unknowns: &[u32],
        others: &[(u32, f64)],
        rates: &[f64],
        time: f64,
        out: &mut [f64],
    ) -> Result<(), Refusal> {
        // cbrt(2^-52)
        const SHARE: f64 = 6.055_454_452_393_343e-6;
        let mut largest = 0.0_f64;
        for &(known, seed) in others {
            let block = &mut self.current.block;
            let x = real(block, index::<E>(known));
            largest = largest.max(seed.abs() / message::nominal::<E::Model>(block, index::<E>(known)).max(x.abs()));
        }
        for (number, (rate, &row)) in rates.iter().zip(&self.states).enumerate() {
            let block = &mut self.current.block;
            let Some(x) = E::CAN.scalar(&mut block.model, number).map(|x| *x) else { continue };
            largest = largest.max(rate.abs() / message::nominal::<E::Model>(block, row).max(x.abs()));
        }
        if largest == 0.0 && time == 0.0 {
            return Ok(());
        }
        let eps = if largest > 0.0 { SHARE / largest } else { SHARE };
        let initial = self.current.life.state() == State::Initialization;
        let is_parameter = |meta: &Meta| meta.causality == Causality::Parameter;
        let parameters = others.iter().any(|&(known, _)| self.meta(known).is_some_and(is_parameter));
        let (current, scratch) = self.scratch();
        for (side, weight) in [(1.0, 2.0 / 3.0), (-1.0, -2.0 / 3.0), (2.0, -1.0 / 12.0), (-2.0, 1.0 / 12.0)] {
            let block = &mut scratch.block;
            if let Some(saving) = &E::CAN.saved {
                saving.overwrite(&mut block.model, &current.block.model);
            }
            for &(known, seed) in others {
                let x = real(block, index::<E>(known)) + side * eps * seed;
                put(block, index::<E>(known), x);
            }
            if !rates.is_empty() {
                E::CAN.each_state(&mut block.model, |number, x| *x += side * eps * rates[number]);
            }
            let now = if time == 0.0 { current.elapsed } else { current.elapsed.plus(side * eps * time) };
            if initial {
                block.initialize();
            } else if parameters {
                block.model.derive();
            }
            let dx = &mut scratch.dx;
            evaluate::<E>(block, now, initial, dx).map_err(Refusal::Discard)?;
            for (&unknown, out) in unknowns.iter().zip(out.iter_mut()) {
                *out += weight * pick::<E>(block, dx, index::<E>(unknown)) / eps;
            }
        }
        Self::finite(unknowns, out)
    }

    /// Refuses derivatives that are not finite: they do not exist.
    fn finite(unknowns: &[u32], out: &[f64]) -> Result<(), Refusal> {
        let Some(i) = out.iter().position(|x| !x.is_finite()) else { return Ok(()) };
        let name = format!("the derivative of {}", Self::name_of(unknowns[i]));
        Err(Refusal::Discard(Fault::value(&name, out[i], "a finite number")))
    }

    fn is_derivative(unknown: u32) -> bool {
        index::<E>(unknown).wrapping_sub(E::Model::TABLE.len()) < E::CAN.scalars()
    }

    /// The table entry of a variable.
    fn meta(&mut self, reference: u32) -> Option<&'static Meta> {
        E::Model::TABLE.entry(&mut self.current.block, index::<E>(reference)).map(|(meta, _)| meta)
    }

    fn is_continuous_input(&mut self, known: u32) -> bool {
        self.meta(known).is_some_and(ramps)
    }

    /// A continuous real output, or in Event Mode any real output.
    fn is_output(&mut self, unknown: u32, discrete: bool) -> bool {
        self.meta(unknown).is_some_and(|meta| {
            meta.causality == Causality::Output
                && matches!(meta.kind, Kind::Real(_))
                && match meta.variability {
                    Variability::Continuous => true,
                    Variability::Constant => false,
                    _ => discrete || E::Model::CONTINUOUS,
                }
        })
    }

    /// Checks that knowns and unknowns are allowed in this state, each once.
    fn check_sides(&mut self, unknowns: &[u32], knowns: &[u32]) -> Result<(), Fault> {
        let state = self.current.life.state();
        let initial = state == State::Initialization;
        for (i, &unknown) in unknowns.iter().enumerate() {
            let calculated = self.meta(unknown).is_some_and(|meta| {
                meta.causality == Causality::CalculatedParameter && matches!(meta.kind, Kind::Real(_))
            });
            let of_start = initial && (calculated || self.states.contains(&index::<E>(unknown)));
            let set = initial && self.meta(unknown).is_some_and(|meta| meta.exact);
            let output = self.is_output(unknown, state == State::Event || initial);
            if set || !(Self::is_derivative(unknown) || of_start || output) {
                return Err(Self::no_side(unknown, "an unknown of derivatives in this state"));
            }
            if unknowns[..i].contains(&unknown) {
                return Err(Self::no_side(unknown, "named once among the unknowns"));
            }
        }
        for (i, &known) in knowns.iter().enumerate() {
            let state_row = self.states.contains(&index::<E>(known)) && !initial;
            let parameters = self.standard == Standard::Fmi3;
            let input = self.meta(known).is_some_and(|meta| {
                let fits = match meta.causality {
                    Causality::Input => meta.variability == Variability::Continuous || state == State::Event || initial,
                    Causality::Parameter => initial || (parameters && meta.variability == Variability::Tunable),
                    _ => initial && meta.exact,
                };
                fits && matches!(meta.kind, Kind::Real(_))
            });
            if !(state_row || input) {
                return Err(Self::no_side(known, "a known of derivatives in this state"));
            }
            if knowns[..i].contains(&known) {
                return Err(Self::no_side(known, "named once among the knowns"));
            }
        }
        Ok(())
    }

    #[cold]
    fn no_side(reference: u32, wanted: &str) -> Fault {
        Fault::new(format!("{} is not {wanted}", Self::name_of(reference)))
    }

    #[cold]
    fn name_of(reference: u32) -> String {
        let index = index::<E>(reference);
        if E::Model::TABLE.locate(index).is_some() {
            return message::name::<E::Model>(index);
        }
        match E::CAN.state_of(index.wrapping_sub(E::Model::TABLE.len())) {
            Some((state, _)) => message::derivative(state),
            None => format!("value reference {reference}"),
        }
    }
}

/// Takes the memory of a vector for `n` zeros.
fn zeros(memory: &mut Vec<f64>, n: usize) -> Vec<f64> {
    let mut zeros = std::mem::take(memory);
    zeros.clear();
    zeros.resize(n, 0.0);
    zeros
}

/// Checks that the seed has the right length and is finite, and that the array for the results is large enough.
fn check_sizes(seed: &[f64], needed: usize, (room, results): (usize, usize)) -> Result<(), Fault> {
    if seed.len() != needed {
        return Err(Fault::value("nSeed", seed.len(), format_args!("{needed} for these value references")));
    }
    if room != results {
        return Err(Fault::value("nSensitivity", room, format_args!("{results} for these value references")));
    }
    match seed.iter().find(|x| !x.is_finite()) {
        None => Ok(()),
        Some(x) => Err(Fault::value("seed", x, "finite numbers")),
    }
}

/// Refuses a call that a model without states does not support.
fn supported<E: Exported>(lacks: &str) -> Result<(), Fault> {
    // They are computed on a copy.
    if E::CAN.continuous.is_some() && E::CAN.saved.is_some() {
        Ok(())
    } else {
        Err(Fault::new(format!("not supported: {lacks}")))
    }
}

/// The derivatives and outputs of a block.
fn evaluate<E: Exported>(
    block: &mut Block<E::Model>,
    now: Elapsed,
    initial: bool,
    dx: &mut [f64],
) -> Result<(), Fault> {
    let Some(continuous) = &E::CAN.continuous else {
        block.model.output(now, &mut block.out);
        return Ok(());
    };
    if !initial {
        (continuous.settle)(&mut block.model);
        (continuous.observe)(&block.model, now, &mut block.out);
    }
    let n = E::CAN.count_states(&mut block.model);
    (continuous.derivatives)(&block.model, now, &mut dx[..n])?;
    E::CAN.spread(&mut block.model, dx);
    Ok(())
}

/// An unknown's value: a derivative, or a row of the table.
fn pick<E: Exported>(block: &mut Block<E::Model>, dx: &[f64], index: usize) -> f64 {
    let derivative = dx.get(index.wrapping_sub(E::Model::TABLE.len())).copied();
    derivative.unwrap_or_else(|| real(block, index))
}

/// Creates a direction in which no continuous input, no state and, so far, no output changes.
fn clear<E: Exported>(direction: &mut Block<E::Model>) {
    for index in E::Model::TABLE.indices() {
        if let Some((meta, Slot::Real(x))) = E::Model::TABLE.entry(direction, index)
            && (ramps(meta) || meta.causality == Causality::Output)
        {
            *x = 0.0;
        }
    }
    E::CAN.each_state(&mut direction.model, |_, x| *x = 0.0);
}

fn real<M: Model>(block: &mut Block<M>, index: usize) -> f64 {
    match M::TABLE.entry(block, index) {
        Some((_, Slot::Real(x))) => *x,
        Some((_, Slot::Constant(Constant::Real(x)))) => x,
        _ => f64::NAN,
    }
}

fn put<M: Model>(block: &mut Block<M>, index: usize, value: f64) {
    if let Some((_, Slot::Real(x))) = M::TABLE.entry(block, index) {
        *x = value;
    }
}
