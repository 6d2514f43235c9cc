//! Draws two curves: `cargo run -p fmu-plot --example figure > figure.svg`.

use fmu_plot::figure::{Curve, Figure, Panel};
use fmu_plot::{Error, ink, svg};

fn main() -> Result<(), Error> {
    let times = (0..=200).map(|k| f64::from(k) * 0.01);
    let step = times.clone().map(|t| (t, 1.0 - (-t / 0.3).exp()));
    let ringing = times.map(|t| (t, 1.0 - (-2.0 * t).exp() * (8.0 * t).cos()));
    let panel = Panel {
        title: "Step responses".into(),
        unit: "y".into(),
        window: (0.0, 2.0),
        curves: vec![
            Curve::through("first order", ink::CURVES[0], step),
            Curve::through("second order", ink::CURVES[1], ringing),
        ],
        ..Panel::default()
    };
    let figure = Figure { title: "Two systems".into(), x: "t in s", columns: 1, panels: vec![panel] };
    println!("{}", svg::draw(&figure)?);
    Ok(())
}
