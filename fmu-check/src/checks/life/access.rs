//! Getting and setting (FMI 2.0.5, 2.1.7; FMI 3.0.2, 2.2.7): refused calls and start values.

use crate::check::{Check, Levels, Run};
use crate::checks::life::shared::kept::{
    booleans_read, finite, initialized, inputs_keep, parameters_keep, several, written,
};
use crate::checks::life::shared::starts::stand;
use crate::checks::life::shared::values::{
    binaries, booleans, expected, iterated_initialization, not_a_number, out_of_range, round_trip, strings,
    too_many_bytes, tunable,
};
use crate::encoding::{attribute, bits, or_null, same, show};
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::settable::settable;
use crate::state::State;
use fmu_import::Status;
use fmu_import::raw::Buffer;
use model_description::{BaseType, Causality, FmiVersion, Initial, ModelVariable, Variability};
use std::slice;

const GET: &str = "2.0.5, 2.1.7; 3.0.2, 2.2.7.2";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "V07", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.5", levels: Levels::MUST, run: Run::Any(start_values),
        requirement: "A start value in the description equals the value in the binary.",
        tried: "Reads every variable with a start value in Initialization Mode, in each interface, and in FMI 3.0 from a new instance (should), and \
            compares.",
        fix: "Generate both from one table." },
    Check { id: "V06b", clause: "3.0.2, 2.2.7.3", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Probe(ranges),
        requirement: "Integer and enumeration outputs always lie between min and max.",
        tried: "Reads integer outputs with limits over 50 steps.", fix: "Saturate the output, or correct min and max." },
    Check { id: "G01a", clause: GET, levels: Levels::HARD, run: Run::Any(zero_variables),
        requirement: "Getting and setting zero variables succeeds, even with NULL pointers.",
        tried: "Gets and sets no variables, with NULL arrays.", fix: "Return OK before looking at the arrays." },
    Check { id: "G01b", clause: "3.0.2, 2.2.1", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Any(null_arrays),
        requirement: "A NULL array gives Error, and so does a NULL text.",
        tried: "Gets and sets one variable with NULL arrays, and sets a text to NULL.", fix: "Check the pointers if the number is above 0." },
    Check { id: "G01c", clause: "3.0.2, 2.2.4", levels: Levels(None, Some(Level::Should)), run: Run::Any(wrong_counts),
        requirement: "A wrong number of values gives Error, and the FMU writes nothing past the values.",
        tried: "Passes too few and too many values.", fix: "Compare nValues with the sizes of the variables before copying." },
    Check { id: "G02", clause: "2.0.5, 2.1.2; 3.0.2, 2.2.4", levels: Levels::MUST, run: Run::Any(unknown_reference),
        requirement: "A value reference that does not exist gives Error.",
        tried: "Gets and sets a reference that no variable has.", fix: "Return Error in the default branch, also of setters." },
    Check { id: "V12", clause: "2.0.5, 2.1.2; 3.0.2, 2.2.4", levels: Levels::MUST, run: Run::Any(wrong_type),
        requirement: "A getter or setter for another type than that of the variable gives Error.",
        tried: "Gets and sets variables with the functions of another type.", fix: "Look references up by type." },
    Check { id: "G03a", clause: "2.0.5, 2.1.2; 3.0.2, 2.2.4", levels: Levels::MUST, run: Run::Any(constants),
        requirement: "Setting a constant gives Error.",
        tried: "Sets a constant.", fix: "Return Error for variables with variability constant." },
    Check { id: "G03b", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.4", levels: Levels::SHOULD, run: Run::Probe(not_settable),
        requirement: "Setting a variable that cannot be set (output, time, fixed parameter after initialization) gives Error and changes nothing.",
        tried: "Sets an output, the time and a fixed parameter between steps, and reads back; sets a calculated output in the initialization.",
        fix: "Compare causality, variability and state before assigning, and return Error." },
    Check { id: "G03c", clause: "hardening", levels: Levels::HARD, run: Run::Probe(all_or_nothing),
        requirement: "A set call for several variables that fails changes none of them.",
        tried: "Sets an input together with a reference that does not exist.", fix: "Check all references before assigning any." },
    Check { id: "G04", clause: GET, levels: Levels::MUST, run: Run::Any(round_trip),
        requirement: "A parameter or input that is set before the end of initialization reads back unchanged.",
        tried: "Sets every numeric parameter and input in Initialization Mode, and in another run before it; reads them in that mode.",
        fix: "Store the value unchanged." },
    Check { id: "G05", clause: GET, levels: Levels::MUST, run: Run::Any(strings),
        requirement: "A string that is set reads back unchanged, at any length, after the importer has overwritten its own copy.",
        tried: "Sets strings of up to 1 MiB, and several strings in one call, overwrites them, and reads them back.",
        fix: "Allocate memory for the length of each string, and copy it there." },
    Check { id: "G05b", clause: "3.0.2, 2.2.7.2", levels: Levels(None, Some(Level::Must)), run: Run::Any(binaries),
        requirement: "Bytes that are set, from none to maxSize, read back unchanged after the importer has overwritten its own copy.",
        tried: "Sets bytes, overwrites them, and reads them back.", fix: "Copy the bytes with their size." },
    Check { id: "G05m", clause: "hardening", levels: Levels(None, Some(Level::Hard)), run: Run::Any(too_many_bytes),
        requirement: "More bytes than maxSize are refused.",
        tried: "Sets one byte more.", fix: "Compare the size with maxSize before copying." },
    Check { id: "G06", clause: "2.0.5, 4.2.4; 3.0.2, 4.2.1", levels: Levels::MUST, run: Run::Probe(tunable),
        requirement: "A tunable parameter can be set between steps and keeps the value that was set (hard: the next steps succeed).",
        tried: "Sets each tunable parameter between steps, makes two steps, and reads it.", fix: "Accept variability tunable in step mode." },
    Check { id: "L11", clause: "2.0.5, 4.2.4; 3.0.2, 2.3.3", levels: Levels::MUST, run: Run::Probe(iterated_initialization),
        requirement: "Initialization can be iterated: values set and read on the way do not affect the result.",
        tried: "Sets values once in one instance, sets other values and reads outputs first in another, and compares.",
        fix: "Compute outputs from the current values when they are read, without changing the state." },
    Check { id: "G09", clause: "2.0.5, 4.2.4; 3.0.2, 2.4.7.5", levels: Levels::MUST, run: Run::Any(stand),
        requirement: "The start value of an output or a local variable with initial=exact can be set, is kept during the initialization, and is \
            restored by Reset.",
        tried: "Sets each after the instantiation, in each interface, reads it in Initialization Mode and at its end, and after Reset.",
        fix: "Do not overwrite the variable when the initialization computes others, and restore all start values in Reset." },
    Check { id: "G10", clause: GET, levels: Levels::MUST, run: Run::Probe(several),
        requirement: "Several variables read or set in one call have the same values as when each is read or set alone.",
        tried: "Reads up to 12 variables of a type one by one, in one call, and in reverse order; sets parameters and inputs in one call.",
        fix: "Handle the references in the order given." },
    Check { id: "G15", clause: "2.0.5, 4.2.4; 3.0.2, 4.2.1", levels: Levels::MUST, run: Run::Probe(written),
        requirement: "Every variable can be read between steps, and a getter that returns OK has written the value.",
        tried: "Reads all numbers over 20 steps, into memory filled with a pattern.", fix: "Let getters handle all variables, and write every value." },
    Check { id: "G16", clause: "hardening", levels: Levels::HARD, run: Run::Probe(initialized),
        requirement: "Continuous outputs have the same values at the end of Initialization Mode and after it.",
        tried: "Reads continuous outputs before and after ExitInitializationMode.",
        fix: "Compute outputs in Initialization Mode when they are read." },
    Check { id: "G11", clause: "2.0.5, 2.1.2; 3.0.2, 2.2.3", levels: Levels::SHOULD, run: Run::Probe(booleans_read),
        requirement: "A Boolean that is read is 0 or 1.",
        tried: "Reads all Booleans over 20 steps.", fix: "Return the result of a comparison, not a number." },
    Check { id: "G12", clause: "2.0.5, 4.2.1; 3.0.2, 4.2.1", levels: Levels::SHOULD, run: Run::Probe(inputs_keep),
        requirement: "An input keeps the value that was set, within its min and max, until it is set again.",
        tried: "Sets each input near its start value and far from it, makes 3 steps, and reads it after each.",
        fix: "Keep inputs between steps; saturate a copy, and state min and max." },
    Check { id: "G13", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.4", levels: Levels::MUST, run: Run::Probe(parameters_keep),
        requirement: "A parameter changes only if the importer sets it.",
        tried: "Reads all parameters before and after 100 steps.", fix: "Compute with a copy, or make it a local variable." },
    Check { id: "G14", clause: "hardening", levels: Levels::HARD, run: Run::Probe(finite),
        requirement: "Outputs are finite numbers, or a message gives the reason.",
        tried: "Reads floating-point outputs over 20 steps.", fix: "Return Error or log a message if a result is not a finite number." },
    Check { id: "G07a", clause: "hardening", levels: Levels::HARD, run: Run::Probe(not_a_number),
        requirement: "NaN, infinities and huge numbers in an input cause no hang, no crash and no effect on another instance.",
        tried: "Sets NaN, infinities and huge numbers at each input and makes 3 steps.", fix: "Check inputs for finiteness, and bound every loop." },
    Check { id: "G07b", clause: "hardening", levels: Levels::HARD, run: Run::Any(out_of_range),
        requirement: "A parameter outside min and max is refused, at the latest at the end of initialization.",
        tried: "Sets parameters outside min and max.", fix: "Compare with min and max, and refuse at the latest in ExitInitializationMode." },
    Check { id: "G08", clause: "hardening", levels: Levels::HARD, run: Run::Probe(booleans),
        requirement: "A Boolean other than 0 and 1 is tolerated.",
        tried: "Sets Booleans of 2, 255 and all bits.", fix: "Compare with 0." },
];

