//! Steps and time (FMI 2.0.5, 4.2.2; FMI 3.0.2, 4.2.1).

use super::bench::{Bench, Blocked, fine};
use super::derivatives::output_derivatives;
use super::it::It;
use super::lifecycle::difference;
use super::{Check, Level, Levels, Run};
use fmu_import::Status;
use fmu_import::raw::StepStatus;
use model_description::{BaseType, Causality, CoSimulation};

const STEP: &str = "2.0.5, 4.2.2; 3.0.2, 4.2.1.1";

#[rustfmt::skip]
pub(super) const CHECKS: &[Check] = &[
    Check { id: "T01a", requirement: "Steps succeed from start times of 0, -1, 1000 and 1e6.", clause: STEP, levels: Levels::SHOULD, run: Run::Probe(start_times) },
    Check { id: "T01b", requirement: "A communication point that is not the end of the last step gives Error.", clause: STEP, levels: Levels::HARD, run: Run::Probe(gap) },
    Check { id: "T01c", requirement: "A time that the importer adds up, t = t + h, is accepted for many steps.", clause: STEP, levels: Levels::MUST, run: Run::Probe(accumulated) },
    Check { id: "T02a", requirement: "A step of 0 or less gives Error.", clause: STEP, levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Probe(no_step) },
    Check { id: "T02b", requirement: "A step that is NaN or infinite, or a time that is, gives Error and returns soon.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(odd_step) },
    Check { id: "T03", requirement: "Half of the communication step gives about the same results, inputs held.", clause: STEP, levels: Levels::HARD, run: Run::Probe(halves) },
    Check { id: "T04", requirement: "With canHandleVariableCommunicationStepSize steps of any size succeed.", clause: "2.0.5, 4.3.1; 3.0.2, 4.3", levels: Levels::MUST, run: Run::Probe(variable) },
    Check { id: "T05", requirement: "noSetFMUStatePriorToCurrentPoint changes no result, and the state at the current point can still be saved and set.", clause: "2.0.5, 4.2.2; 3.0.2, 4.2.1.1", levels: Levels::MUST, run: Run::Probe(promise) },
    Check { id: "T06a", requirement: "After OK lastSuccessfulTime is t + h unless the step returned early, and that only when allowed; truth values are 0 or 1.", clause: "3.0.2, 4.2.1.1", levels: Levels(None, Some(Level::Must)), run: Run::Probe(told) },
    Check { id: "T06b", requirement: "The independent variable has the time of the last communication point.", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.4", levels: Levels::SHOULD, run: Run::Probe(independent) },
    Check { id: "T06c", requirement: "Places for results that are NULL do no harm.", clause: "3.0.2, 2.2.1", levels: Levels(None, Some(Level::Hard)), run: Run::Probe(places) },
    Check { id: "T07", requirement: "fmi2GetRealStatus and its sisters return Discard for what is not available, and do no harm.", clause: "2.0.5, 4.2.3", levels: Levels(Some(Level::Should), None), run: Run::Probe(statuses) },
    Check { id: "T09", requirement: "With maxOutputDerivativeOrder above 0 the first derivatives of continuous outputs can be got and are their slopes; order 0, and one above the greatest, give Error.", clause: "2.0.5, 4.2.1; 3.0.2, 4.2.1.1", levels: Levels::MUST, run: Run::Probe(output_derivatives) },
    Check { id: "T10", requirement: "Two runs of one instance after another, with the same inputs, are equal bit for bit.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(determinism) },
    Check { id: "T10p", requirement: "Two processes, with everything at other addresses, give the same results bit for bit.", clause: "hardening", levels: Levels::HARD, run: Run::Twice(two_processes) },
];

fn start_times(bench: &Bench) -> Result<(), Blocked> {
    for start in [0.0, -1.0, 1000.0, 1e6] {
        bench.case(|| {
            let it = bench.fresh()?;
            it.experiment(start, None);
            let life = it.enter().and_then(|()| it.exit()).and_then(|()| it.steps(20, bench.h()));
            if let Err(Blocked(why)) = life {
                bench.violated(format!("startTime={start}: {why}"));
            }
            Ok(())
        });
    }
    Ok(())
}

fn gap(bench: &Bench) -> Result<(), Blocked> {
    for shift in [0.5, -0.5, 2.0] {
        bench.case(|| {
            let (it, h) = (bench.stepping()?, bench.h());
            it.steps(3, h)?;
            let t = it.time.get();
            let status = it.step_at(t + shift * h, h)?;
            bench.require(!fine(status), || {
                format!("the last step ended at {t}, and DoStep(t={}, h={h}) returned {status}", t + shift * h)
            });
            Ok(())
        });
    }
    Ok(())
}

fn accumulated(bench: &Bench) -> Result<(), Blocked> {
    let (it, h) = (bench.stepping()?, bench.h());
    // Beyond its default experiment an FMU may have no data; what happens there is no finding.
    let stop = bench.md.default_experiment.stop.unwrap_or(f64::INFINITY);
    bench.many(&format!("up to 100000 steps of {h}, t = t + h"), || {
        for k in 0..100_000 {
            let inside = it.time.get() + h <= stop;
            let status = it.step(h)?;
            if !fine(status) && inside {
                bench.violated(format!("step {k}, DoStep(t={:?}, h={h:?}), returned {status}", it.time.get()));
                return Ok(());
            }
            if !fine(status) || (k % 100 == 0 && bench.late()) {
                bench.note(format!("{k} steps"));
                return Ok(());
            }
        }
        bench.note("100000 steps");
        Ok(())
    })
}

fn no_step(bench: &Bench) -> Result<(), Blocked> {
    for h in [0.0, -bench.h()] {
        bench.case(|| {
            let it = bench.stepping()?;
            it.steps(2, bench.h())?;
            let status = it.step_at(it.time.get(), h)?;
            bench.require(status == Status::ERROR, || format!("DoStep(t={}, h={h}) returned {status}", it.time.get()));
            Ok(())
        });
    }
    Ok(())
}

fn odd_step(bench: &Bench) -> Result<(), Blocked> {
    let h = bench.h();
    for (t, h) in
        [(None, f64::NAN), (None, f64::INFINITY), (Some(f64::NAN), h), (Some(f64::INFINITY), h), (None, 1e300)]
    {
        bench.case(|| {
            let it = bench.stepping()?;
            it.steps(2, bench.h())?;
            let t = t.unwrap_or(it.time.get());
            let status = it.step_at(t, h)?;
            // A step of 1e300 is a number after all; only a hang counts.
            bench.require(!fine(status) || (1e300..f64::INFINITY).contains(&h), || {
                format!("DoStep(t={t}, h={h}) returned {status}")
            });
            Ok(())
        });
    }
    Ok(())
}

fn halves(bench: &Bench) -> Result<(), Blocked> {
    if !bench.flag("canHandleVariableCommunicationStepSize") {
        return bench.not_applicable("the communication step may not change");
    }
    let (h, n) = (bench.h(), 40);
    let fits = |v: &&&model_description::ModelVariable| v.base == BaseType::Float64 && !v.is_array();
    let all = bench.watched();
    let watched: Vec<_> = all.iter().filter(fits).copied().collect();
    let run = |parts: u32| {
        let it = bench.stepping()?;
        it.excite(3)?;
        (0..n)
            .map(|_| {
                it.steps(usize::try_from(parts).unwrap_or(1), h / f64::from(parts))?;
                it.snapshot(&watched)
            })
            .collect::<Result<Vec<_>, _>>()
    };
    let (whole, half) = (run(1)?, run(2)?);
    let number = |bits: &[u64]| bits.first().map_or(0.0, |b| f64::from_bits(*b));
    for (i, v) in watched.iter().enumerate() {
        let scale = whole.iter().map(|row| number(&row[i]).abs()).fold(v.nominal.unwrap_or(0.0).abs(), f64::max);
        let far = whole.iter().zip(&half).map(|(a, b)| (number(&a[i]) - number(&b[i])).abs()).fold(0.0, f64::max);
        bench.require(far <= 0.1 * scale + 1e-9, || {
            format!("{} ({}): steps of {h} and of {} differ by {far}, of {scale}", v.name, v.variability, h / 2.0)
        });
    }
    Ok(())
}

fn variable(bench: &Bench) -> Result<(), Blocked> {
    if !bench.flag("canHandleVariableCommunicationStepSize") {
        return bench.not_applicable("canHandleVariableCommunicationStepSize is false");
    }
    let (it, h) = (bench.stepping()?, bench.h());
    let mut random = 0x2545_f491_u32;
    for _ in 0..200 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let part = h * (0.05 + 3.0 * f64::from(random >> 8) / f64::from(1 << 24));
        let t = it.time.get();
        let status = it.step(part)?;
        if !fine(status) {
            bench.violated(format!("DoStep(t={t:?}, h={part:?}) returned {status}"));
            break;
        }
    }
    Ok(())
}

fn told(bench: &Bench) -> Result<(), Blocked> {
    let (it, h) = (bench.stepping()?, bench.h());
    if bench.flag("hasEventMode") && bench.md.variables.iter().any(|v| v.base == BaseType::Clock) {
        return bench.not_applicable("the FMU has clocks and needs event mode");
    }
    for _ in 0..20 {
        let t = it.time.get();
        let mut result = None;
        let status = it.call(&format!("DoStep(t={t}, h={h})"), |raw| {
            let (status, told) = raw.do_step(it.handle, t, h, false, [true; 4])?;
            result = Some(told);
            Some(status)
        })?;
        let Some(told) = result.filter(|_| fine(status)) else {
            return Err(Blocked(format!("DoStep returned {status}")));
        };
        bench.require([told.event, told.terminate, told.early].iter().all(|b| *b <= 1), || {
            format!("DoStep(t={t}, h={h}) gave {told:?}: a truth value is not 0 or 1, or was not written")
        });
        bench.require(told.early == 0, || format!("DoStep(t={t}, h={h}) returned early, which was not allowed"));
        let close = (told.last - (t + h)).abs() <= 1e-9 * h + 4.0 * f64::EPSILON * t.abs();
        bench.require(close, || format!("DoStep(t={t}, h={h}) gave lastSuccessfulTime={}", told.last));
        if told.terminate == 1 {
            break;
        }
        it.time.set(t + h);
    }
    Ok(())
}

fn independent(bench: &Bench) -> Result<(), Blocked> {
    let time = bench.md.variables.iter().find(|v| v.causality == Causality::Independent && v.base == BaseType::Float64);
    let Some(time) = time else { return bench.not_applicable("there is no independent variable of double precision") };
    let (it, h) = (bench.stepping()?, bench.h());
    for _ in 0..5 {
        it.steps(1, h)?;
        let (status, bits) = it.get(time)?;
        let (t, told) = (it.time.get(), bits.first().map_or(f64::NAN, |b| f64::from_bits(*b)));
        let close = fine(status) && (told - t).abs() <= 1e-6 * h + 4.0 * f64::EPSILON * t.abs();
        bench.require(close, || format!("after the step to {t}, Get({}) returned {status}, {told}", time.name));
    }
    Ok(())
}

fn places(bench: &Bench) -> Result<(), Blocked> {
    for missing in 0..4 {
        bench.case(|| {
            let it = bench.stepping()?;
            let mut given = [true; 4];
            given[missing] = false;
            let name = ["eventHandlingNeeded", "terminateSimulation", "earlyReturn", "lastSuccessfulTime"][missing];
            let status = it.call(&format!("DoStep({name}=NULL)"), |raw| {
                raw.do_step(it.handle, it.time.get(), bench.h(), false, given).map(|(s, _)| s)
            })?;
            bench.note(format!("{name}=NULL: {status}"));
            Ok(())
        });
    }
    Ok(())
}

fn statuses(bench: &Bench) -> Result<(), Blocked> {
    use StepStatus::{GetBooleanStatus, GetIntegerStatus, GetRealStatus, GetStatus, GetStringStatus};
    for name in [GetStatus, GetRealStatus, GetIntegerStatus, GetBooleanStatus, GetStringStatus] {
        for kind in [0, 1, 2, 3, 99] {
            bench.case(|| {
                let it = bench.stepping()?;
                it.steps(1, bench.h())?;
                let status = it.call(&format!("{name:?}(kind={kind})"), |raw| {
                    raw.step_status(name, it.handle, kind).map(|(s, _)| s)
                })?;
                let known = [Status::OK, Status::WARNING, Status::DISCARD].contains(&status) || kind == 99;
                // A number of a status that this function does not tell at all may be an error.
                let fits = matches!(
                    (name, kind),
                    (GetStatus, 0) | (GetRealStatus, 2) | (GetBooleanStatus, 3) | (GetStringStatus, 1)
                );
                bench.require(known || !fits, || format!("fmi2{name:?}({kind}) returned {status}"));
                Ok(())
            });
        }
    }
    Ok(())
}

fn determinism(bench: &Bench) -> Result<(), Blocked> {
    let run = || {
        let it = bench.stepping()?;
        (0..30)
            .map(|k| {
                it.excite(k)?;
                it.steps(1, bench.h())?;
                it.snapshot(&bench.watched())
            })
            .collect::<Result<Vec<_>, _>>()
    };
    let (first, second) = (run()?, run()?);
    if let Some((k, i)) = difference(&first, &second) {
        bench.violated(format!("{} differs after {} steps", bench.watched()[i].name, k + 1));
    }
    Ok(())
}

/// What comes out is told as a number, which the parent compares.
fn two_processes(bench: &Bench) -> Result<(), Blocked> {
    let it = bench.stepping()?;
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for k in 0..30 {
        it.excite(k)?;
        it.steps(1, bench.h())?;
        for bits in it.snapshot(&bench.watched())?.into_iter().flatten() {
            hash = bits.to_le_bytes().iter().fold(hash, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
        }
    }
    bench.note(format!("30 steps, all outputs hashed: {hash:016x}"));
    Ok(())
}

fn promise(bench: &Bench) -> Result<(), Blocked> {
    let saves = bench.md.co_simulation.as_ref().is_some_and(CoSimulation::can_get_and_set_state);
    let run = |it: &It<'_>, from: u32, promised: bool| {
        let mut rows = Vec::new();
        for k in from..from + 10 {
            it.excite(k)?;
            let (t, h) = (it.time.get(), bench.h());
            let status = it
                .call(&format!("DoStep(t={t}, h={h}, noSetFMUStatePriorToCurrentPoint={promised})"), |raw| {
                    raw.do_step(it.handle, t, h, promised, [true; 4]).map(|(s, _)| s)
                })?;
            bench.require(fine(status), || {
                format!("with noSetFMUStatePriorToCurrentPoint={promised} DoStep(t={t}) returned {status}")
            });
            it.time.set(t + h);
            rows.push(it.snapshot(&bench.watched())?);
        }
        Ok::<_, Blocked>(rows)
    };
    if bench.md.variables.iter().any(|v| v.base == BaseType::Clock) {
        return bench.not_applicable("the FMU has clocks and needs event mode");
    }
    let (free, bound) = (bench.stepping()?, bench.stepping()?);
    let (a, b) = (run(&free, 0, false)?, run(&bound, 0, true)?);
    if let Some((step, i)) = difference(&a, &b) {
        bench.violated(format!("{} differs after {} steps under the promise", bench.watched()[i].name, step + 1));
    }
    if !saves {
        bench.note("the FMU saves no states");
        return Ok(());
    }
    let (here, time) = (bound.save()?, bound.time.get());
    let first = run(&bound, 10, false)?;
    if let Err(Blocked(why)) = bound.restore(here, time) {
        bench.violated(format!("the current point after a step under the promise: {why}"));
        return Ok(());
    }
    if let Some((step, i)) = difference(&first, &run(&bound, 10, true)?) {
        bench.violated(format!("{} differs {} steps after the state was set", bench.watched()[i].name, step + 1));
    }
    Ok(())
}
