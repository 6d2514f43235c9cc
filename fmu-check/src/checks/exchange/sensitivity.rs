//! Directional and adjoint derivatives (FMI 2.0.5, 2.1.9; FMI 3.0.2, 2.2.12).

use crate::check::{Check, Levels, Run};
use crate::encoding::show;
use crate::exchange::Importer;
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use fmu_import::Status;
use fmu_import::raw::{Sensitivity, SensitivityArguments};
use model_description::{BaseType, Causality, Interface, ModelVariable, Variability};

const DIRECTIONAL: &str = "2.0.5, 2.1.9; 3.0.2, 2.2.12.1";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "D01", clause: DIRECTIONAL, levels: Levels::SHOULD, run: Run::Exchange(differences),
        requirement: "Directional derivatives in Continuous-Time Mode agree with central differences of Set and Get, to 0.1 %.",
        tried: "Compares with central differences of the FMU's own values.", fix: "Check the order of the seed and the columns of the matrix." },
    Check { id: "D02", clause: "3.0.2, 2.2.12.2", levels: Levels(None, Some(Level::Should)), run: Run::Exchange(adjoint),
        requirement: "Adjoint and directional derivatives belong to one matrix: w'(J v) = (J'w)'v.",
        tried: "Multiplies both matrices with random vectors.", fix: "Transpose the same matrix." },
    Check { id: "D03", clause: "3.0.2, 2.2.4", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Exchange(wrong_arguments),
        requirement: "Partial derivatives of variables that do not exist, and with a seed or result of the wrong length, give Error.",
        tried: "Passes references that do not exist, and wrong lengths.", fix: "Check references and lengths first." },
    Check { id: "D04", clause: "hardening", levels: Levels::HARD, run: Run::Exchange(unchanged),
        requirement: "A partial derivative changes no state, derivative, event indicator or output.",
        tried: "Reads everything before and after.", fix: "Compute on a copy." },
    Check { id: "D05", clause: "2.0.5, 4.2.4; 3.0.2, 4.2.1", levels: Levels::MUST, run: Run::Probe(at_communication_points),
        requirement: "With the flag on CoSimulation, directional derivatives can be read at communication points.",
        tried: "Reads a derivative of each output between steps.", fix: "Implement the function for co-simulation too, or drop the flag there." },
];

fn directional(interface: Option<&Interface>) -> bool {
    interface.is_some_and(|i| i.flag("providesDirectionalDerivative") || i.flag("providesDirectionalDerivatives"))
}

/// Ends a probe of an FMU without directional derivatives, or without anything to differentiate.
macro_rules! needs_derivatives {
    ($session:ident) => {
        if !directional($session.description.model_exchange.as_ref()) {
            return $session.not_applicable("providesDirectionalDerivatives is false for Model Exchange");
        }
        if Variables::of($session).is_empty() {
            return $session
                .not_applicable("there are no scalar states or continuous inputs, or nothing depends on them");
        }
    };
}

/// The variables of the matrix of partial derivatives.
struct Variables<'b> {
    states: Vec<&'b ModelVariable>,
    inputs: Vec<&'b ModelVariable>,
    unknowns: Vec<&'b ModelVariable>,
}

fn is_real(v: &ModelVariable) -> bool {
    v.base == BaseType::Float64 && !v.is_array() && v.clocks.is_empty() && v.variability == Variability::Continuous
}

impl<'b> Variables<'b> {
    fn of(session: &'b Session) -> Self {
        let d = &session.description;
        let outputs = d.variables.iter().filter(|v| v.causality == Causality::Output && is_real(v));
        let derivatives = d.derivatives.iter().filter_map(|u| d.referenced(u.reference)).filter(|v| is_real(v));
        Self {
            states: if d.states().iter().all(|v| is_real(v)) { d.states() } else { Vec::new() },
            inputs: session.number_inputs().filter(|v| is_real(v)).collect(),
            unknowns: derivatives.chain(outputs).collect(),
        }
    }

