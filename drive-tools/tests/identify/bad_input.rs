//! Wrong files, units, signs and phases, and the messages of the command.

use crate::bench::{Bench, IDEAL, REAL, Row, T_S, file};
use crate::{given, of, refused, value};
use drive_tools::identify::columns::Naming;
use drive_tools::identify::{Complex, Options};
use std::f64::consts::PI;

/// A record with every row changed.
fn changed(rows: &[Row], change: impl Fn(&Row) -> Row) -> String {
    file(&rows.iter().map(change).collect::<Vec<_>>())
}

#[test]
fn wrong_columns_are_named() {
    let rows = Bench { time: 2.0, ..REAL }.run();
    let swapped = |places: [usize; 3]| changed(&rows, |r| Row { i: places.map(|k| r.i[k]), ..*r });
    let turned = changed(&rows, |r| Row { theta: (-r.theta).rem_euclid(2.0 * PI), ..*r });
    let against = changed(&rows, |r| Row { i: r.i.map(|i| -i), ..*r });
    let shifted: Vec<Row> = rows.windows(2).map(|w| Row { u: w[1].u, ..w[0] }).collect();
    for (text, message) in [
        (swapped([0, 2, 1]), "phases b and c swapped"),
        (swapped([1, 0, 2]), "phases a and b swapped"),
        (swapped([2, 1, 0]), "phases a and c swapped"),
        (swapped([1, 2, 0]), "the currents one phase"),
        (swapped([2, 0, 1]), "the currents one phase"),
        (against, "the currents with the other sign"),
        (turned, "theta with the other sign"),
        (file(&shifted), "voltages one row later"),
    ] {
        let found = of(&text, &given()).unwrap();
        for name in ["R_s", "L_d", "L_q", "psi_M", "J"] {
            let why = refused(&found, name);
            assert!(why.contains(message) && why.ends_with(": correct the columns"), "{message}: {name}: {why}");
        }
    }
}

/// More current: resistance and inductances shrink in proportion, the magnet flux stays.
#[test]
fn values_scale_with_the_sensors() {
    let rows = REAL.run();
    let more = changed(&rows, |r| Row { i: r.i.map(|x| 1.02 * x), ..*r });
    let (one, other) = (of(&file(&rows), &given()).unwrap(), of(&more, &given()).unwrap());
    for (name, ratio) in [("L_d", 1.02), ("L_q", 1.02), ("psi_M", 1.0)] {
        assert!((value(&one, name) / value(&other, name) / ratio - 1.0).abs() < 1e-3, "{name}");
    }
    assert!(one.notes.iter().any(|note| note.starts_with("values scale with the sensors")));
}

/// The load measures the torque of currents and voltages: no value is given if their scales differ.
#[test]
fn scales_that_contradict_each_other_are_named() {
    let rows = REAL.run();
    for (i, u, load, message) in [
        (0.5_f64.sqrt(), 1.0, 1.0, "RMS values"),
        (1.0, 0.5_f64.sqrt(), 1.0, "RMS values"),
        (1.0, 3.0_f64.sqrt(), 1.0, "line-to-line voltages"),
        (1.5, 1.0, 1.0, "have another scale: check their units"),
        (1.0, 1.0, -1.0, "the load has the other sign"),
        (1.0, 1.0, 1.0 / 1.3558, "lbf.ft"),
        (1.0, 1.0, 10.197, "kgf.cm"),
        (1.0, 1.0, 100.0, "N.cm"),
        (1.0, 1.0, 1000.0, "mN.m"),
        (1.0, 1.0, 1e-3, "kN.m"),
        (1.0, 1e-3, 1.0, "currents or voltages are divided by 1000"),
    ] {
        let other = changed(&rows, |r| Row { i: r.i.map(|x| i * x), u: r.u * u, load: r.load * load, ..*r });
        let found = of(&other, &given()).unwrap();
        for name in ["R_s", "psi_M", "J"] {
            let why = refused(&found, name);
            println!("{why}");
            assert!(
                why.starts_with("currents and voltages give ") && why.contains(message),
                "{message}: {name}: {why}"
            );
        }
    }
}