fn start_values(session: &Session) -> Result<(), NotDetermined> {
    compare_starts(session, &session.initializing()?, true)?;
    if session.description.co_simulation.is_some() && session.exchanges_here() {
        compare_starts(session, &session.exchange(State::Initialization)?, true)?;
    }
    // FMI 3.0.2, 2.3.2: start values can be read in Instantiated, by its table; the calls that it allows do not name it.
    if session.is_v2() { Ok(()) } else { compare_starts(session, &session.fresh()?, false) }
}

/// Compares start values with an instance's values: in Initialization Mode, those that do not change there.
fn compare_starts(session: &Session, instance: &Instance<'_>, initializing: bool) -> Result<(), NotDetermined> {
    let tell = |text: String| if initializing { session.violated(text) } else { session.lesser(Level::Should, text) };
    let mut compared = 0;
    for v in session.numeric().filter(|v| v.start.is_some() && v.clocks.is_empty()) {
        let fixed = !initializing || v.causality == Causality::Input || v.initial_or_default() == Some(Initial::Exact);
        let Some(expected) = expected(v, session.elements(v)).filter(|_| fixed) else { continue };
        let (status, found) = instance.get(v)?;
        compared += 1;
        if !status.is_ok() {
            // FMI 2.0 names the variables that can be read here: L07 looks at them.
            if !(session.is_v2() && initializing) {
                tell(format!("line {}: Get({}) returned {status}", v.line, v.name));
            }
            return Ok(());
        }
        if !same(v, session.description.version, &expected, &found) {
            let (start, found_text) =
                (v.start.as_deref().unwrap_or_default(), show(v, session.description.version, &found));
            let text = format!("line {}: {}: start={start:?}, but the binary has {found_text}", v.line, v.name);
            let level = (!initializing).then_some(Level::Should);
            session.value_deviates_at(level, v, &expected, found, &text);
        }
    }
    let fits = |v: &&ModelVariable| v.base == BaseType::String && !v.is_array() && v.start.is_some();
    for v in session.description.variables.iter().filter(fits) {
        session.record_call(&format!("GetString({})", v.name));
        let Some((status, found)) = session.raw.get_strings(instance.handle, &[v.value_reference], 1) else { continue };
        compared += 1;
        if !status.is_ok() || found.first().is_none_or(|f| f.as_deref() != v.start.as_deref()) {
            let found = found.first().map_or_else(String::new, |text| format!(", {}", or_null(text)));
            let start = attribute(v.start.as_deref());
            tell(format!("line {}: {}: start={start}, but the binary returned {status}{found}", v.line, v.name));
        }
    }
    session.note(format!("compared {compared} start values"));
    Ok(())
}