    fn is_empty(&self) -> bool {
        self.unknowns.is_empty() || (self.states.is_empty() && self.inputs.is_empty())
    }

    fn references(variables: &[&ModelVariable]) -> Vec<u32> {
        variables.iter().map(|v| v.value_reference).collect()
    }

    fn knowns(&self) -> Vec<&'b ModelVariable> {
        self.states.iter().chain(&self.inputs).copied().collect()
    }
}

/// An instance in Continuous-Time Mode after some steps.
fn at_a_point(session: &Session) -> Result<Instance<'_>, NotDetermined> {
    let instance = session.excited()?;
    let mut importer = Importer::start(&instance)?;
    importer.run(37, &mut |_| Ok(()))?;
    if importer.over { Err(NotDetermined("the FMU ends the simulation at once".into())) } else { Ok(instance) }
}

fn differences(session: &Session) -> Result<(), NotDetermined> {
    needs_derivatives!(session);
    let (instance, all) = (at_a_point(session)?, Variables::of(session));
    let (unknowns, mut compared, mut kinks) = (Variables::references(&all.unknowns), 0, 0);
    let (x, middle) = (instance.states()?, instance.numbers(&all.unknowns)?);
    let (knowns, mut columns) = (all.knowns(), Vec::new());
    for (j, known) in knowns.iter().enumerate() {
        let at = f64::from_bits(instance.get(known)?.1.first().copied().unwrap_or(0));
        // The cube root of the precision is best for a central difference.
        let step = 6e-6 * at.abs().max(known.nominal.unwrap_or(1.0).abs());
        let put = |value: f64| {
            if j < all.states.len() {
                let mut x = x.clone();
                x[j] = value;
                instance.set_states(&x)
            } else {
                instance.set(known, &[value.to_bits()])
            }
        };
        let mut sides = [Vec::new(), Vec::new()];
        for (side, sign) in sides.iter_mut().zip([-1.0, 1.0]) {
            if put(at + sign * step)?.is_ok() {
                *side = instance.numbers(&all.unknowns)?;
            }
        }
        instance.must("Set", put(at)?)?;
        if sides.iter().any(Vec::is_empty) {
            return Err(NotDetermined(format!("{} could not be changed", known.name)));
        }
        let (status, found) = instance.sensitivity(
            Sensitivity::GetDirectionalDerivative,
            [&unknowns, &[known.value_reference]],
            &[1.0],
        )?;
        if !status.is_ok() {
            session.violated(format!("GetDirectionalDerivative with respect to {} returned {status}", known.name));
            continue;
        }
        columns.push(found.clone());
        for (i, v) in all.unknowns.iter().enumerate() {
            let [low, high] = [sides[0][i], sides[1][i]];
            let (left, right) = ((middle[i] - low) / step, (high - middle[i]) / step);
            let difference = (high - low) / (2.0 * step);
            // Rounding of the value, and of terms of some hundred times its nominal size that cancel.
            let rounding = 1e-13 * middle[i].abs().max(high.abs()).max(v.nominal.unwrap_or(1.0).abs());
            let noise = rounding / step + 1e-9 * middle[i].abs();
            let scale = found[i].abs().max(difference.abs());
            if !difference.is_finite() || (left - right).abs() > 1e-2 * scale + 2.0 * noise {
                kinks += 1;
                continue;
            }
            compared += 1;
            session.require((found[i] - difference).abs() <= 1e-3 * scale + noise, || {
                format!(
                    "d {} / d {}: the FMU returns {}, the central difference is {difference} (tolerance 0.1 %)",
                    v.name, known.name, found[i]
                )
            });
        }
    }
    together(session, &instance, [&unknowns, &Variables::references(&knowns)], &columns)?;
    session.note(format!("{compared} partial derivatives compared, {kinks} at a kink left out"));
    Ok(())
}

