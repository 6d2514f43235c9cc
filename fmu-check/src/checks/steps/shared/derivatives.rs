//! Derivatives of outputs and inputs with respect to time (FMI 2.0.5, 4.2.1; FMI 3.0.2, 4.1.2).

use crate::instance::Instance;
use crate::session::{NotDetermined, Session};
use fmu_import::Status;
use model_description::{BaseType, Causality, ModelVariable, Variability};

/// The highest order, and the continuous outputs; `None`, with a report, if there is nothing to check.
fn scope(session: &Session) -> Result<Option<(i32, Vec<&ModelVariable>)>, NotDetermined> {
    let simulation = session.description.co_simulation.as_ref();
    let order = simulation.and_then(|c| c.attribute("maxOutputDerivativeOrder")?.trim().parse().ok()).unwrap_or(0);
    if order <= 0 {
        session.not_applicable("maxOutputDerivativeOrder is 0; L08u checks that the function is refused")?;
        return Ok(None);
    }
    let fits = |v: &&ModelVariable| {
        v.causality == Causality::Output
            && v.variability == Variability::Continuous
            && v.base == BaseType::Float64
            && !v.is_array()
            && v.clocks.is_empty()
    };
    let outputs: Vec<_> = session.description.variables.iter().filter(fits).take(40).collect();
    if outputs.is_empty() {
        session.not_applicable("there is no continuous output of type Float64")?;
        return Ok(None);
    }
    Ok(Some((order, outputs)))
}

fn read(instance: &Instance<'_>, outputs: &[&ModelVariable], order: i32) -> Result<(Status, Vec<f64>), NotDetermined> {
    let references: Vec<u32> = outputs.iter().map(|v| v.value_reference).collect();
    let missing = || NotDetermined("the function GetOutputDerivatives is missing".into());
    instance.session.record_call(&format!("GetOutputDerivatives({} outputs, order {order})", outputs.len()));
    instance.session.raw.output_derivatives(instance.handle, &references, order).ok_or_else(missing)
}

/// An instance whose inputs have changed, after some steps.
fn moving(session: &Session) -> Result<Instance<'_>, NotDetermined> {
    let instance = session.stepping()?;
    instance.change_inputs(1)?;
    instance.steps(3, session.h())?;
    Ok(instance)
}

pub(crate) fn output_derivatives(session: &Session) -> Result<(), NotDetermined> {
    let Some((_, outputs)) = scope(session)? else { return Ok(()) };
    let (status, _) = read(&moving(session)?, &outputs, 1)?;
    session.require(status.is_ok(), || format!("GetOutputDerivatives of order 1 returned {status}"));
    Ok(())
}

/// Orders that do not exist are refused, and slopes match. The slope is that between the ends of two steps of equal length: then
/// an output that is a mean over the step has moved by as much as one that is a value at its end.
pub(crate) fn slopes(session: &Session) -> Result<(), NotDetermined> {
    let Some((order, outputs)) = scope(session)? else { return Ok(()) };
    for wrong in [order + 1, -1] {
        session.case(|| {
            let (status, _) = read(&moving(session)?, &outputs[..1], wrong)?;
            session.require(status == Status::ERROR, || {
                format!("GetOutputDerivatives({}, order {wrong}) returned {status}", outputs[0].name)
            });
            Ok(())
        });
    }
    session.case(|| {
        let instance = moving(session)?;
        let values = || instance.numbers(&outputs);
        // A hundredth of the step, so that the slope hardly changes.
        let short_step = session.h() / 100.0;
        if !session.flag("canHandleVariableCommunicationStepSize") || !instance.step(short_step)?.is_ok() {
            session.note("the step cannot be shortened: slopes are not compared");
            return Ok(());
        }
        let (before, (status, derivatives)) = (values()?, read(&instance, &outputs, 1)?);
        if !status.is_ok() || !instance.step(short_step)?.is_ok() {
            return Err(NotDetermined(format!(
                "GetOutputDerivatives returned {status}, or a second short step failed"
            )));
        }
        let mut constant = 0;
        for (((v, derivative), before), after) in outputs.iter().zip(&derivatives).zip(&before).zip(values()?) {
            // An output held by a sampled part of the FMU has no slope in a short step.
            if *derivative != 0.0 && after.to_bits() == before.to_bits() {
                constant += 1;
                continue;
            }
            let slope = (after - before) / short_step;
            let scale = derivative.abs().max(slope.abs());
            let rounding = 1e-12 * before.abs().max(after.abs()) / short_step;
            session.require((derivative - slope).abs() <= 0.1 * scale + rounding + 1e-9, || {
                format!("the FMU returns {derivative} as the derivative of {}, but its slope is {slope}", v.name)
            });
        }
        if constant > 0 {
            session.note(format!("{constant} outputs did not change in a short step and were not compared"));
        }
        Ok(())
    });
    Ok(())
}

/// Derivatives of inputs are accepted (FMI 2.0).
pub(crate) fn input_derivatives(session: &Session) -> Result<(), NotDetermined> {
    if !session.flag("canInterpolateInputs") {
        return session.not_applicable("canInterpolateInputs is false; L08u checks that the function is refused");
    }
    let continuous = |v: &&&ModelVariable| v.variability == Variability::Continuous;
    let inputs = session.float_inputs();
    let Some(v) = inputs.iter().find(continuous) else { return session.not_applicable("there is no continuous input") };
    let instance = moving(session)?;
    let status = instance.call(&format!("SetRealInputDerivatives({}, order 1, 0.0)", v.name), |raw| {
        raw.input_derivatives(instance.handle, Some(&[v.value_reference]), 1, Some(&[1]), Some(&[0.0]))
    })?;
    session.require(status.is_ok(), || format!("SetRealInputDerivatives({}, order 1) returned {status}", v.name));
    instance.steps(2, session.h())
}