#[test]
fn bad_files_are_named_by_place() {
    let rows = Bench { time: 0.5, ..IDEAL }.run();
    let good = file(&rows);
    of(&good, &given()).unwrap();
    let line = |k: usize| good.lines().nth(k).unwrap().to_owned();
    let with = |k: usize, text: &str| good.replacen(&line(k), text, 1);
    let cell = |k: usize, place: usize, value: &str| {
        let row = line(k);
        let mut cells: Vec<_> = row.split(',').collect();
        cells[place] = value;
        with(k, &cells.join(","))
    };
    let degrees = changed(&rows, |r| Row { theta: r.theta * 180.0 / PI, ..*r });
    let milli = changed(&rows, |r| Row { i: r.i.map(|i| 1e3 * i), ..*r });
    let slow = changed(&rows, |r| Row { t: 1e3 * r.t, ..*r });
    let uneven = changed(&rows, |r| Row { t: r.t + if r.t > 0.3 { 0.3 * T_S } else { 0.0 }, ..*r });
    let one_sign = changed(&rows, |r| Row { i: [r.i[0], -r.i[1], r.i[2]], ..*r });
    let still = changed(&rows, |r| Row { u: Complex::new(0.0, 0.0), ..*r });
    let duties = good.replace("u_alpha,u_beta", "d_a,d_b").replace("tau_load", "d_c");
    for (text, message) in [
        (String::new(), "r.csv: is empty, expected a header with the names of variables"),
        (line(0), "r.csv: has no row of numbers below t [s],u_alpha"),
        (with(100, &line(99)), "r.csv:101:t: 0.0098 s does not follow 0.0098 s: time must increase"),
        (
            uneven,
            "r.csv:3003:t: the step of 1.3000e-4 s is not the usual 1.0000e-4 s: record at a constant rate, or give --rate",
        ),
        (slow, "r.csv:3:t: the rate of 10"),
        (cell(100, 3, "NaN"), "r.csv:101:i_a: \"NaN\" is not a finite number"),
        (cell(100, 3, "inf"), "r.csv:101:i_a: \"inf\" is not a finite number"),
        (cell(100, 3, ""), "r.csv:101:i_a: \"\" is not a finite number"),
        (with(100, &line(100).replacen(',', ",1,", 1)), "r.csv:101: expected 9 numbers, found 10"),
        (cell(5, 8, "x"), "r.csv:6:u_dc: \"x\" is not a finite number"),
        (good.lines().take(1000).collect::<Vec<_>>().join("\n"), "r.csv: has 999 rows; expected at least 2000"),
        (good.replace("u_alpha", "a").replace("u_beta", "b"), "r.csv: has no voltage: expected u_a,u_b,u_c"),
        (good.replace("i_a,", "x,").replace("i_b,", "y,"), "r.csv: has no current: expected two of i_a,i_b,i_c"),
        (good.replace("theta", "x"), "r.csv: has no angle: add theta (electrical) or angle (mechanical)"),
        (good.replace("t [s]", "x"), "r.csv: has no column t; add it, name it with --map t=..., or give --rate in Hz"),
        (good.replace("u_dc", "u_dc [mV]"), "r.csv:5"),
        (good.replace("u_dc", "u_dc [kg]"), "r.csv: u_dc [kg]: the unit is not known; u_dc has one of V"),
        (good.replace("u_beta", "u_alpha"), "r.csv: two columns contain u_alpha: remove one"),
        (duties, "r.csv:5"),
        (degrees, "r.csv:1513:theta: jumps by -359.2884 rad, more than a turn, between two rows"),
        (milli, "r.csv:5"),
        (one_sign, "r.csv:"),
        (still, "r.csv: all voltages are 0: record the commanded voltages"),
    ] {
        let error = of(&text, &given()).map(|_| ()).expect_err(message);
        println!("{error}");
        assert!(error.starts_with(message) && error.lines().count() == 1, "{error}, not {message}");
    }
    for (text, part) in [
        (changed(&rows, |r| Row { theta: r.theta * 180.0 / PI, ..*r }), "check its unit, for example theta [deg]"),
        (changed(&rows, |r| Row { i: r.i.map(|i| 1e3 * i), ..*r }), "times --current 15: check the units"),
        (changed(&rows, |r| Row { u: r.u * 1e3, ..*r }), "is above u_dc = 540"),
        (
            changed(&rows, |r| Row { i: [r.i[0], -r.i[1], r.i[2]], ..*r }),
            "check signs, units and the wiring of the sensors",
        ),
    ] {
        let error = of(&text, &given()).map(|_| ()).expect_err(part);
        assert!(error.contains(part), "{error}, not {part}");
    }
}

