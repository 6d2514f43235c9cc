//! Derivatives of outputs with respect to time (FMI 2.0.5, 4.2.1; FMI 3.0.2, 4.2.1.1).

use super::bench::{Bench, Blocked, fine};
use fmu_import::Status;
use model_description::{BaseType, Causality, Variability};

pub(super) fn output_derivatives(bench: &Bench) -> Result<(), Blocked> {
    let order =
        bench.md.co_simulation.as_ref().and_then(|c| c.attribute("maxOutputDerivativeOrder")?.trim().parse().ok());
    let order: i32 = order.unwrap_or(0);
    if order <= 0 {
        return bench.not_applicable("maxOutputDerivativeOrder is 0; that the function then is refused looks L08u");
    }
    let fits = |v: &&model_description::ModelVariable| {
        v.causality == Causality::Output
            && v.variability == Variability::Continuous
            && v.base == BaseType::Float64
            && !v.is_array()
            && v.clocks.is_empty()
    };
    let outputs: Vec<_> = bench.md.variables.iter().filter(fits).take(40).collect();
    let references: Vec<u32> = outputs.iter().map(|v| v.value_reference).collect();
    if outputs.is_empty() {
        return bench.not_applicable("there is no continuous output of double precision");
    }
    let missing = || Blocked("the function GetOutputDerivatives is missing".into());
    for wrong in [0, order + 1, -1] {
        bench.case(|| {
            let it = bench.stepping()?;
            it.steps(1, bench.h())?;
            let name = format!("GetOutputDerivatives({}, order {wrong})", outputs[0].name);
            bench.calling(&name);
            let (status, _) = bench.raw.output_derivatives(it.handle, &references[..1], wrong).ok_or_else(missing)?;
            bench.require(status == Status::ERROR, || format!("{name} returned {status}"));
            Ok(())
        });
    }
    bench.case(|| {
        let (it, h) = (bench.stepping()?, bench.h());
        it.excite(1)?;
        it.steps(3, h)?;
        let read = || -> Result<Vec<f64>, Blocked> {
            let rows = it.snapshot(&outputs)?;
            Ok(rows.iter().map(|bits| bits.first().map_or(f64::NAN, |b| f64::from_bits(*b))).collect())
        };
        bench.calling("GetOutputDerivatives(order 1)");
        let (status, slopes) = bench.raw.output_derivatives(it.handle, &references, 1).ok_or_else(missing)?;
        bench.require(fine(status), || format!("GetOutputDerivatives of order 1 returned {status}"));
        if !fine(status) {
            return Ok(());
        }
        let before = read()?;
        // A hundredth of the step, so that the slope has no time to change much.
        let part = h / 100.0;
        if !bench.flag("canHandleVariableCommunicationStepSize") || !fine(it.step(part)?) {
            bench.note("the step cannot be made smaller: the slopes are not compared");
            return Ok(());
        }
        for (((v, told), before), after) in outputs.iter().zip(&slopes).zip(&before).zip(read()?) {
            let slope = (after - before) / part;
            let scale = told.abs().max(slope.abs());
            let rounding = 1e-12 * before.abs().max(after.abs()) / part;
            bench.require((told - slope).abs() <= 0.1 * scale + rounding + 1e-9, || {
                format!("the derivative of {} is told as {told}, and it rises by {slope} a second", v.name)
            });
        }
        Ok(())
    });
    Ok(())
}