fn ranges(session: &Session) -> Result<(), NotDetermined> {
    let discrete = |v: &&ModelVariable| {
        matches!(v.causality, Causality::Output | Causality::Local)
            && !v.base.is_float()
            && v.base != BaseType::Boolean
            && v.clocks.is_empty()
    };
    let limited: Vec<_> = session.numeric().filter(discrete).filter(|v| v.min.is_some() || v.max.is_some()).collect();
    if limited.is_empty() {
        return session.not_applicable("there is no integer output with min or max");
    }
    let instance = session.stepping()?;
    for k in 0..50 {
        for v in &limited {
            let (got, found) = instance.get(v)?;
            if !got.is_ok() {
                return Err(NotDetermined(format!("Get({}) returned {got}", v.name)));
            }
            let text = show(v, session.description.version, &found);
            let outside = |x: f64| v.min.is_some_and(|min| x < min) || v.max.is_some_and(|max| x > max);
            if text.split(' ').filter_map(|t| t.parse().ok()).any(outside) {
                let [min, max] = [v.min, v.max].map(|x| x.map_or_else(|| "no limit".into(), |x| x.to_string()));
                session.violated(format!(
                    "line {}: {} is {text} after {k} steps (min: {min}, max: {max})",
                    v.line, v.name
                ));
                return Ok(());
            }
        }
        instance.change_inputs(k)?;
        instance.steps(1, session.h())?;
    }
    Ok(())
}

