//! Getting and setting (FMI 2.0.5, 2.1.7; FMI 3.0.2, 2.2.6): what is refused, and what is there to begin with.

use super::bench::{Bench, Blocked, bits, fine, show};
use super::values::{booleans, not_a_number, order, out_of_range, round_trip, strings, tunable};
use super::{Check, Level, Levels, Run};
use fmu_import::Status;
use fmu_import::raw::Buffer;
use model_description::{BaseType, Causality, FmiVersion, Initial, ModelVariable, Variability, parse_number};

const GET: &str = "2.0.5, 2.1.7; 3.0.2, 2.2.6.2";

#[rustfmt::skip]
pub(super) const CHECKS: &[Check] = &[
    Check { id: "V07", requirement: "A start value in the description is the one in the binary.", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7", levels: Levels::MUST, run: Run::Probe(starts) },
    Check { id: "V06b", requirement: "Integer and enumeration outputs are within min and max whenever they are read.", clause: "3.0.2, 2.2.6.3", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Probe(ranges) },
    Check { id: "G01a", requirement: "Getting and setting no variable succeeds, with pointers that are NULL.", clause: GET, levels: Levels::HARD, run: Run::Probe(nothing) },
    Check { id: "G01b", requirement: "An array that is NULL gives Error.", clause: "3.0.2, 2.2.1", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Probe(null) },
    Check { id: "G01c", requirement: "A number of values that does not fit gives Error, and nothing is written behind them.", clause: GET, levels: Levels(None, Some(Level::Must)), run: Run::Probe(counts) },
    Check { id: "G02", requirement: "A value reference that does not exist gives Error.", clause: "3.0.2, 2.2.3", levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Probe(unknown) },
    Check { id: "V12", requirement: "A getter or setter of another type than the variable's gives Error.", clause: "3.0.2, 2.2.6.2", levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Probe(types) },
    Check { id: "G03a", requirement: "Setting a constant gives Error.", clause: "2.0.5, 2.1.3; 3.0.2, 2.2.3", levels: Levels::MUST, run: Run::Probe(constants) },
    Check { id: "G03b", requirement: "Setting what cannot be set (outputs, time, fixed parameters after initialisation) gives Error and changes nothing.", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.4", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Probe(closed) },
    Check { id: "G03c", requirement: "A set of several variables that fails changes none of them.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(atomic) },
    Check { id: "G04", requirement: "What is set before the end of initialisation is got back bit for bit.", clause: GET, levels: Levels::MUST, run: Run::Probe(round_trip) },
    Check { id: "G05", requirement: "Texts are copied when set: the importer may overwrite its own.", clause: GET, levels: Levels::MUST, run: Run::Probe(strings) },
    Check { id: "G06", requirement: "A tunable parameter can be set between steps and keeps what was set.", clause: "2.0.5, 2.2.7 and 4.2.4; 3.0.2, 2.4.7.4 and 4.2.1", levels: Levels::MUST, run: Run::Probe(tunable) },
    Check { id: "L11", requirement: "Initialisation can be iterated: values that were set and got in between leave no trace.", clause: "2.0.5, 4.2.4; 3.0.2, 2.3.4", levels: Levels::MUST, run: Run::Probe(order) },
    Check { id: "G07a", requirement: "NaN, infinities and huge numbers in an input neither hang nor crash, nor disturb another instance.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(not_a_number) },
    Check { id: "G07b", requirement: "A parameter outside of min and max is refused, at the latest at the end of initialisation.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(out_of_range) },
    Check { id: "G08", requirement: "A Boolean other than 0 and 1 does no harm.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(booleans) },
];

/// The start values of a variable as bits; `None` for a form that is none of the type.
fn expected(v: &ModelVariable, n: usize) -> Option<Vec<u64>> {
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

/// Equal as values of the type: the low bits, and zeros of both signs.
pub(super) fn same(v: &ModelVariable, version: FmiVersion, a: &[u64], b: &[u64]) -> bool {
    let shift = 64 - 8 * fmu_import::raw::width(v.base, version);
    let zero = |x: u64| v.base.is_float() && x << (64 - (64 - shift) + 1) == 0;
    a.len() == b.len() && a.iter().zip(b).all(|(x, y)| x << shift == y << shift || (zero(*x) && zero(*y)))
}

fn starts(bench: &Bench) -> Result<(), Blocked> {
    let v2 = bench.md.version == FmiVersion::V2;
    let it = if v2 { bench.initialising()? } else { bench.fresh()? };
    let mut compared = 0;
    for v in bench.numeric().filter(|v| v.start.is_some() && v.clocks.is_empty()) {
        let fixed = !v2 || v.causality == Causality::Input || v.initial_or_default() == Some(Initial::Exact);
        let Some(expected) = expected(v, bench.elements(v)).filter(|_| fixed) else { continue };
        let (status, found) = it.get(v)?;
        compared += 1;
        bench.require(fine(status), || format!("line {}: Get({}) returned {status}", v.line, v.name));
        bench.require(!fine(status) || same(v, bench.md.version, &expected, &found), || {
            format!(
                "line {}: {}: start={:?}, the binary has {}",
                v.line,
                v.name,
                v.start.as_deref().unwrap_or_default(),
                show(v, bench.md.version, &found)
            )
        });
    }
    let fits = |v: &&ModelVariable| v.base == BaseType::String && !v.is_array() && v.start.is_some();
    for v in bench.md.variables.iter().filter(fits) {
        bench.calling(&format!("GetString({})", v.name));
        let Some((status, found)) = bench.raw.get_strings(it.handle, &[v.value_reference], 1) else { continue };
        compared += 1;
        let good = fine(status) && found.first().is_some_and(|f| f.as_deref() == v.start.as_deref());
        bench.require(good, || {
            format!("line {}: {}: start={:?}, the binary gave {status}, {found:?}", v.line, v.name, v.start)
        });
    }
    bench.note(format!("{compared} start values are equal"));
    Ok(())
}

fn ranges(bench: &Bench) -> Result<(), Blocked> {
    let discrete = |v: &&ModelVariable| {
        matches!(v.causality, Causality::Output | Causality::Local)
            && !v.base.is_float()
            && v.base != BaseType::Boolean
            && v.clocks.is_empty()
    };
    let limited: Vec<_> = bench.numeric().filter(discrete).filter(|v| v.min.is_some() || v.max.is_some()).collect();
    if limited.is_empty() {
        return bench.not_applicable("there is no integer output with min or max");
    }
    let it = bench.stepping()?;
    for k in 0..50 {
        for v in &limited {
            let (_, found) = it.get(v)?;
            let text = show(v, bench.md.version, &found);
            let outside = |x: f64| v.min.is_some_and(|min| x < min) || v.max.is_some_and(|max| x > max);
            if text.split(' ').filter_map(|t| t.parse().ok()).any(outside) {
                bench.violated(format!("line {}: {} is {text} after {k} steps", v.line, v.name));
                return Ok(());
            }
        }
        it.excite(k)?;
        it.steps(1, bench.h())?;
    }
    Ok(())
}

/// The types that the standard has getters and setters for, with values that are numbers.
fn plain_types(version: FmiVersion) -> Vec<BaseType> {
    let v2 = [BaseType::Float64, BaseType::Int32, BaseType::Boolean];
    let no = [BaseType::String, BaseType::Binary, BaseType::Clock, BaseType::Enumeration];
    let all = || BaseType::ALL.iter().copied().filter(|b| !no.contains(b)).collect();
    if version == FmiVersion::V2 { v2.to_vec() } else { all() }
}

fn nothing(bench: &Bench) -> Result<(), Blocked> {
    for base in plain_types(bench.md.version) {
        bench.case(|| {
            let it = bench.stepping()?;
            for set in [false, true] {
                let (kind, none) = (if set { "Set" } else { "Get" }, Option::<&mut Buffer>::None);
                let status = it.call(&format!("{kind}({base}, NULL, 0, NULL, 0)"), |raw| {
                    if set {
                        raw.set(it.handle, base, None, 0, none, 0)
                    } else {
                        raw.get(it.handle, base, None, 0, none, 0)
                    }
                })?;
                bench.require(fine(status), || format!("{kind}{base} of no variable returned {status}"));
            }
            Ok(())
        });
    }
    Ok(())
}

fn null(bench: &Bench) -> Result<(), Blocked> {
    for (references, values) in [(false, true), (true, false)] {
        for set in [false, true] {
            bench.case(|| {
                let it = bench.stepping()?;
                let wanted = if set { Causality::Input } else { Causality::Output };
                let Some(v) = bench.numeric().find(|v| v.causality == wanted && v.base.is_float() && !v.is_array())
                else {
                    return Ok(());
                };
                let mut buffer = Buffer::of(v.base, bench.md.version, &[bits(v.base, 0.0)]);
                let list = [v.value_reference];
                let (list, place) = (references.then_some(&list[..]), values.then_some(&mut buffer));
                let call = format!(
                    "{}({}, {}, 1, {}, 1)",
                    if set { "Set" } else { "Get" },
                    v.base,
                    if references { "vr" } else { "NULL" },
                    if values { "values" } else { "NULL" }
                );
                let status = it.call(&call, |raw| {
                    if set {
                        raw.set(it.handle, v.base, list, 1, place, 1)
                    } else {
                        raw.get(it.handle, v.base, list, 1, place, 1)
                    }
                })?;
                bench.require(status == Status::ERROR, || format!("{call} returned {status}"));
                Ok(())
            });
        }
    }
    Ok(())
}

fn counts(bench: &Bench) -> Result<(), Blocked> {
    for (n, set) in [(0, false), (2, false), (0, true), (2, true)] {
        bench.case(|| {
            let it = bench.stepping()?;
            let wanted = if set { Causality::Input } else { Causality::Output };
            let Some(v) = bench
                .numeric()
                .find(|v| v.causality == wanted && v.base.is_float() && !v.is_array() && v.clocks.is_empty())
            else {
                return Ok(());
            };
            let mut buffer = Buffer::of(v.base, bench.md.version, &vec![bits(v.base, 0.0); n]);
            let list = [v.value_reference];
            let call = format!("{}({}, nValueReferences=1, nValues={n})", if set { "Set" } else { "Get" }, v.name);
            let status = it.call(&call, |raw| {
                let place = Some(&mut buffer);
                if set {
                    raw.set(it.handle, v.base, Some(&list), 1, place, n)
                } else {
                    raw.get(it.handle, v.base, Some(&list), 1, place, n)
                }
            })?;
            bench.require(status == Status::ERROR, || format!("{call} returned {status}"));
            bench.require(buffer.intact(), || format!("{call} wrote behind the {n} values"));
            Ok(())
        });
    }
    Ok(())
}

/// A reference that no variable has.
fn free_reference(bench: &Bench) -> u32 {
    let used: Vec<u32> = bench.md.variables.iter().map(|v| v.value_reference).collect();
    // Elements of arrays may count as references inside; so far behind all of them.
    (0..1_000_000).map(|k| 0x0fff_fff0_u32 - k).find(|r| !used.contains(r)).unwrap_or(u32::MAX)
}

fn unknown(bench: &Bench) -> Result<(), Blocked> {
    for reference in [free_reference(bench), u32::MAX] {
        if bench.md.variables.iter().any(|v| v.value_reference == reference) {
            continue;
        }
        for base in plain_types(bench.md.version) {
            for set in [false, true] {
                bench.case(|| refuse(bench, base, reference, set, "a reference that does not exist"));
            }
        }
    }
    Ok(())
}

/// A getter or setter that must return Error.
fn refuse(bench: &Bench, base: BaseType, reference: u32, set: bool, what: &str) -> Result<(), Blocked> {
    let it = bench.stepping()?;
    let mut buffer = Buffer::of(base, bench.md.version, &[bits(base, 0.0)]);
    let call = format!("{}({base}, reference={reference})", if set { "Set" } else { "Get" });
    let status = it.call(&call, |raw| {
        let place = Some(&mut buffer);
        if set {
            raw.set(it.handle, base, Some(&[reference]), 1, place, 1)
        } else {
            raw.get(it.handle, base, Some(&[reference]), 1, place, 1)
        }
    })?;
    bench.require(status == Status::ERROR, || format!("{call}, {what}, returned {status}"));
    Ok(())
}

fn types(bench: &Bench) -> Result<(), Blocked> {
    let carries = |base| fmu_import::raw::type_name(base, bench.md.version);
    for base in plain_types(bench.md.version) {
        // FMI 2.0 numbers each type for itself, so the reference must be none of this type.
        let taken =
            |r: u32| bench.md.variables.iter().any(|v| v.value_reference == r && carries(v.base) == carries(base));
        let other = bench
            .md
            .variables
            .iter()
            .find(|v| carries(v.base) != carries(base) && !v.is_array() && !taken(v.value_reference));
        let Some(v) = other else { continue };
        for set in [false, true] {
            bench.case(|| refuse(bench, base, v.value_reference, set, &format!("{} of the type {}", v.name, v.base)));
        }
    }
    Ok(())
}

fn constants(bench: &Bench) -> Result<(), Blocked> {
    let constant = |v: &&ModelVariable| v.variability == Variability::Constant && !v.is_array();
    let Some(v) = bench.numeric().find(constant) else { return bench.not_applicable("there are no constants") };
    let it = bench.fresh()?;
    let values = bench.other_value(v, 1.0).unwrap_or_else(|| vec![0]);
    let status = it.set(v, &values)?;
    bench.require(status == Status::ERROR, || format!("Set({}), a constant, returned {status}", v.name));
    Ok(())
}

fn closed(bench: &Bench) -> Result<(), Blocked> {
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
    for v in bench.numeric().filter(fits) {
        // One of each kind.
        if seen.contains(&(v.causality, v.base)) {
            continue;
        }
        seen.push((v.causality, v.base));
        bench.case(|| {
            let it = bench.stepping()?;
            it.steps(2, bench.h())?;
            let (before, Some(values)) = (it.get(v)?.1, bench.other_value(v, 7.0)) else { return Ok(()) };
            let status = it.set(v, &values)?;
            bench.require(status == Status::ERROR, || {
                format!("Set({}), {} {}, in step mode returned {status}", v.name, v.variability, v.causality)
            });
            let (status, after) = it.get(v)?;
            bench.require(!fine(status) || before == after, || format!("Set({}) in step mode changed it", v.name));
            Ok(())
        });
    }
    Ok(())
}

fn atomic(bench: &Bench) -> Result<(), Blocked> {
    let inputs = bench.float_inputs();
    let Some(v) = inputs.iter().find(|v| !v.is_array() && v.base == BaseType::Float64) else {
        return bench.not_applicable("there is no scalar Float64 input");
    };
    let Some(values) = bench.other_value(v, 3.0) else { return Ok(()) };
    let it = bench.stepping()?;
    let before = it.get(v)?.1;
    let mut buffer = Buffer::of(v.base, bench.md.version, &[values[0], 0]);
    let list = [v.value_reference, free_reference(bench)];
    let status = it.call(&format!("Set({}, and a reference that does not exist)", v.name), |raw| {
        raw.set(it.handle, v.base, Some(&list), 2, Some(&mut buffer), 2)
    })?;
    if fine(status) {
        return Err(Blocked("a reference that does not exist is not refused".into()));
    }
    let (status, after) = it.get(v)?;
    bench.require(!fine(status) || before == after, || format!("{} was changed by a set that returned Error", v.name));
    Ok(())
}
