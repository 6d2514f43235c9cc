//! Values that are set: that they come back, take effect, and do no harm when they make no sense.

use super::access::same;
use super::bench::{Bench, Blocked, bits, fine, settable, show};
use super::lifecycle::difference;
use fmu_import::Status;
use fmu_import::raw::Simple;
use model_description::{BaseType, Causality, ModelVariable, Variability};
use std::ffi::CString;

pub(super) fn round_trip(bench: &Bench) -> Result<(), Blocked> {
    let it = bench.initialising()?;
    for v in bench.numeric().filter(|v| settable(v)) {
        let Some(values) = bench.other_value(v, 1.0) else { continue };
        let status = it.set(v, &values)?;
        if !fine(status) {
            // A value that the model does not like is its good right; what is said of it is a check of its own.
            if status == Status::ERROR {
                return Err(Blocked(format!(
                    "Set({} = {}) returned {status}",
                    v.name,
                    show(v, bench.md.version, &values)
                )));
            }
            continue;
        }
        let (_, back) = it.get(v)?;
        bench.require(same(v, bench.md.version, &values, &back), || {
            format!(
                "{}: set to {}, got {}",
                v.name,
                show(v, bench.md.version, &values),
                show(v, bench.md.version, &back)
            )
        });
    }
    Ok(())
}

pub(super) fn strings(bench: &Bench) -> Result<(), Blocked> {
    let fits = |v: &&ModelVariable| v.base == BaseType::String && settable(v) && !v.is_array();
    let Some(v) = bench.md.variables.iter().find(fits) else { return bench.not_applicable("no text can be set") };
    for text in ["", "probe \u{e4}\u{1f50b}", &"x".repeat(1 << 20)] {
        bench.case(|| {
            let it = bench.initialising()?;
            let c_text = CString::new(text).unwrap_or_default();
            let status = it.call(&format!("SetString({})", v.name), |raw| {
                raw.set_strings(it.handle, &[v.value_reference], &[Some(&c_text)])
            })?;
            if !fine(status) {
                return Err(Blocked(format!("SetString({}) returned {status}", v.name)));
            }
            bench.calling(&format!("GetString({})", v.name));
            let (_, back) = bench
                .raw
                .get_strings(it.handle, &[v.value_reference], 1)
                .ok_or_else(|| Blocked("GetString is missing".into()))?;
            bench.require(back.first().is_some_and(|b| b.as_deref() == Some(text)), || {
                format!("{}: a text of {} bytes did not come back", v.name, text.len())
            });
            Ok(())
        });
    }
    Ok(())
}

pub(super) fn not_a_number(bench: &Bench) -> Result<(), Blocked> {
    let inputs = bench.float_inputs();
    if inputs.is_empty() {
        return bench.not_applicable("there is no floating-point input");
    }
    let alone = bench.stepping()?.run(5, bench.h())?;
    for v in &inputs {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308, -1e308, 5e-324, -0.0] {
            if bench.late() {
                bench.note("not all inputs were tried");
                return Ok(());
            }
            bench.case(|| {
                let (it, other) = (bench.stepping()?, bench.stepping()?);
                let _ = it.set(v, &vec![bits(v.base, x); bench.elements(v)])?;
                for _ in 0..3 {
                    let _ = it.call(&format!("DoStep with {} = {x}", v.name), |raw| {
                        raw.do_step(it.handle, it.time.get(), bench.h(), false, [true; 4]).map(|(s, _)| s)
                    })?;
                    it.time.set(it.time.get() + bench.h());
                }
                let beside = other.run(5, bench.h())?;
                bench.require(beside == alone, || format!("{} = {x} in one instance changed another", v.name));
                Ok(())
            });
        }
    }
    Ok(())
}

pub(super) fn out_of_range(bench: &Bench) -> Result<(), Blocked> {
    let fits = |v: &&ModelVariable| {
        v.causality == Causality::Parameter && settable(v) && v.base.is_float() && (v.min.is_some() || v.max.is_some())
    };
    let limited: Vec<_> = bench.md.variables.iter().filter(fits).take(40).collect();
    if limited.is_empty() {
        return bench.not_applicable("there is no floating-point parameter with min or max");
    }
    for v in limited {
        let below = v.min.map(|x| x - x.abs().max(1.0));
        let above = v.max.map(|x| x + x.abs().max(1.0));
        for x in below.into_iter().chain(above).filter(|x| x.is_finite()) {
            bench.case(|| {
                let it = bench.initialising()?;
                let status = it.set(v, &vec![bits(v.base, x); bench.elements(v)])?;
                let end = if fine(status) { it.simple(Simple::ExitInitializationMode)? } else { status };
                bench.require(!fine(end), || format!("line {}: {} = {x} was accepted", v.line, v.name));
                Ok(())
            });
        }
    }
    Ok(())
}

