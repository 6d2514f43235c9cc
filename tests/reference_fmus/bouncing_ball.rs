//! A ball that bounces until it rests.

use super::*;

/// Height and velocity after every `n`-th of the 3000 points, and the numbers of the points with a bounce.
fn expected(n: usize) -> ([Vec<f64>; 2], Vec<usize>) {
    let ([mut h, mut v, mut g], s) = ([1.0, 0.0, -9.81], 1e-3);
    let (mut rows, mut bounces) = ([vec![h], vec![v]], Vec::new());
    for k in 1..=3000 {
        let before: f64 = h;
        (h, v) = (h + s * v, v + s * g);
        if before > 0.0 && h <= 0.0 {
            bounces.push(k);
            (h, v) = (f64::MIN_POSITIVE, -v * 0.7);
            if v < 0.1 {
                (v, g) = (0.0, 0.0);
            }
        }
        if k % n == 0 {
            rows[0].push(h);
            rows[1].push(v);
        }
    }
    (rows, bounces)
}

#[test]
fn has_the_bits_of_the_original() {
    let ([h, v], bounces) = expected(10);
    assert_eq!((h.len(), h[300], v[300]), (301, 2.225_073_858_507_201_4e-308, 0.0));
    assert_eq!((bounces.len(), bounces[0]), (12, 453));
    for version in BOTH {
        let fmu = archive("bouncing-ball", version);
        let recording = run(Method::default(), &fmu, &[], 3.0, 1e-2);
        assert_eq!((column(&recording, "h"), column(&recording, "v")), (h.clone(), v.clone()), "{version:?}");
        let columns = fmpy(&fmu, "stop_time=3, output_interval=1e-2");
        // In FMI 3.0 also under its other name, h_ft, in meters.
        let names = if version == V3 { 3 } else { 2 };
        assert_eq!(columns[1..], [h.clone(), v.clone(), h.clone()][..names], "FMPy, {version:?}");
    }
}

#[test]
fn event_mode_and_early_return_change_no_bit() {
    let fmu = archive("bouncing-ball", V3);
    for (h, n) in [(1e-3, 1), (7e-3, 7), (1e-2, 10)] {
        let ([heights, velocities], _) = expected(n);
        for (event_mode, early_return) in [(false, false), (false, true), (true, false), (true, true)] {
            let recording = run(Method::CoSimulation { event_mode, early_return }, &fmu, &[], 2.94, h);
            let rows = recording.time.len();
            assert_eq!(rows, 2940 / n + 1);
            let found = (column(&recording, "h"), column(&recording, "v"));
            let wanted = (heights[..rows].to_vec(), velocities[..rows].to_vec());
            assert_eq!(found, wanted, "event mode {event_mode}, early return {early_return}, steps of {h} s");
        }
    }
    // FMPy also records the values before and after an event.
    let ([_, v], bounces) = expected(1);
    let columns = fmpy(
        &fmu,
        "stop_time=3, output_interval=1e-2, use_event_mode=True, early_return_allowed=True, record_events=True",
    );
    let jumps: Vec<(f64, f64)> = (1..columns[0].len())
        .filter(|&i| columns[0][i].to_bits() == columns[0][i - 1].to_bits())
        .map(|i| (columns[0][i], columns[2][i]))
        .collect();
    for (k, (t, after)) in bounces.iter().zip(&jumps) {
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let wanted = (*k as f64 * 1e-3, v[*k]);
        assert!((t - wanted.0).abs() < 1e-12 && *after == wanted.1, "{t} {after}, {wanted:?}");
    }
    assert_eq!(jumps.len(), bounces.len(), "{jumps:?}");
}

/// The example of the importer integrates by Euler's method, too, so it has the bounces of the original.
#[test]
fn the_example_for_model_exchange_runs() {
    let ([h, v], bounces) = expected(1);
    for version in BOTH {
        let events = model_exchange::run(&archive("bouncing-ball", version), 3.0).unwrap();
        assert_eq!(events.len(), bounces.len(), "{version:?}: {events:?}");
        for (event, k) in events.iter().zip(&bounces) {
            assert!(
                event[0] == h[*k] && (event[1] - v[*k]).abs() < 1e-9,
                "{version:?}: {event:?}, {} {}",
                h[*k],
                v[*k]
            );
        }
    }
}

#[test]
fn model_exchange_finds_the_bounce() {
    for version in BOTH {
        let recording = run(exchange(), &archive("bouncing-ball", version), &[("h", "2")], 0.7, 1e-3);
        let fall = (2.0 * 2.0 / 9.81_f64).sqrt();
        let (h, t) = (column(&recording, "h")[700], 0.7 - fall);
        assert!((h - (0.7 * 9.81 * fall * t - 0.5 * 9.81 * t * t)).abs() < 1e-8, "{version:?}: {h}");
    }
}
