//! Setting values: they read back, take effect, and do no harm if they are invalid.

use crate::encoding::{bits, quoted, same, show};
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::settable::settable;
use fmu_import::Status;
use fmu_import::raw::Simple;
use model_description::{BaseType, Causality, FmiVersion, ModelVariable, Variability, parse_number};
use std::ffi::CString;

/// The start values of a variable as bits; `None` for text that is not of the type.
pub(crate) fn expected(v: &ModelVariable, n: usize) -> Option<Vec<u64>> {
    let one = |word: &str| match v.base {
        BaseType::Boolean => Some(u64::from(matches!(word, "true" | "1"))),
        base if base.is_float() => parse_number(word).map(|x| bits(base, x)),
        BaseType::UInt64 => word.parse().ok(),
        _ => word.parse::<i64>().ok().map(i64::cast_unsigned),
    };
    let values: Vec<u64> = v.start.as_deref()?.split_whitespace().map(one).collect::<Option<_>>()?;
    match values.len() {
        1 => Some(vec![values[0]; n]),
        len if len == n => Some(values),
        _ => None,
    }
}

pub(crate) fn round_trip(session: &Session) -> Result<(), NotDetermined> {
    let mut instance = session.initializing()?;
    let (mut refused, mut kept) = (Vec::new(), Vec::new());
    // G09 looks at outputs and local variables.
    let given = |v: &&ModelVariable| settable(v) && matches!(v.causality, Causality::Input | Causality::Parameter);
    for v in session.numeric().filter(given) {
        let Some(values) = session.different_value(v, 1.0) else { continue };
        let status = instance.set(v, &values)?;
        if !status.is_ok() {
            // The model may refuse a value, which other checks report; the remaining variables are still checked.
            if status == Status::ERROR {
                refused.push(format!(
                    "Set({} = {}) returned {status}",
                    v.name,
                    show(v, session.description.version, &values)
                ));
                instance = session.initializing()?;
            }
            continue;
        }
        let Some(back) = instance.get_back(v)? else {
            instance = session.initializing()?;
            continue;
        };
        if same(v, session.description.version, &values, &back) {
            // And back again: both values of a Boolean.
            if let Some(start) = expected(v, session.elements(v))
                && instance.set(v, &start)?.is_ok()
                && let Some(back) = instance.get_back(v)?
                && !same(v, session.description.version, &start, &back)
            {
                let [set, got] = [&start, &back].map(|bits| show(v, session.description.version, bits));
                session.value_deviates(v, &start, back, &format!("{}: set back to {set}, got {got}", v.name));
            }
            kept.push((v, values));
            continue;
        }
        if is_rounded(v, session.description.version, &values, &back) {
            session.note(format!("{} is in single precision: what is set is rounded", v.name));
        } else {
            let [set, got] = [&values, &back].map(|bits| show(v, session.description.version, bits));
            session.value_deviates(v, &values, back, &format!("{}: set to {set}, got {got}", v.name));
        }
    }
    match refused.first() {
        Some(first) => Err(NotDetermined(format!("{first}; {} variables were refused", refused.len()))),
        None => set_before_initialization(session, &kept),
    }
}

/// Values set before Initialization Mode persist in it: parameters, and in FMI 3.0 inputs.
fn set_before_initialization(session: &Session, kept: &[(&ModelVariable, Vec<u64>)]) -> Result<(), NotDetermined> {
    let fits = |v: &ModelVariable| {
        v.causality == Causality::Parameter || (v.causality == Causality::Input && !session.is_v2())
    };
    let instance = session.fresh()?;
    let kept: Vec<_> = kept.iter().filter(|(v, _)| fits(v)).collect();
    for (v, values) in &kept {
        // L07 checks the call. The model may reject these values in combination.
        if !instance.set(v, values)?.is_ok() {
            return Ok(());
        }
    }
    if let Err(NotDetermined(why)) = instance.enter() {
        session.note(why);
        return Ok(());
    }
    for (v, values) in kept {
        let (status, back) = instance.get(v)?;
        if !status.is_ok() {
            break;
        }
        if !same(v, session.description.version, values, &back) {
            let [set, got] = [values, &back].map(|bits| show(v, session.description.version, bits));
            let text = format!("{}: set to {set} before the initialization, got {got} in it", v.name);
            session.value_deviates(v, values, back, &text);
        }
    }
    Ok(())
}

