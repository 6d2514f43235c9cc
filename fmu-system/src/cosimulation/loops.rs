//! Algebraic loops: continuous inputs that depend on each other through outputs at one instant.
//!
//! Newton's method on u = G(u), where G propagates the outputs once; the derivatives of outputs with respect to inputs come
//! from the FMUs, or from differences if an FMU provides none.

use super::exchange::{Exchange, Unsettled};
use fmu_import::{Error, Instance};
use model_description::Interface;

/// Most iterations.
const ITERATIONS: u32 = 40;
/// Residual relative to the inputs at which a loop counts as solved.
const SOLVED: f64 = 1e-14;
/// Residual at which a loop counts as solved if an iteration does not improve it.
const NEARLY: f64 = 1e-11;

/// Solves the loop among the inputs that are not settled.
pub(super) fn solve(exchange: &mut Exchange, instances: &mut [Instance], t: f64) -> Result<(), Error> {
    let mut inputs = exchange.unsettled(instances, t)?;
    if inputs.is_empty() {
        return Ok(());
    }
    if inputs.iter().any(|input| input.source.is_none()) {
        let cause =
            "the connections form an algebraic loop of discrete inputs or elements of arrays, which do not settle";
        return Err(Error::usage(&names(&inputs, instances), format!("{cause} at t = {t} s")));
    }
    loop {
        newton(exchange, instances, t, &inputs)?;
        // An input of the loop that was settled by chance in the last pass is added now; otherwise each Newton step would only
        // be one more pass.
        let known = |new: &Unsettled| inputs.iter().any(|i| (i.index, i.reference) == (new.index, new.reference));
        let unsettled = exchange.unsettled(instances, t)?.into_iter();
        let more: Vec<_> = unsettled.filter(|new| new.source.is_some() && !known(new)).collect();
        if more.is_empty() {
            return Ok(());
        }
        inputs.extend(more);
    }
}

/// Iterates these inputs until they equal the outputs passed on to them.
fn newton(exchange: &mut Exchange, instances: &mut [Instance], t: f64, inputs: &[Unsettled]) -> Result<(), Error> {
    let (mut u, mut last) = (exchange.values_of(inputs), f64::INFINITY);
    for _ in 0..ITERATIONS {
        let g = exchange.try_values(instances, t, inputs, &u)?;
        let mut residual: Vec<f64> = g.iter().zip(&u).map(|(g, u)| g - u).collect();
        let scale = u.iter().chain(&g).fold(f64::MIN_POSITIVE, |max, x| max.max(x.abs()));
        let error = residual.iter().fold(0.0_f64, |max, r| max.max(r.abs())) / scale;
        if error <= SOLVED || (error <= NEARLY && error >= 0.5 * last) {
            return Ok(());
        }
        if !error.is_finite() {
            break;
        }
        last = error;
        let mut matrix = matrix(exchange, instances, t, inputs, &u, &g)?;
        if !eliminate(&mut matrix, &mut residual) {
            break;
        }
        u.iter_mut().zip(&residual).for_each(|(u, step)| *u += step);
    }
    let cause = format!("the algebraic loop of these inputs does not converge at t = {t} s in {ITERATIONS} iterations");
    Err(Error::usage(&names(inputs, instances), cause))
}

/// The matrix 1 - dG/du by rows.
fn matrix(
    exchange: &mut Exchange,
    instances: &mut [Instance],
    t: f64,
    inputs: &[Unsettled],
    u: &[f64],
    g: &[f64],
) -> Result<Vec<Vec<f64>>, Error> {
    let n = inputs.len();
    let mut rows = vec![vec![0.0; n]; n];
    for (k, known) in inputs.iter().enumerate() {
        let fed: Vec<(usize, u32)> = inputs
            .iter()
            .enumerate()
            .filter_map(|(i, unknown)| {
                unknown.source.filter(|(of, _)| *of == known.index).map(|(_, reference)| (i, reference))
            })
            .collect();
        let unknowns: Vec<u32> = fed.iter().map(|(_, reference)| *reference).collect();
        let mut column = vec![0.0; unknowns.len()];
        let instance = &mut instances[known.index];
        let has = instance.description().model_exchange.as_ref().is_some_and(Interface::has_directional_derivatives);
        if has && instance.directional_derivative(&unknowns, &[known.reference], &[1.0], &mut column).is_ok() {
            for ((i, _), slope) in fed.iter().zip(&column) {
                rows[*i][k] = -inputs[*i].factor * slope;
            }
        } else {
            let mut moved = u.to_vec();
            let h = 1e-7 * u[k].abs().max(1e-3);
            moved[k] += h;
            let there = exchange.try_values(instances, t, inputs, &moved)?;
            for (i, _) in &fed {
                rows[*i][k] = -(there[*i] - g[*i]) / h;
            }
        }
        rows[k][k] += 1.0;
    }
    Ok(rows)
}

/// Gaussian elimination with pivots; false for a singular matrix. The right side becomes the solution.
fn eliminate(a: &mut [Vec<f64>], b: &mut [f64]) -> bool {
    let n = b.len();
    for k in 0..n {
        let Some(p) = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())) else { return false };
        if a[p][k].abs() < 1e-300 {
            return false;
        }
        a.swap(k, p);
        b.swap(k, p);
        for i in k + 1..n {
            let (top, rest) = a.split_at_mut(i);
            let factor = rest[0][k] / top[k][k];
            rest[0][k..].iter_mut().zip(&top[k][k..]).for_each(|(x, y)| *x -= factor * y);
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let sum: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - sum) / a[k][k];
    }
    true
}

/// `a.u, b.u`.
fn names(inputs: &[Unsettled], instances: &[Instance]) -> String {
    let name = |input: &Unsettled| {
        let instance = &instances[input.index];
        let variable = instance.description().referenced(input.reference).map_or("?", |v| v.name.as_str());
        format!("{}.{variable}", instance.name())
    };
    inputs.iter().map(name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elimination_solves_and_finds_singular_matrices() {
        let mut b = vec![1.0, 2.0, 3.0];
        assert!(eliminate(&mut [vec![0.0, 2.0, 0.0], vec![1.0, 1.0, 0.0], vec![0.0, 0.0, 4.0]], &mut b));
        assert_eq!(b, [1.5, 0.5, 0.75]);
        assert!(!eliminate(&mut [vec![1.0, 2.0], vec![2.0, 4.0]], &mut [1.0, 1.0]));
    }
}
