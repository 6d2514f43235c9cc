//! A counter of seconds that ends the simulation at 10.

use super::*;

#[test]
fn has_the_bits_of_the_original_and_ends_at_9_s() {
    let wanted: Vec<f64> = (0..46_u32).map(|k| f64::from(1 + k / 5)).collect();
    assert_eq!(wanted[45], 10.0);
    for version in BOTH {
        let fmu = archive("stair", version);
        let recording = run(Method::default(), &fmu, &[], 10.0, 0.2);
        assert_eq!(column(&recording, "counter"), wanted, "{version:?}");
        assert_eq!((recording.time[45], recording.ended_by.as_deref()), (9.0, Some("it")));
        // The event is inside the last step: FMI 2.0 returns its time, FMI 3.0 without early return the end of the step.
        let recording = run(Method::default(), &fmu, &[], 10.0, 0.7);
        let last = if version == V2 { 9.0 } else { 9.1 };
        assert!((recording.time.last().unwrap() - last).abs() < 1e-9, "{:?}", recording.time);
        let [times, counter] = &fmpy(&fmu, "stop_time=10, output_interval=0.2")[..] else { panic!("time and counter") };
        assert_eq!((counter, times.last()), (&wanted, Some(&9.0)), "FMPy, {version:?}");
        let recording = run(exchange(), &fmu, &[], 10.0, 0.2);
        assert_eq!((recording.time.last(), recording.ended_by.as_deref()), (Some(&9.0), Some("it")));
        assert_eq!(column(&recording, "counter").last(), Some(&10.0), "Model Exchange, {version:?}");
    }
}

#[test]
fn starts_where_the_importer_wants() {
    for version in BOTH {
        let recording = run(Method::default(), &archive("stair", version), &[("counter", "8")], 10.0, 0.2);
        assert_eq!((column(&recording, "counter").last(), recording.time.last()), (Some(&10.0), Some(&2.0)));
    }
}
