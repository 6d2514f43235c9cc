//! The model run natively, as the FMU computes it.

use super::Body;
use fmu_core::{Block, Elapsed, Step};

/// From 20 degC with 100 W, the body warms to 70 degC with the time constant C/G = 250 s.
#[test]
fn it_warms_as_its_equation_says() {
    let mut body = Block::<Body>::default();
    body.model.heat = 100.0;
    body.initialize();
    for k in 0..1000_u32 {
        let (h, expected) = (1.0, 343.15 - 50.0 * (-f64::from(k) / 250.0).exp());
        let t = body.out.temperature;
        assert!((t - expected).abs() < 1e-6, "after {k} s: {t} K, {expected} K");
        body.step(&Step { start: Elapsed::periods(k.into(), h), h }).unwrap();
    }
}