/// A derivative in the direction of all knowns is the sum over the single knowns with seed 1.
fn together(
    session: &Session,
    instance: &Instance<'_>,
    [unknowns, knowns]: [&[u32]; 2],
    columns: &[Vec<f64>],
) -> Result<(), NotDetermined> {
    if columns.len() < knowns.len() {
        return Ok(());
    }
    let seed = pattern(knowns.len());
    let (status, found) = instance.sensitivity(Sensitivity::GetDirectionalDerivative, [unknowns, knowns], &seed)?;
    for (i, found) in found.iter().enumerate() {
        let parts = || columns.iter().zip(&seed).map(|(column, seed)| column[i] * seed);
        let (sum, scale) = (parts().sum::<f64>(), parts().map(f64::abs).sum::<f64>());
        session.require(status.is_ok() && (found - sum).abs() <= 1e-6 * scale, || {
            let name = session.description.variables.iter().find(|v| v.value_reference == unknowns[i]);
            let name = name.map_or_else(|| format!("unknown {}", i + 1), |v| v.name.clone());
            format!(
                "{name}: with the seed {seed:?} the derivative is {found} ({status}); the sum over the knowns is {sum}"
            )
        });
    }
    Ok(())
}

/// Numbers of both signs and different sizes.
fn pattern(n: usize) -> Vec<f64> {
    (0..n).map(|i| [1.0, -0.5, 2.0, 0.25, -3.0][i % 5]).collect()
}

fn adjoint(session: &Session) -> Result<(), NotDetermined> {
    needs_derivatives!(session);
    if !session.exchange_flag("providesAdjointDerivatives") {
        return session.not_applicable("providesAdjointDerivatives is false for Model Exchange");
    }
    let (instance, all) = (at_a_point(session)?, Variables::of(session));
    let (unknowns, knowns) = (Variables::references(&all.unknowns), Variables::references(&all.knowns()));
    let (v, mut w) = (pattern(knowns.len()), pattern(unknowns.len()));
    for turned in [false, true] {
        if turned {
            w = w.iter().map(|w| 1.5 - w).collect();
        }
        let (status, forward) =
            instance.sensitivity(Sensitivity::GetDirectionalDerivative, [&unknowns, &knowns], &v)?;
        instance.must("GetDirectionalDerivative", status)?;
        let (status, backward) = instance.sensitivity(Sensitivity::GetAdjointDerivative, [&unknowns, &knowns], &w)?;
        if !status.is_ok() {
            session.violated(format!("GetAdjointDerivative returned {status}"));
            return Ok(());
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let size = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a * b).abs()).sum::<f64>();
        let (one, other) = (dot(&w, &forward), dot(&backward, &v));
        let scale = size(&w, &forward).max(size(&backward, &v));
        session.require((one - other).abs() <= 1e-6 * scale, || {
            format!("w'(J v) is {one}, (J'w)'v is {other} (tolerance 1e-6 of {scale})")
        });
    }
    Ok(())
}

fn wrong_arguments(session: &Session) -> Result<(), NotDetermined> {
    needs_derivatives!(session);
    let all = Variables::of(session);
    let (unknown, known) = (all.unknowns[0].value_reference, all.knowns()[0].value_reference);
    let none = u32::MAX;
    let v3 = !session.is_v2();
    let mut cases = vec![
        ("an unknown that does not exist", none, known, 1, 1),
        ("a known that does not exist", unknown, none, 1, 1),
    ];
    if v3 {
        cases.push(("a seed of length 2 for one known", unknown, known, 2, 1));
        cases.push(("a seed of length 0 for one known", unknown, known, 0, 1));
        cases.push(("a result of length 2 for one unknown", unknown, known, 1, 2));
    }
    let mut names = vec![Sensitivity::GetDirectionalDerivative];
    if session.exchange_flag("providesAdjointDerivatives") {
        names.push(Sensitivity::GetAdjointDerivative);
    }
    for name in names {
        for (what, unknown, known, seed, result) in cases.clone() {
            session.case(|| {
                let instance = at_a_point(session)?;
                let (unknowns, knowns, seeds, mut results) = ([unknown], [known], [1.0; 2], [0.0; 2]);
                let arguments = SensitivityArguments {
                    unknowns: (Some(&unknowns), 1),
                    knowns: (Some(&knowns), 1),
                    seed: (Some(&seeds), seed),
                };
                let call = format!("{} with {what}", name.as_str());
                let status = instance
                    .call(&call, |raw| raw.sensitivity(name, instance.handle, arguments, Some(&mut results), result))?;
                session.require(status == Status::ERROR, || format!("{call} returned {status}"));
                Ok(())
            });
        }
    }
    Ok(())
}