/// The types that the standard has getters and setters for, with values that are numbers.
fn plain_types(version: FmiVersion) -> Vec<BaseType> {
    let v2 = [BaseType::Float64, BaseType::Int32, BaseType::Boolean];
    let excluded = [BaseType::String, BaseType::Binary, BaseType::Clock, BaseType::Enumeration];
    let all = || BaseType::ALL.iter().copied().filter(|b| !excluded.contains(b)).collect();
    if version == FmiVersion::V2 { v2.to_vec() } else { all() }
}

const WAYS: [&str; 2] = ["Get", "Set"];

/// Gets or sets, depending on `way`, with arrays that may be NULL, each with its count.
fn pass(
    instance: &Instance<'_>,
    way: &str,
    call: &str,
    base: BaseType,
    (list, n): (Option<&[u32]>, usize),
    (values, n_values): (Option<&mut Buffer>, usize),
) -> Result<Status, NotDetermined> {
    instance.call(call, |raw| match way {
        "Set" => raw.set(instance.handle, base, list, n, values, n_values),
        _ => raw.get(instance.handle, base, list, n, values, n_values),
    })
}

fn zero_variables(session: &Session) -> Result<(), NotDetermined> {
    session.cases(plain_types(session.description.version), |base| {
        let instance = session.stepping()?;
        for way in WAYS {
            let call = format!("{way}({base}, NULL, 0, NULL, 0)");
            let status = pass(&instance, way, &call, base, (None, 0), (None, 0))?;
            session.require(status.is_ok(), || format!("{way}{base} of zero variables returned {status}"));
        }
        Ok(())
    })
}

fn null_arrays(session: &Session) -> Result<(), NotDetermined> {
    session.cases([(false, "Get"), (false, "Set"), (true, "Get"), (true, "Set")], |(references, way)| {
        let instance = session.stepping()?;
        let Some(v) = subject(session, way) else { return Ok(()) };
        let mut buffer = Buffer::of(v.base, session.description.version, &[bits(v.base, 0.0)]);
        let (list, place) = (references.then_some(v.value_reference), (!references).then_some(&mut buffer));
        let names = if references { "vr, 1, NULL" } else { "NULL, 1, values" };
        let call = format!("{way}({}, {names}, 1)", v.base);
        let status = pass(&instance, way, &call, v.base, (list.as_ref().map(slice::from_ref), 1), (place, 1))?;
        session.require(status == Status::ERROR, || format!("{call} returned {status}"));
        Ok(())
    })?;
    let text = |v: &&ModelVariable| v.base == BaseType::String && settable(v) && !v.is_array();
    let Some(v) = session.description.variables.iter().find(text) else { return Ok(()) };
    session.case(|| {
        let (instance, call) = (session.initializing()?, format!("SetString({}, NULL)", v.name));
        let status = instance.call(&call, |raw| raw.set_strings(instance.handle, &[v.value_reference], &[None]))?;
        session.require(status == Status::ERROR, || format!("{call} returned {status}"));
        Ok(())
    });
    Ok(())
}

