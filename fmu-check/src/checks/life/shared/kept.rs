//! Values that a run must keep or return unchanged: several in one call, inputs, parameters, Booleans, numbers.

use crate::checks::life::shared::values::is_rounded;
use crate::encoding::{bits, quoted, same, show};
use crate::instance::{Instance, MANY};
use crate::session::{NotDetermined, Session};
use crate::settable::settable;
use fmu_import::Status;
use fmu_import::raw::{Buffer, take_events};
use model_description::{BaseType, Causality, ModelVariable, Variability};
use std::ffi::CString;

/// Steps of a run that looks at values.
const STEPS: u32 = 20;

fn scalars(session: &Session, base: BaseType, fits: impl Fn(&ModelVariable) -> bool) -> Vec<&ModelVariable> {
    let fits = |v: &&ModelVariable| v.base == base && !v.is_array() && v.clocks.is_empty() && fits(v);
    session.numeric().filter(|v| session.is_steady(v)).filter(fits).take(12).collect()
}

/// The values of several variables, each alone and all in one call, in both orders.
pub(crate) fn several(session: &Session) -> Result<(), NotDetermined> {
    let version = session.description.version;
    let instance = session.stepping()?;
    instance.change_inputs(2)?;
    instance.steps(3, session.h())?;
    let mut tried = 0;
    for &base in BaseType::ALL {
        let mut list = scalars(session, base, |_| true);
        list.retain(|v| instance.get(v).is_ok_and(|(status, bits)| status.is_ok() && !bits.is_empty()));
        if list.len() < 2 {
            continue;
        }
        let alone: Vec<u64> = instance.snapshot(&list)?.into_iter().flatten().collect();
        for order in ["in order", "in reverse order"] {
            let turned = |n: usize| if order == "in order" { n } else { list.len() - 1 - n };
            let references: Vec<u32> = (0..list.len()).map(|n| list[turned(n)].value_reference).collect();
            let mut buffer = Buffer::room(base, version, list.len());
            let call = format!("Get({} variables of the type {base}, {order})", list.len());
            let status = instance.call(&call, |raw| {
                raw.get(instance.handle, base, Some(&references), list.len(), Some(&mut buffer), list.len())
            })?;
            session.require(status.is_ok(), || format!("{call} returned {status}"));
            let written = status.is_ok() && !buffer.is_unwritten();
            session.require(!status.is_ok() || written, || format!("{call} returned OK and did not write all values"));
            if !written {
                return Ok(());
            }
            tried += 1;
            for (n, found) in buffer.bits().into_iter().enumerate() {
                let (v, own) = (list[turned(n)], alone[turned(n)]);
                let [found, own] = [[found], [own]];
                session.require(same(v, version, &found, &own), || {
                    let [found, own] = [found, own].map(|bits| show(v, version, &bits));
                    format!("{call}: {} is {found}, and {own} if it is read alone", v.name)
                });
            }
        }
    }
    several_set(session)?;
    if tried == 0 { session.not_applicable("no type has several variables") } else { Ok(()) }
}

/// Values set in one call read back as if each had been set alone.
fn several_set(session: &Session) -> Result<(), NotDetermined> {
    let version = session.description.version;
    for &base in BaseType::ALL {
        let mut list: Vec<(&ModelVariable, u64)> = Vec::new();
        for v in scalars(session, base, settable) {
            let (one, values) = (session.initializing()?, session.different_value(v, 1.0));
            // G04 looks at each alone.
            if let Some(values) = values
                && one.set(v, &values)?.is_ok()
                && one.get(v).is_ok_and(|(status, back)| status.is_ok() && same(v, version, &values, &back))
            {
                list.push((v, values[0]));
            }
        }
        if list.len() < 2 {
            continue;
        }
        let instance = session.initializing()?;
        let references: Vec<u32> = list.iter().map(|(v, _)| v.value_reference).collect();
        let mut buffer = Buffer::of(base, version, &list.iter().map(|(_, value)| *value).collect::<Vec<_>>());
        let call = format!("Set({} variables of the type {base})", list.len());
        let status = instance.call(&call, |raw| {
            raw.set(instance.handle, base, Some(&references), list.len(), Some(&mut buffer), list.len())
        })?;
        // The model may reject these values in combination.
        if !status.is_ok() {
            return Ok(());
        }
        for (v, value) in &list {
            let (status, back) = instance.get(v)?;
            session.require(!status.is_ok() || same(v, version, &[*value], &back), || {
                let [set, got] = [&[*value][..], &back].map(|bits| show(v, version, bits));
                format!("{call}: {} was set to {set}, and is {got}", v.name)
            });
        }
    }
    Ok(())
}