pub(super) fn booleans(bench: &Bench) -> Result<(), Blocked> {
    let fits = |v: &&ModelVariable| v.base == BaseType::Boolean && settable(v) && !v.is_array();
    let Some(v) = bench.md.variables.iter().find(fits) else { return bench.not_applicable("no Boolean can be set") };
    let width = 8 * fmu_import::raw::width(v.base, bench.md.version);
    for value in [2, 0xff, u64::MAX >> (64 - width)] {
        bench.case(|| {
            let it = bench.initialising()?;
            let status = it.set(v, &[value])?;
            if fine(status) {
                let (_, back) = it.get(v)?;
                bench.require(back[0] <= 1, || format!("{}: set to {value}, got {}", v.name, back[0]));
                let _ = it.simple(Simple::ExitInitializationMode)?;
                let _ = it.step(bench.h())?;
            }
            Ok(())
        });
    }
    Ok(())
}

pub(super) fn tunable(bench: &Bench) -> Result<(), Blocked> {
    let fits = |v: &&ModelVariable| {
        v.causality == Causality::Parameter && v.variability == Variability::Tunable && v.clocks.is_empty()
    };
    let tunable: Vec<_> = bench.numeric().filter(fits).take(40).collect();
    if tunable.is_empty() {
        return bench.not_applicable("there is no tunable parameter");
    }
    for v in tunable {
        bench.case(|| {
            let it = bench.stepping()?;
            it.steps(2, bench.h())?;
            let Some(values) = bench.other_value(v, 1.0) else { return Ok(()) };
            let status = it.set(v, &values)?;
            bench.require(fine(status), || format!("line {}: Set({}) between steps returned {status}", v.line, v.name));
            if !fine(status) {
                return Ok(());
            }
            if let Err(Blocked(why)) = it.steps(2, bench.h()) {
                // The model may have rules that the description cannot tell.
                bench.note(format!("{} = {}: {why}", v.name, show(v, bench.md.version, &values)));
                return Ok(());
            }
            let (_, back) = it.get(v)?;
            bench.require(same(v, bench.md.version, &values, &back), || {
                let (set, got) = (show(v, bench.md.version, &values), show(v, bench.md.version, &back));
                format!("line {}: {}: set to {set}, two steps later it is {got}", v.line, v.name)
            });
            Ok(())
        });
    }
    Ok(())
}

/// One instance gets its values at once, another gets others first, is looked at, and gets them then.
pub(super) fn order(bench: &Bench) -> Result<(), Blocked> {
    let watched = bench.watched();
    let settable: Vec<_> = bench.numeric().filter(|v| settable(v) && v.base.is_float()).collect();
    let (plain, iterated) = (bench.initialising()?, bench.initialising()?);
    for v in settable.iter().take_while(|_| !bench.late()) {
        let (Some(first), Some(last)) = (bench.other_value(v, 3.0), bench.other_value(v, 1.0)) else { continue };
        // What one of them refuses is not what is asked here.
        if fine(iterated.set(v, &first)?) && fine(iterated.set(v, &last)?) {
            let _ = iterated.snapshot(&watched)?;
            let _ = plain.set(v, &last)?;
        } else {
            return Err(Blocked(format!("{} cannot be set", v.name)));
        }
    }
    let alike = plain.snapshot(&watched)? == iterated.snapshot(&watched)?;
    bench.require(alike, || "in initialisation mode the outputs depend on what was set and got before".into());
    match (plain.exit(), iterated.exit()) {
        (Ok(()), Ok(())) => {}
        (Err(Blocked(why)), Err(_)) => {
            bench.note(format!("these values do not fit together: {why}"));
            return Ok(());
        }
        (Err(Blocked(why)), _) | (_, Err(Blocked(why))) => {
            bench.violated(format!("of two instances with the same values one {why}"));
            return Ok(());
        }
    }
    let (a, b) = (plain.run(5, bench.h())?, iterated.run(5, bench.h())?);
    if let Some((step, i)) = difference(&a, &b) {
        bench.violated(format!(
            "{} differs {} steps after an initialisation in which values were set twice",
            watched[i].name,
            step + 1
        ));
    }
    Ok(())
}