/// Whether a real variable is stored in single precision; FMI 2.0 cannot express this, because it has one type of real numbers.
pub(crate) fn is_rounded(v: &ModelVariable, version: FmiVersion, set: &[u64], got: &[u64]) -> bool {
    #[expect(clippy::cast_possible_truncation, reason = "rounds")]
    let rounded = |bits: &u64| f64::from(f64::from_bits(*bits) as f32).to_bits();
    version == FmiVersion::V2 && v.base == BaseType::Float64 && set.iter().map(rounded).eq(got.iter().copied())
}

/// Maximum length in bytes of a text that is useful in practice.
const LONG: usize = 4096;

pub(crate) fn strings(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| v.base == BaseType::String && settable(v) && !v.is_array();
    let Some(v) = session.description.variables.iter().find(fits) else {
        return session.not_applicable("no string can be set");
    };
    session.cases(["", "probe \u{e4}\u{1f50b}", &"x".repeat(1000), &"x".repeat(1 << 20)], |text| {
        let instance = session.initializing()?;
        let c_text = CString::new(text).unwrap_or_default();
        let status = instance.call(&format!("SetString({} = {})", v.name, quoted(text)), |raw| {
            raw.set_strings(instance.handle, &[v.value_reference], &[Some(&c_text)])
        })?;
        if !status.is_ok() {
            return Err(NotDetermined(format!("SetString({}) returned {status}", v.name)));
        }
        let (status, back) = instance.call_for(&format!("GetString({})", v.name), |raw| {
            raw.get_strings(instance.handle, &[v.value_reference], 1)
        })?;
        if !status.is_ok() {
            return Err(NotDetermined(format!("GetString({}) returned {status}", v.name)));
        }
        let got = back.first().and_then(Option::as_deref);
        session.record_value(&got.map_or_else(|| "NULL".into(), quoted));
        if got != Some(text) {
            let finding = format!("{}: a string of {} bytes {}", v.name, text.len(), read_back(text, got));
            // The standards set no limit, but no application needs a text of this length.
            if text.len() > LONG { session.lesser(Level::Should, finding) } else { session.violated(finding) }
        }
        Ok(())
    })?;
    session.case(|| several_strings(session));
    Ok(())
}

/// The result of reading back a string that was set.
fn read_back(set: &str, got: Option<&str>) -> String {
    match got {
        None => "reads back as NULL".into(),
        Some(got) if set.starts_with(got) => format!("is cut: its first {} bytes read back", got.len()),
        Some(got) => format!("reads back as {:?}", got.chars().take(40).collect::<String>()),
    }
}

/// Strings set in one call keep separate values.
fn several_strings(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| v.base == BaseType::String && settable(v) && !v.is_array();
    let all: Vec<_> = session.description.variables.iter().filter(fits).take(20).collect();
    if all.len() < 2 {
        return Ok(());
    }
    let instance = session.initializing()?;
    let texts: Vec<_> = (0..all.len()).map(|k| format!("text {k}")).collect();
    let references: Vec<_> = all.iter().map(|v| v.value_reference).collect();
    let c_texts: Vec<_> = texts.iter().map(|text| CString::new(text.as_str()).unwrap_or_default()).collect();
    let given: Vec<_> = c_texts.iter().map(|text| Some(text.as_c_str())).collect();
    let call = format!("SetString({} variables)", all.len());
    // The model may reject these values in combination.
    if !instance.call(&call, |raw| raw.set_strings(instance.handle, &references, &given))?.is_ok() {
        return Ok(());
    }
    drop(c_texts);
    let call = format!("GetString({} variables)", all.len());
    let (status, back) = instance.call_for(&call, |raw| raw.get_strings(instance.handle, &references, all.len()))?;
    if !status.is_ok() {
        return Ok(());
    }
    for ((v, text), got) in all.iter().zip(&texts).zip(&back) {
        session.require(got.as_deref() == Some(text), || {
            format!("{}: {text:?}, set with other strings, {}", v.name, read_back(text, got.as_deref()))
        });
    }
    Ok(())
}

/// A binary variable that can be set.
fn binary(session: &Session) -> Option<&ModelVariable> {
    let fits = |v: &&ModelVariable| v.base == BaseType::Binary && settable(v) && !v.is_array();
    session.description.variables.iter().find(fits)
}