#[test]
fn bad_options_are_named() {
    let good = file(&Bench { time: 0.5, ..IDEAL }.run());
    let pair = |a: &str, b: &str| vec![(a.to_owned(), b.to_owned())];
    let mapped = |map, units| Options { naming: Naming { map, units }, ..given() };
    for (options, message) in [
        (Options { n_p: None, ..given() }, "--n-p is missing: give the number of pole pairs"),
        (Options { n_p: Some(0), ..given() }, "--n-p 0: expected 1 to 200"),
        (Options { current: Some(-1.0), ..given() }, "--current -1: expected a number above 0"),
        (Options { u_dc: Some(f64::NAN), ..given() }, "--u-dc NaN: expected a number above 0"),
        (Options { delay: Some(9.0), ..given() }, "--delay 9: expected 0 to 4 samples"),
        (Options { every: Some(0), ..given() }, "--every 0: expected 1 to 100 samples"),
        (Options { zero: Some((0.0, 1e-3)), ..given() }, "--zero 0:0.001 has 10 rows; expected at least 20"),
        (mapped(pair("amps", "i_a"), Vec::new()), "--map amps: a record has no such column: use one of t, u_a,"),
        (mapped(pair("i_a", "I1"), Vec::new()), "r.csv: --map i_a=I1: the record has no column I1"),
        (mapped(Vec::new(), pair("i_a", "V")), "r.csv: i_a [V]: the unit is not known; i_a has one of A"),
    ] {
        let error = of(&good, &options).map(|_| ()).expect_err(message);
        assert!(error.starts_with(message) && error.lines().count() == 1, "{error}, not {message}");
    }
}

/// Clipped currents, a gap, and open gates are omitted: the other rows yield the same machine.
#[test]
fn what_a_record_lacks_is_left_out() {
    let rows = REAL.run();
    let most = 5.0;
    let clipped = changed(&rows, |r| Row { i: r.i.map(|i| i.clamp(-most, most)), ..*r });
    let gap: Vec<Row> = rows.iter().enumerate().filter(|(k, _)| !(9000..9400).contains(k)).map(|(_, r)| *r).collect();
    // Wrong currents where the gates are open.
    let open: String = file(&rows)
        .lines()
        .enumerate()
        .map(|(k, line)| match k {
            0 => format!("{line},enable\n"),
            9000..9400 => format!(
                "{},7,-3,-4,{},0\n",
                line.split(',').take(3).collect::<Vec<_>>().join(","),
                line.split(',').skip(6).collect::<Vec<_>>().join(",")
            ),
            _ => format!("{line},1\n"),
        })
        .collect();
    for (what, text) in [("clipped", clipped), ("gap", file(&gap)), ("open", open)] {
        let found = of(&text, &given()).unwrap_or_else(|e| panic!("{what}: {e}"));
        for (name, truth) in [("L_q", REAL.L_q), ("psi_M", REAL.psi_M), ("J", REAL.J)] {
            let width = found.values.iter().find(|v| v.name == name).unwrap().half_width;
            let error = value(&found, name) / truth - 1.0;
            println!("{what}: {name} {:+.2} % +- {:.2} %", 100.0 * error, 100.0 * width);
            assert!(error.abs() < width, "{what}: {name}");
        }
        let noted = found
            .notes
            .iter()
            .any(|note| note.starts_with("clipped currents: ") && note.ends_with("rows were left out"));
        assert_eq!(noted, what == "clipped", "{:?}", found.notes);
    }
    // Without rest at the start, the offset remains in the currents, and the report says so.
    let late = of(&file(&rows[600..]), &given()).unwrap();
    assert!(
        late.notes.iter().any(|note| note.starts_with("no row is without voltage at the start")),
        "{:?}",
        late.notes
    );
}