fn wrong_counts(session: &Session) -> Result<(), NotDetermined> {
    session.cases([(0, "Get"), (2, "Get"), (0, "Set"), (2, "Set")], |(n, way)| {
        let instance = session.stepping()?;
        let Some(v) = subject(session, way) else { return Ok(()) };
        let mut buffer = Buffer::of(v.base, session.description.version, &vec![bits(v.base, 0.0); n]);
        let call = format!("{way}({}, nValueReferences=1, nValues={n})", v.name);
        let list = (Some(&[v.value_reference][..]), 1);
        let status = pass(&instance, way, &call, v.base, list, (Some(&mut buffer), n))?;
        session.require(status == Status::ERROR, || format!("{call} returned {status}"));
        session.require(buffer.intact(), || format!("{call} wrote past the {n} values"));
        Ok(())
    })
}

/// A scalar to get, an output, or to set, an input.
fn subject<'b>(session: &'b Session, way: &str) -> Option<&'b ModelVariable> {
    let wanted = if way == "Set" { Causality::Input } else { Causality::Output };
    let fits = |v: &&ModelVariable| v.causality == wanted && v.base.is_float() && !v.is_array() && v.clocks.is_empty();
    session.numeric().find(fits)
}

/// A reference that no variable has.
fn free_reference(session: &Session) -> u32 {
    let used: Vec<u32> = session.description.variables.iter().map(|v| v.value_reference).collect();
    // An FMU may number the elements of its arrays internally: choose a reference far above all of them.
    (0..1_000_000).map(|k| 0x0fff_fff0_u32 - k).find(|r| !used.contains(r)).unwrap_or(u32::MAX)
}

fn unknown_reference(session: &Session) -> Result<(), NotDetermined> {
    for reference in [free_reference(session), u32::MAX] {
        if session.description.variables.iter().any(|v| v.value_reference == reference) {
            continue;
        }
        for base in plain_types(session.description.version) {
            for way in WAYS {
                session.case(|| must_be_refused(session, way, base, reference, "a reference that does not exist"));
            }
        }
        for way in WAYS {
            session.case(|| text_must_be_refused(session, way, reference, "a reference that does not exist"));
        }
    }
    Ok(())
}

/// [`must_be_refused`] for texts.
fn text_must_be_refused(session: &Session, way: &str, reference: u32, what: &str) -> Result<(), NotDetermined> {
    let instance = session.stepping()?;
    let call = format!("{way}String(reference={reference})");
    let status = instance.call(&call, |raw| match way {
        "Set" => raw.set_strings(instance.handle, &[reference], &[Some(c"text")]),
        _ => raw.get_strings(instance.handle, &[reference], 1).map(|(status, _)| status),
    })?;
    refused(session, status, &format!("{call}, {what}, returned {status}"));
    Ok(())
}

/// Requires an Error; a Fatal status, which ends all instances, is a lesser violation.
fn refused(session: &Session, status: Status, text: &str) {
    if status == Status::FATAL {
        session.lesser(Level::Should, text);
    } else {
        session.require(status == Status::ERROR, || text.into());
    }
}

/// A getter or setter that must return Error.
fn must_be_refused(
    session: &Session,
    way: &str,
    base: BaseType,
    reference: u32,
    what: &str,
) -> Result<(), NotDetermined> {
    let instance = session.stepping()?;
    let mut buffer = Buffer::of(base, session.description.version, &[bits(base, 0.0)]);
    let call = format!("{way}({base}, reference={reference})");
    let status = pass(&instance, way, &call, base, (Some(&[reference]), 1), (Some(&mut buffer), 1))?;
    refused(session, status, &format!("{call}, {what}, returned {status}"));
    Ok(())
}

fn wrong_type(session: &Session) -> Result<(), NotDetermined> {
    let carries = |base| fmu_import::raw::type_name(base, session.description.version);
    for base in plain_types(session.description.version) {
        // In FMI 2.0 each type has its own value references, so the reference must not exist for this type.
        let taken = |r: u32| {
            session.description.variables.iter().any(|v| v.value_reference == r && carries(v.base) == carries(base))
        };
        let other = session
            .description
            .variables
            .iter()
            .find(|v| carries(v.base) != carries(base) && !v.is_array() && !taken(v.value_reference));
        let Some(v) = other else { continue };
        let what = format!("{} of the type {}", v.name, v.base);
        for way in WAYS {
            session.case(|| must_be_refused(session, way, base, v.value_reference, &what));
        }
    }
    let all = &session.description.variables;
    let is_text = |r: u32| all.iter().any(|v| v.base == BaseType::String && v.value_reference == r);
    let fits = |v: &&ModelVariable| v.base.is_float() && !v.is_array() && !is_text(v.value_reference);
    if let Some(v) = all.iter().find(fits) {
        let what = format!("{} of the type {}", v.name, v.base);
        for way in WAYS {
            session.case(|| text_must_be_refused(session, way, v.value_reference, &what));
        }
    }
    Ok(())
}