pub(crate) fn binaries(session: &Session) -> Result<(), NotDetermined> {
    let Some(v) = binary(session) else { return session.not_applicable("no bytes can be set") };
    let most = usize::try_from(v.max_size.unwrap_or(64)).unwrap_or(64).min(1 << 20);
    session.cases([0, 1, most], |size| {
        let instance = session.initializing()?;
        let bytes: Vec<u8> = (0..=u8::MAX).rev().cycle().take(size).collect();
        let status = instance.call(&format!("SetBinary({})", v.name), |raw| {
            raw.set_binaries(instance.handle, &[v.value_reference], &[&bytes])
        })?;
        if !status.is_ok() {
            return Err(NotDetermined(format!("SetBinary({}) of {size} bytes returned {status}", v.name)));
        }
        let (status, back) = instance.call_for(&format!("GetBinary({})", v.name), |raw| {
            raw.get_binaries(instance.handle, &[v.value_reference])
        })?;
        if !status.is_ok() {
            return Err(NotDetermined(format!("GetBinary({}) returned {status}", v.name)));
        }
        // Without bytes, the pointer may be NULL.
        let back = back.first().map(|found| found.as_deref().unwrap_or_default());
        session.require(back == Some(&bytes[..]), || format!("{}: {size} bytes did not read back", v.name));
        Ok(())
    })
}

pub(crate) fn too_many_bytes(session: &Session) -> Result<(), NotDetermined> {
    let limited = binary(session).and_then(|v| Some((v, usize::try_from(v.max_size?).ok()?)));
    let Some((v, most)) = limited.filter(|(_, most)| *most < 1 << 24) else {
        return session.not_applicable("no bytes with a maxSize can be set");
    };
    let instance = session.initializing()?;
    let status = instance.call(&format!("SetBinary({}) of {} bytes", v.name, most + 1), |raw| {
        raw.set_binaries(instance.handle, &[v.value_reference], &[&vec![b'x'; most + 1]])
    })?;
    session.require(!status.is_ok(), || format!("{}: {} bytes were accepted, and maxSize is {most}", v.name, most + 1));
    Ok(())
}

pub(crate) fn not_a_number(session: &Session) -> Result<(), NotDetermined> {
    let inputs = session.float_inputs();
    if inputs.is_empty() {
        return session.not_applicable("there is no floating-point input");
    }
    let alone = session.stepping()?.run(5, session.h())?;
    for v in &inputs {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, -1e308, 5e-324, -0.0] {
            if session.half_time_used() {
                session.note("time ran out before all inputs were tried");
                return Ok(());
            }
            session.case(|| {
                let (instance, other) = (session.stepping()?, session.stepping()?);
                let _ = instance.set(v, &vec![bits(v.base, x); session.elements(v)])?;
                for _ in 0..3 {
                    let _ = instance.call(&format!("DoStep with {} = {x}", v.name), |raw| {
                        raw.do_step(instance.handle, instance.time.get(), session.h(), false, [true; 4]).map(|(s, _)| s)
                    })?;
                    instance.time.set(instance.time.get() + session.h());
                }
                let undisturbed = other.run(5, session.h())?;
                session.require(undisturbed == alone, || {
                    format!("{} = {x} in one instance changed the results of another", v.name)
                });
                Ok(())
            });
        }
    }
    Ok(())
}

pub(crate) fn out_of_range(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| {
        v.causality == Causality::Parameter && settable(v) && v.base.is_float() && (v.min.is_some() || v.max.is_some())
    };
    let limited: Vec<_> = session.description.variables.iter().filter(fits).take(40).collect();
    if limited.is_empty() {
        return session.not_applicable("there is no floating-point parameter with min or max");
    }
    for v in limited {
        let below = v.min.map(|x| x - x.abs().max(1.0));
        let above = v.max.map(|x| x + x.abs().max(1.0));
        for x in below.into_iter().chain(above).filter(|x| x.is_finite()) {
            session.case(|| {
                let instance = session.initializing()?;
                let status = instance.set(v, &vec![bits(v.base, x); session.elements(v)])?;
                let end = if status.is_ok() { instance.simple(Simple::ExitInitializationMode)? } else { status };
                session.require(!end.is_ok(), || format!("line {}: {} = {x} was accepted", v.line, v.name));
                Ok(())
            });
        }
    }
    Ok(())
}