/// Runs with changing inputs and calls `look` after each step, until it finds something.
fn look_at(
    session: &Session,
    look: &mut dyn FnMut(&Instance<'_>, u32) -> Result<bool, NotDetermined>,
) -> Result<(), NotDetermined> {
    let instance = session.stepping()?;
    for k in 0..STEPS {
        if look(&instance, k)? {
            return Ok(());
        }
        instance.change_inputs(k)?;
        instance.steps(1, session.h())?;
    }
    look(&instance, STEPS).map(|_| ())
}

pub(crate) fn written(session: &Session) -> Result<(), NotDetermined> {
    let all: Vec<_> = session.numeric().filter(|v| v.clocks.is_empty()).take(200).collect();
    look_at(session, &mut |instance, k| {
        for v in &all {
            session.unwritten.set(false);
            let (status, _) = instance.get(v)?;
            if status == Status::ERROR {
                session.violated(format!("line {}: Get({}) after {k} steps returned {status}", v.line, v.name));
                return Ok(true);
            }
            if status.is_ok() && session.unwritten.get() {
                session.violated(format!(
                    "line {}: Get({}) after {k} steps returned OK and did not write the value",
                    v.line, v.name
                ));
                return Ok(true);
            }
        }
        Ok(false)
    })
}

/// Continuous outputs before and after the end of the initialization.
pub(crate) fn initialized(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| v.variability == Variability::Continuous && v.causality == Causality::Output;
    let outputs: Vec<_> = session.watched().into_iter().filter(fits).collect();
    if outputs.is_empty() {
        return session.not_applicable("there is no continuous output");
    }
    let instance = session.initializing()?;
    let before = instance.snapshot(&outputs)?;
    instance.exit()?;
    for (v, (old, new)) in outputs.iter().zip(before.into_iter().zip(instance.snapshot(&outputs)?)) {
        if !old.is_empty() && !new.is_empty() {
            let what = "after ExitInitializationMode, compared with before";
            session.compare_variables(&[*v], what, &[vec![old]], &[vec![new]]);
        }
    }
    Ok(())
}

pub(crate) fn booleans_read(session: &Session) -> Result<(), NotDetermined> {
    let all: Vec<_> =
        session.numeric().filter(|v| v.base == BaseType::Boolean && v.clocks.is_empty()).take(60).collect();
    if all.is_empty() {
        return session.not_applicable("there is no Boolean");
    }
    look_at(session, &mut |instance, k| {
        for v in &all {
            let (status, found) = instance.get(v)?;
            if status.is_ok() && found.iter().any(|b| *b > 1) {
                let text = show(v, session.description.version, &found);
                session.violated(format!("line {}: {} is {text} after {k} steps, neither 0 nor 1", v.line, v.name));
                return Ok(true);
            }
        }
        Ok(false)
    })
}

pub(crate) fn finite(session: &Session) -> Result<(), NotDetermined> {
    let outputs: Vec<_> = session.watched().into_iter().filter(|v| v.base.is_float()).collect();
    if outputs.is_empty() {
        return session.not_applicable("there is no floating-point output");
    }
    let _ = take_events();
    let number = |v: &ModelVariable, b: &u64| match v.base {
        BaseType::Float32 => f64::from(f32::from_bits(u32::try_from(b & 0xffff_ffff).unwrap_or(0))),
        _ => f64::from_bits(*b),
    };
    let fits = |v: &ModelVariable, found: &[u64]| found.iter().all(|b| number(v, b).is_finite());
    look_at(session, &mut |instance, k| {
        if outputs.len() >= MANY && outputs.iter().zip(instance.snapshot(&outputs)?).all(|(v, found)| fits(v, &found)) {
            return Ok(false);
        }
        for v in &outputs {
            let (status, found) = instance.get(v)?;
            if status.is_ok() && !fits(v, &found) && take_events().is_empty() {
                let text = show(v, session.description.version, &found);
                session.violated(format!("line {}: {} is {text} after {k} steps, without a message", v.line, v.name));
                return Ok(true);
            }
        }
        Ok(false)
    })
}

/// Values for an input: near its start, and far from it.
fn values_of_input(session: &Session, v: &ModelVariable) -> Vec<Vec<u64>> {
    let near = session.different_value(v, 1.0);
    if v.base == BaseType::Boolean || !v.base.is_float() {
        return near.into_iter().collect();
    }
    let far = match (v.min, v.max) {
        (_, Some(max)) if max.is_finite() => Some(max),
        (Some(min), _) if min.is_finite() => Some(min),
        (None, None) => Some(100.0 * v.nominal.unwrap_or(1.0)),
        _ => None,
    };
    near.into_iter().chain(far.map(|far| vec![bits(v.base, far); session.elements(v)])).collect()
}

pub(crate) fn inputs_keep(session: &Session) -> Result<(), NotDetermined> {
    let inputs: Vec<_> = session.number_inputs().take(40).collect();
    if inputs.is_empty() {
        return session.not_applicable("there is no numeric input");
    }
    let version = session.description.version;
    session.cases(inputs, |v| {
        for values in values_of_input(session, v) {
            let instance = session.stepping()?;
            // A model may refuse a value, or steps with it.
            if !instance.set(v, &values)?.is_ok() {
                continue;
            }
            for k in 0..=3 {
                if k > 0 && instance.steps(1, session.h()).is_err() {
                    break;
                }
                let (status, back) = instance.get(v)?;
                if !status.is_ok() {
                    break;
                }
                if !is_rounded(v, version, &values, &back) && !same(v, version, &values, &back) {
                    let [set, got] = [&values, &back].map(|bits| show(v, version, bits));
                    session.violated(format!("line {}: {}: set to {set}, after {k} steps it is {got}", v.line, v.name));
                    return Ok(());
                }
            }
        }
        Ok(())
    })
}

pub(crate) fn parameters_keep(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| {
        v.causality == Causality::Parameter
            && matches!(v.variability, Variability::Fixed | Variability::Tunable)
            && v.clocks.is_empty()
            && session.is_steady(v)
    };
    let all: Vec<_> = session.numeric().filter(fits).collect();
    if all.is_empty() {
        return session.not_applicable("there is no numeric parameter");
    }
    let instance = session.stepping()?;
    let before = instance.snapshot(&all)?;
    for k in 0..100 {
        instance.change_inputs(k)?;
        if instance.steps(1, session.h()).is_err() || session.half_time_used() {
            break;
        }
    }
    for ((v, old), new) in all.iter().zip(&before).zip(instance.snapshot(&all)?) {
        session.require(old.is_empty() || new.is_empty() || *old == new, || {
            let [old, new] = [old, &new].map(|bits| show(v, session.description.version, bits));
            format!(
                "line {}: the parameter {} was {old} and is {new} after steps, although the importer did not set it",
                v.line, v.name
            )
        });
    }
    Ok(())
}

/// Derivatives that are variables, and their states, against the slope over steps in which the derivative hardly changes.
pub(crate) fn derivatives_are_slopes(session: &Session) -> Result<(), NotDetermined> {
    let d = &session.description;
    let real =
        |v: &ModelVariable| v.base == BaseType::Float64 && !v.is_array() && v.clocks.is_empty() && session.is_steady(v);
    let pairs: Vec<(&ModelVariable, &ModelVariable)> = d
        .variables
        .iter()
        .filter(|v| real(v))
        .filter_map(|v| Some((v, d.referenced(v.derivative?)?)))
        .filter(|(_, state)| real(state))
        .take(60)
        .collect();
    if pairs.is_empty() {
        return session.not_applicable("no variable is the derivative of another");
    }
    let (instance, h) = (session.stepping()?, session.h());
    let all: Vec<&ModelVariable> = pairs.iter().flat_map(|(der, state)| [*der, *state]).collect();
    let (mut wrong, mut tried) = (vec![0; pairs.len()], vec![0; pairs.len()]);
    let mut texts = vec![String::new(); pairs.len()];
    let mut before = instance.numbers(&all)?;
    for k in 0..24 {
        if k % 6 == 0 {
            instance.change_inputs(k / 6)?;
            instance.steps(1, h)?;
            before = instance.numbers(&all)?;
        }
        let t = instance.time.get();
        instance.steps(1, h)?;
        let after = instance.numbers(&all)?;
        for (n, (der, state)) in pairs.iter().enumerate() {
            let [d0, d1, x0, x1] = [before[2 * n], after[2 * n], before[2 * n + 1], after[2 * n + 1]];
            let (slope, scale) = ((x1 - x0) / h, d0.abs().max(d1.abs()));
            // If the derivative itself changes, or rounding dominates, a slope is inconclusive.
            let rough = (d1 - d0).abs() > 0.2 * scale || scale * h <= 1e-9 * x0.abs().max(x1.abs()).max(1e-9);
            if rough || !slope.is_finite() {
                continue;
            }
            tried[n] += 1;
            if (slope - 0.5 * (d0 + d1)).abs() > 0.3 * scale {
                wrong[n] += 1;
                texts[n] = format!(
                    "line {}: {} is {d1:?} at t = {:?}, and the slope of {} from t = {t:?} is {slope:?}",
                    der.line,
                    der.name,
                    instance.time.get(),
                    state.name
                );
            }
        }
        before = after;
    }
    for ((wrong, tried), text) in wrong.into_iter().zip(tried).zip(texts) {
        session.require(tried < 4 || wrong * 2 <= tried, || text);
    }
    Ok(())
}

/// Texts of all string variables that can be read.
pub(crate) fn texts(instance: &Instance<'_>) -> Result<Vec<(String, Option<String>)>, NotDetermined> {
    let session = instance.session;
    let strings = session
        .description
        .variables
        .iter()
        .filter(|v| v.base == BaseType::String && !v.is_array() && v.clocks.is_empty() && session.is_steady(v));
    let mut all = Vec::new();
    for v in strings {
        let call = format!("GetString({})", v.name);
        let (status, mut found) =
            instance.call_for(&call, |raw| raw.get_strings(instance.handle, &[v.value_reference], 1))?;
        if status.is_ok() {
            let text = found.pop().flatten();
            session.record_value(&text.as_deref().map_or_else(|| "NULL".into(), quoted));
            all.push((v.name.clone(), text));
        }
    }
    Ok(all)
}

/// Sets all settable numbers and texts to other values.
pub(crate) fn set_all(instance: &Instance<'_>, scale: f64) -> Result<(), NotDetermined> {
    let session = instance.session;
    let all: Vec<_> = session.description.variables.iter().filter(|v| settable(v)).collect();
    if all.len() < MANY {
        return set_each(instance, &all, scale);
    }
    session.record_calls(&format!("setting {} variables, one by one", all.len()), || set_each(instance, &all, scale))
}

fn set_each(instance: &Instance<'_>, all: &[&ModelVariable], scale: f64) -> Result<(), NotDetermined> {
    let session = instance.session;
    for v in all {
        if v.base == BaseType::String && !v.is_array() {
            // Longer than a fixed buffer of an FMU may be, and different for each scale.
            let text = CString::new(format!("another text {scale} ").repeat(6)).unwrap_or_default();
            let call = format!("SetString({} = {text:?})", v.name);
            let _ =
                instance.call(&call, |raw| raw.set_strings(instance.handle, &[v.value_reference], &[Some(&text)]))?;
        } else if !matches!(v.base, BaseType::String | BaseType::Binary | BaseType::Clock)
            && let Some(values) = session.different_value(v, scale)
            && instance.set(v, &values)? == Status::ERROR
        {
            return Err(NotDetermined(format!("{} cannot be set", v.name)));
        }
    }
    Ok(())
}
