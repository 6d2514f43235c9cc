//! dx/dt = -k x.

use super::*;

fn expected(x: f64, k: f64) -> Vec<f64> {
    euler([x], 0.1, 101, 1, |[x]| [-k * x]).into_iter().map(|[x]| x).collect()
}

#[test]
fn has_the_bits_of_the_original() {
    let wanted = expected(1.0, 1.0);
    assert_eq!((wanted.len(), wanted[100]), (101, 2.656_139_888_758_746e-5));
    for version in BOTH {
        let fmu = archive("dahlquist", version);
        assert_eq!(column(&run(Method::default(), &fmu, &[], 10.0, 0.1), "x"), wanted, "{version:?}");
        // The remainder of a communication step is left to the next one.
        let rows = column(&run(Method::default(), &fmu, &[], 9.0, 0.25), "x");
        assert_eq!(
            rows.iter().step_by(2).copied().collect::<Vec<_>>(),
            wanted.iter().step_by(5).take(19).copied().collect::<Vec<_>>()
        );
        assert_eq!(rows[1], wanted[2]);
        let [times, x] = &fmpy(&fmu, "stop_time=10, output_interval=0.1")[..] else { panic!("time and x") };
        assert_eq!((times.len(), x), (101, &wanted), "FMPy, {version:?}");
        // FMPy's steps are differences of times, so the last digits differ.
        let [_, x] = &fmpy(
            &fmu,
            "fmi_type='ModelExchange', solver='Euler', step_size=0.1, stop_time=10, output_interval=0.1",
        )[..] else {
            panic!("time and x")
        };
        assert!(x.len() == 101 && x.iter().zip(&wanted).all(|(x, wanted)| (x / wanted - 1.0).abs() < 1e-13), "{x:?}");
        let exact = column(&run(exchange(), &fmu, &[], 10.0, 0.01), "x");
        assert!((exact[1000] - (-10.0_f64).exp()).abs() < 1e-12, "Model Exchange, {version:?}: {}", exact[1000]);
    }
}

#[test]
fn starts_where_the_importer_wants() {
    for version in BOTH {
        let fmu = archive("dahlquist", version);
        let wanted = expected(3.0, 1.0);
        let x = column(&run(Method::default(), &fmu, &[("x", "3")], 10.0, 0.1), "x");
        assert_eq!(x, wanted, "{version:?}");
        for (three, one) in x.iter().zip(expected(1.0, 1.0)) {
            assert!((three / (3.0 * one) - 1.0).abs() < 1e-14);
        }
        assert_eq!(column(&run(exchange(), &fmu, &[("x", "3")], 0.0 + 0.1, 0.1), "x")[0], 3.0);
        let [_, x] = &fmpy(&fmu, "stop_time=10, output_interval=0.1, start_values={'x': 3.0}")[..] else {
            panic!("time and x")
        };
        assert_eq!(x, &wanted, "FMPy, {version:?}");
    }
}

/// The step of its solver is an attribute only in FMI 3.0.
#[test]
fn its_description_has_the_step_of_the_solver() {
    for (version, expected) in [(V2, None), (V3, Some(" fixedInternalStepSize=\"0.1\""))] {
        let (_, files) = fmu_import::contents(&archive("dahlquist", version)).unwrap();
        let xml = String::from_utf8(files["modelDescription.xml"].clone()).unwrap();
        let times = xml.matches("fixedInternalStepSize").count();
        let found = expected.map_or(0, |attribute| xml.matches(attribute).count());
        assert_eq!((times, found), (expected.iter().count(), times), "{xml}");
    }
}

/// Inside a step of 1 s, FMPy reads the rows of the original, and may end a step.
#[test]
fn fmpy_reads_it_inside_a_step() {
    let said = script(include_str!("dahlquist.py"), &[&archive("dahlquist", V3)]);
    let found: Vec<f64> = said.split_whitespace().map(hexadecimal).collect();
    assert_eq!(found, expected(1.0, 1.0)[..=10]);
}