pub(crate) fn booleans(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| v.base == BaseType::Boolean && settable(v) && !v.is_array();
    let Some(v) = session.description.variables.iter().find(fits) else {
        return session.not_applicable("no Boolean can be set");
    };
    let width = 8 * fmu_import::raw::width(v.base, session.description.version);
    session.cases([2, 0xff, u64::MAX >> (64 - width)], |value| {
        let instance = session.initializing()?;
        let status = instance.set(v, &[value])?;
        if status.is_ok() {
            if let Some(back) = instance.get_back(v)? {
                let got = back.first().copied().unwrap_or(0);
                session.require(got <= 1, || format!("{}: set to {value}, got {got}", v.name));
            }
            let _ = instance.simple(Simple::ExitInitializationMode)?;
            let _ = instance.step(session.h())?;
        }
        Ok(())
    })
}

pub(crate) fn tunable(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| {
        v.causality == Causality::Parameter && v.variability == Variability::Tunable && v.clocks.is_empty()
    };
    let tunable: Vec<_> = session.numeric().filter(fits).take(40).collect();
    if tunable.is_empty() {
        return session.not_applicable("there is no tunable parameter");
    }
    session.cases(tunable, |v| {
        let instance = session.stepping()?;
        instance.steps(2, session.h())?;
        let Some(values) = session.different_value(v, 1.0) else { return Ok(()) };
        let status = instance.set(v, &values)?;
        session.require(status.is_ok(), || format!("line {}: Set({}) between steps returned {status}", v.line, v.name));
        if !status.is_ok() {
            return Ok(());
        }
        if let Err(NotDetermined(why)) = instance.steps(2, session.h()) {
            // The model may have rules that the description cannot express.
            let values = show(v, session.description.version, &values);
            session.lesser(Level::Hard, format!("{} was set to {values} between steps, and then {why}", v.name));
            return Ok(());
        }
        let Some(back) = instance.get_back(v)? else { return Ok(()) };
        session.require(same(v, session.description.version, &values, &back), || {
            let (set, got) =
                (show(v, session.description.version, &values), show(v, session.description.version, &back));
            format!("line {}: {}: set to {set}, but two steps later it is {got}", v.line, v.name)
        });
        Ok(())
    })
}

/// Maximum number of times that all outputs are read while values are set.
const READINGS: usize = 100;

/// Sets values in one instance directly; in another, sets other values, reads the outputs, then sets the same values.
pub(crate) fn iterated_initialization(session: &Session) -> Result<(), NotDetermined> {
    let watched = session.watched();
    let settable: Vec<_> = session.numeric().filter(|v| settable(v) && v.base.is_float()).collect();
    let (plain, iterated) = (session.initializing()?, session.initializing()?);
    // Reading all outputs after each of thousands of variables would take the square of their number.
    let stride = settable.len().div_ceil(READINGS);
    for (k, v) in settable.iter().enumerate().take_while(|_| !session.half_time_used()) {
        let (Some(first), Some(last)) = (session.different_value(v, 3.0), session.different_value(v, 1.0)) else {
            continue;
        };
        // Refusals are not the subject of this check.
        if iterated.set(v, &first)?.is_ok() && iterated.set(v, &last)?.is_ok() {
            if k % stride == 0 {
                let _ = iterated.snapshot(&watched)?;
            }
            let _ = plain.set(v, &last)?;
        } else {
            return Err(NotDetermined(format!("{} cannot be set", v.name)));
        }
    }
    let [a, b] = [plain.snapshot(&watched)?, iterated.snapshot(&watched)?];
    session.compare("in initialization mode, after values set and read earlier", &[a], &[b]);
    match (plain.exit(), iterated.exit()) {
        (Ok(()), Ok(())) => {}
        (Err(NotDetermined(why)), Err(_)) => {
            session.note(format!("these values are inconsistent: {why}"));
            return Ok(());
        }
        (Err(NotDetermined(why)), _) | (_, Err(NotDetermined(why))) => {
            session.violated(format!("only one of two instances with the same values fails: {why}"));
            return Ok(());
        }
    }
    let (a, b) = (plain.run(5, session.h())?, iterated.run(5, session.h())?);
    session.compare("after an initialization that set values twice", &a, &b);
    Ok(())
}
