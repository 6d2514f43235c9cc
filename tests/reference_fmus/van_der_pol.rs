//! The van der Pol oscillator.

use super::*;

#[test]
fn has_the_bits_of_the_original() {
    let rows = euler([2.0, 0.0], 1e-2, 2001, 1, |[x0, x1]| [x1, 1.0 * ((1.0 - x0 * x0) * x1) - x0]);
    assert_eq!(rows[2000], [2.014_841_886_154_613_3, 0.244_194_707_519_044_07]);
    let [x0, x1] = [0, 1].map(|i| rows.iter().map(|row| row[i]).collect::<Vec<f64>>());
    for version in BOTH {
        let fmu = archive("van-der-pol", version);
        let recording = run(Method::default(), &fmu, &[], 20.0, 1e-2);
        assert_eq!((column(&recording, "x0"), column(&recording, "x1")), (x0.clone(), x1.clone()), "{version:?}");
        let columns = fmpy(&fmu, "stop_time=20, output_interval=1e-2");
        assert_eq!(columns[1..], [x0.clone(), x1.clone()], "FMPy, {version:?}");
    }
}

/// Directional derivatives equal the original's handwritten ones.
#[test]
fn its_derivatives_are_exact() {
    for version in BOTH {
        let fmu = Fmu::open(archive("van-der-pol", version)).unwrap();
        let mut instance = fmu.instantiate_as(Kind::ModelExchange, "it", false).unwrap();
        instance.set_text("x0", "1.5").unwrap();
        instance.set_text("x1", "-0.7").unwrap();
        instance.set_text("mu", "3").unwrap();
        instance.setup(0.0, None).unwrap();
        instance.enter_initialization().unwrap();
        let reference = |name: &str| instance.variable(name).unwrap().value_reference;
        let (unknowns, knowns) = ([reference("der(x0)"), reference("der(x1)")], [reference("x0"), reference("x1")]);
        for (initial, width) in [(true, 1e-8), (false, 1e-14)] {
            if !initial {
                instance.exit_initialization().unwrap();
                instance.enter_continuous_time_mode().unwrap();
            }
            let first = ([1.0, 0.0], [0.0, -2.0 * 1.5 * -0.7 * 3.0 - 1.0]);
            for (seed, wanted) in [first, ([0.0, 1.0], [1.0, 3.0 * (1.0 - 1.5 * 1.5)])] {
                let mut change = [f64::NAN; 2];
                instance.directional_derivative(&unknowns, &knowns, &seed, &mut change).unwrap();
                for (change, wanted) in change.iter().zip(wanted) {
                    assert!((change - wanted).abs() < width, "{version:?}, {initial}: {change} {wanted}");
                }
            }
        }
    }
}
