//! Derivatives of outputs with respect to time (FMI 2.0.5, 4.2.1; FMI 3.0.2, 4.1.2).

use crate::session::{NotDetermined, Session};
use fmu_import::Status;
use model_description::{BaseType, Causality, Variability};

pub(super) fn output_derivatives(session: &Session) -> Result<(), NotDetermined> {
    let order = session
        .description
        .co_simulation
        .as_ref()
        .and_then(|c| c.attribute("maxOutputDerivativeOrder")?.trim().parse().ok());
    let order: i32 = order.unwrap_or(0);
    if order <= 0 {
        return session.not_applicable("maxOutputDerivativeOrder is 0; L08u checks that the function is refused");
    }
    let fits = |v: &&model_description::ModelVariable| {
        v.causality == Causality::Output
            && v.variability == Variability::Continuous
            && v.base == BaseType::Float64
            && !v.is_array()
            && v.clocks.is_empty()
    };
    let outputs: Vec<_> = session.description.variables.iter().filter(fits).take(40).collect();
    let references: Vec<u32> = outputs.iter().map(|v| v.value_reference).collect();
    if outputs.is_empty() {
        return session.not_applicable("there is no continuous output of type Float64");
    }
    let missing = || NotDetermined("the function GetOutputDerivatives is missing".into());
    for wrong in [0, order + 1, -1] {
        session.case(|| {
            let instance = session.stepping()?;
            instance.steps(1, session.h())?;
            let name = format!("GetOutputDerivatives({}, order {wrong})", outputs[0].name);
            session.record_call(&name);
            let (status, _) =
                session.raw.output_derivatives(instance.handle, &references[..1], wrong).ok_or_else(missing)?;
            session.require(status == Status::ERROR, || format!("{name} returned {status}"));
            Ok(())
        });
    }
    session.case(|| {
        let (instance, h) = (session.stepping()?, session.h());
        instance.change_inputs(1)?;
        instance.steps(3, h)?;
        let read = || -> Result<Vec<f64>, NotDetermined> {
            let rows = instance.snapshot(&outputs)?;
            Ok(rows.iter().map(|bits| bits.first().map_or(f64::NAN, |b| f64::from_bits(*b))).collect())
        };
        session.record_call("GetOutputDerivatives(order 1)");
        let (status, slopes) = session.raw.output_derivatives(instance.handle, &references, 1).ok_or_else(missing)?;
        session.require(status.is_ok(), || format!("GetOutputDerivatives of order 1 returned {status}"));
        if !status.is_ok() {
            return Ok(());
        }
        let before = read()?;
        // A hundredth of the step, so that the slope has no time to change much.
        let short_step = h / 100.0;
        if !session.flag("canHandleVariableCommunicationStepSize") || !instance.step(short_step)?.is_ok() {
            session.note("the step cannot be shortened: slopes are not compared");
            return Ok(());
        }
        for (((v, derivative), before), after) in outputs.iter().zip(&slopes).zip(&before).zip(read()?) {
            let slope = (after - before) / short_step;
            let scale = derivative.abs().max(slope.abs());
            let rounding = 1e-12 * before.abs().max(after.abs()) / short_step;
            session.require((derivative - slope).abs() <= 0.1 * scale + rounding + 1e-9, || {
                format!("the FMU returns {derivative} as the derivative of {}, but its slope is {slope}", v.name)
            });
        }
        Ok(())
    });
    Ok(())
}