fn unchanged(session: &Session) -> Result<(), NotDetermined> {
    needs_derivatives!(session);
    let (instance, all) = (at_a_point(session)?, Variables::of(session));
    let (unknowns, knowns) = (Variables::references(&all.unknowns), Variables::references(&all.knowns()));
    let look = || -> Result<_, NotDetermined> {
        let vectors = [instance.states()?, instance.derivatives()?, instance.indicators()?];
        let bits = vectors.map(|v| v.into_iter().map(f64::to_bits).collect::<Vec<_>>());
        Ok((bits, instance.snapshot(&session.watched())?))
    };
    let before = look()?;
    for seed in [pattern(knowns.len()), vec![1e6; knowns.len()]] {
        let name = Sensitivity::GetDirectionalDerivative;
        let _ = instance.sensitivity(name, [&unknowns, &knowns], &seed)?;
        if session.exchange_flag("providesAdjointDerivatives") {
            let name = Sensitivity::GetAdjointDerivative;
            let _ = instance.sensitivity(name, [&unknowns, &knowns], &pattern(unknowns.len()))?;
        }
    }
    let ((old, old_outputs), (new, new_outputs)) = (before, look()?);
    let names = [
        session.element_names(session.description.states()),
        session.element_names(session.derivative_variables()),
        session.names_of_indicators(),
    ];
    for (names, (old, new)) in names.iter().zip(old.iter().zip(&new)) {
        for (k, (old, new)) in old.iter().zip(new).enumerate().filter(|(_, (old, new))| old != new) {
            let name = names.get(k).map_or("a value", String::as_str);
            let [old, new] = [old, new].map(|bits| f64::from_bits(*bits));
            session.violated(format!("after a partial derivative {name} is {new:?}; it was {old:?}"));
        }
    }
    for (v, (old, new)) in session.watched().iter().zip(old_outputs.iter().zip(&new_outputs)) {
        session.require(old == new, || {
            let [old, new] = [old, new].map(|bits| show(v, session.description.version, bits));
            format!("after a partial derivative {} is {new}; it was {old}", v.name)
        });
    }
    Ok(())
}

fn at_communication_points(session: &Session) -> Result<(), NotDetermined> {
    if !directional(session.description.co_simulation.as_ref()) {
        return session.not_applicable("providesDirectionalDerivatives is false for co-simulation");
    }
    let all = Variables::of(session);
    let listed = |v: &&ModelVariable| v.causality == Causality::Output;
    let outputs: Vec<_> = all.unknowns.iter().copied().filter(listed).collect();
    if outputs.is_empty() || all.inputs.is_empty() {
        return session.not_applicable("there is no continuous output, or no continuous input");
    }
    let (unknowns, knowns) = (Variables::references(&outputs), Variables::references(&all.inputs));
    let instance = session.stepping()?;
    instance.steps(2, session.h())?;
    let name = Sensitivity::GetDirectionalDerivative;
    let (status, found) = instance.sensitivity(name, [&unknowns, &knowns], &pattern(knowns.len()))?;
    session.require(status.is_ok() && found.iter().all(|d| d.is_finite()), || {
        let found = if status.is_ok() { format!(", {found:?}") } else { String::new() };
        format!("GetDirectionalDerivative after a step returned {status}{found}")
    });
    Ok(())
}