fn constants(session: &Session) -> Result<(), NotDetermined> {
    let constant = |v: &&ModelVariable| v.variability == Variability::Constant && !v.is_array();
    let Some(v) = session.numeric().find(constant) else { return session.not_applicable("there are no constants") };
    let instance = session.fresh()?;
    let values = session.different_value(v, 1.0).unwrap_or_else(|| vec![0]);
    let status = instance.set(v, &values)?;
    session.require(status == Status::ERROR, || format!("Set({}) of a constant returned {status}", v.name));
    Ok(())
}

fn not_settable(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| {
        !v.is_array()
            && v.clocks.is_empty()
            && match v.causality {
                Causality::Output | Causality::CalculatedParameter | Causality::Independent => {
                    v.variability != Variability::Constant
                }
                Causality::Parameter => v.variability == Variability::Fixed,
                _ => false,
            }
    };
    let mut seen = Vec::new();
    for v in session.numeric().filter(fits) {
        // One of each kind.
        if seen.contains(&(v.causality, v.base)) {
            continue;
        }
        seen.push((v.causality, v.base));
        session.case(|| {
            let instance = session.stepping()?;
            instance.steps(2, session.h())?;
            let ((got, before), Some(values)) = (instance.get(v)?, session.different_value(v, 7.0)) else {
                return Ok(());
            };
            if !got.is_ok() {
                return Err(NotDetermined(format!("Get({}) returned {got}", v.name)));
            }
            let status = instance.set(v, &values)?;
            session.require(status == Status::ERROR, || {
                format!("Set({}), {} {}, in step mode returned {status}", v.name, v.variability, v.causality)
            });
            let (status, after) = instance.get(v)?;
            session.require(!status.is_ok() || before == after || !session.is_steady(v), || {
                let [old, new] = [&before, &after].map(|bits| show(v, session.description.version, bits));
                format!("Set({}) in step mode changed the value from {old} to {new}", v.name)
            });
            Ok(())
        });
        // A calculated variable cannot be set before, either.
        if v.initial_or_default() == Some(Initial::Calculated) {
            session.case(|| {
                let (instance, values) = (session.initializing()?, session.different_value(v, 7.0));
                let Some(values) = values else { return Ok(()) };
                let status = instance.set(v, &values)?;
                session.require(status == Status::ERROR, || {
                    format!("Set({}), initial=calculated, in Initialization Mode returned {status}", v.name)
                });
                Ok(())
            });
        }
    }
    Ok(())
}

fn all_or_nothing(session: &Session) -> Result<(), NotDetermined> {
    let inputs = session.float_inputs();
    let Some(v) = inputs.iter().find(|v| !v.is_array() && v.base == BaseType::Float64) else {
        return session.not_applicable("there is no scalar Float64 input");
    };
    let Some(values) = session.different_value(v, 3.0) else { return Ok(()) };
    let instance = session.stepping()?;
    let (got, before) = instance.get(v)?;
    if !got.is_ok() {
        return Err(NotDetermined(format!("Get({}) returned {got}", v.name)));
    }
    let mut buffer = Buffer::of(v.base, session.description.version, &[values[0], 0]);
    let list = [v.value_reference, free_reference(session)];
    let call = format!("Set({}, and a reference that does not exist)", v.name);
    let status = pass(&instance, "Set", &call, v.base, (Some(&list), 2), (Some(&mut buffer), 2))?;
    if status.is_ok() {
        return Err(NotDetermined("the FMU does not refuse a reference that does not exist".into()));
    }
    let (status, after) = instance.get(v)?;
    session.require(!status.is_ok() || before == after, || {
        let [old, new] = [&before, &after].map(|bits| show(v, session.description.version, bits));
        format!("a set call that returned Error changed {} from {old} to {new}", v.name)
    });
    Ok(())
}
