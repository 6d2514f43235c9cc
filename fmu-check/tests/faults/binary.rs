//! Faults of the binary: a small C FMU that breaks no rule, with one fault at a time.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::{check, compile, each, library, listed, pack, pack_with, violated};
use fmu_check::Verdict;

/// Fault, and the checks that must fail.
const FAULTS: &[(&str, &[&str])] = &[
    ("NONE", &[]),
    ("B01", &["B01"]),
    ("B02b", &["B02b"]),
    ("B07a", &["B07a"]),
    ("B08", &["B08"]),
    ("X02b", &["X02b"]),
    ("X04", &["X04"]),
    ("L01a", &["L01a"]),
    ("L01b", &["L01b"]),
    ("L01c", &["L01c"]),
    ("L02", &["L02"]),
    ("L03", &["L03"]),
    ("L05", &["L05"]),
    ("L06", &["L06"]),
    ("L07", &["L07"]),
    ("L08", &["L08"]),
    ("L08u", &["L08u"]),
    ("L08n", &["L08n"]),
    ("L09a", &["L09a"]),
    ("L10", &["L10"]),
    ("L12", &["L12"]),
    ("V06b", &["V06b"]),
    ("V07", &["V07"]),
    ("V12", &["V12"]),
    ("S04", &["S04", "G16"]),
    ("G01a", &["G01a"]),
    ("G01b", &["G01b"]),
    ("G02", &["G02"]),
    ("G03b", &["G03b"]),
    ("G03c", &["G03c"]),
    ("G04", &["G04"]),
    ("G07b", &["G07b"]),
    ("G08", &["G08"]),
    ("T01a", &["T01a"]),
    ("T01b", &["T01b"]),
    ("T01c", &["T01c"]),
    ("T02a", &["T02a"]),
    ("T03", &["T03"]),
    ("T04", &["T04"]),
    ("T06b", &["T01a", "T06b"]),
    ("T07", &["T07"]),
    // It does not free the state either.
    ("F01a", &["F01a", "F01l"]),
    ("F01b", &["F01b"]),
    // A state that lacks a variable; the checks that take F02a for granted are not determined.
    ("F02", &["F02a", "F02b"]),
    ("F03b", &["F03b"]),
    ("F04a", &["F04a"]),
    ("F04b", &["F04b"]),
    ("F04c", &["F04c"]),
    ("F04d", &["F04d"]),
    ("G_L1b", &["G-L1b"]),
    ("G_L2a", &["G-L2a"]),
    ("G_L2b", &["G-L2b"]),
    ("G_L3a", &["G-L3a"]),
    ("G_L3b", &["G-L3b"]),
    ("G_L3f", &["G-L3b"]),
    ("G_L3i", &["G-L3b"]),
    ("G_L3n", &["G-L3b"]),
    ("G_L3p", &["G-L3b"]),
    ("G_L3u", &["G-L3b"]),
    ("G_L3x", &["G-L3b"]),
    ("G_L3y", &["G-L3b"]),
    ("G_L4", &["G-L4"]),
    ("G_L5", &["G-L5"]),
    ("M01", &["M01"]),
    ("I02", &["I02"]),
    ("B06", &["B06"]),
    ("B08f", &["B08f"]),
    ("B08p", &["B08p"]),
    ("B08p_child", &["B08p"]),
    ("B08p_daemon", &["B08p"]),
    ("G06", &["G06"]),
    ("L11", &["L11"]),
    ("T05", &["T05"]),
    ("T10p", &["T10p"]),
    ("Z09", &["Z09"]),
    ("CRASH", &["L00"]),
];

/// Faults at run time, for both standards, that only these groups look at.
const RUNNING: &[(&str, &[&str])] = &[
    ("NONE", &[]),
    // Two in one call come in the wrong order.
    ("G10", &["G10"]),
    ("G11", &["G11"]),
    // An input is forgotten after a step, or silently limited.
    ("G12", &["G12", "T03"]),
    ("G12c", &["G12"]),
    ("G13", &["G13"]),
    ("G14", &["G14"]),
    // One parameter cannot be set, and another does not keep its value.
    ("G04o", &["G04", "G06"]),
    // Reset keeps a tunable parameter, a counter after an event, a text.
    ("L06t", &["L06"]),
    ("L06e", &["L06"]),
    ("L06s", &["L06"]),
    ("L13", &["L13"]),
    // A state lacks a text.
    ("F02x", &["F02b"]),
    ("F01l", &["F01l"]),
    // A state saved into an existing one.
    ("F01e", &["F01l"]),
    ("G_L3c", &["G-L3c"]),
    // A dependency whose factor is 0 at the start.
    ("S04h", &["S04"]),
    // 700 bytes per instance, and memory that is never accessed.
    ("B07m", &["B07a"]),
    ("B07u", &["B07a"]),
];
const RUNNING_GROUPS: [&str; 9] = ["access", "time", "L06", "L13", "F01l", "F02b", "G-L3c", "B07a", "S04"];

/// Faults of both standards, devised without knowledge of the checks.
const INVENTED: &[(&str, &[&str])] = &[
    ("NONE", &[]),
    // Values that cannot be read, are not written, or can only be set alone.
    ("G15", &["G15"]),
    ("G15r", &["G15"]),
    ("G10s", &["G10"]),
    ("G04b", &["G04"]),
    // A parameter that the initialization overwrites; an output that it does not compute, or that can be set.
    ("G04i", &["G04"]),
    ("G16", &["G16"]),
    ("G03i", &["G03b"]),
    ("G01n", &["G01b"]),
    ("A01", &["G06"]),
    ("L06m", &["L06"]),
    ("L07t", &["L07"]),
    // The independent variable: steps of any size, the start, other start times.
    ("T06n", &["T06b"]),
    ("T06i", &["T06b"]),
    ("T01s", &["T01a"]),
    ("T03l", &["T03"]),
    // The remainder of a communication step that is not a multiple of the internal step is lost.
    ("T03r", &["T03"]),
    ("T03w", &["T03"]),
    ("T01k", &["T01c"]),
    ("L04g", &["L04a"]),
    // One state at a time, one without its mode, bytes without a parameter.
    ("F01o", &["F01b"]),
    ("F01m", &["F01a", "F04a"]),
    ("F04v", &["F04a"]),
    ("G_L4s", &["G-L4"]),
    ("G_L2c", &["G-L2a"]),
    ("G_L3r", &["G-L3a"]),
    ("V12s", &["V12"]),
    ("L10y", &["L10"]),
    ("B07s", &["B07a", "B07l"]),
    // A state that moves only if it was read after the last step.
    ("T14", &["T03", "T14"]),
    // A stop time without a tolerance for rounding.
    ("L12r", &["L12r"]),
    // A history of all steps, freed with the instance.
    ("B07l", &["B07l"]),
    ("B08e", &["B08"]),
];
const INVENTED_CHECKS: [&str; 27] = [
    "G15", "G10", "G04", "G16", "G03b", "G01b", "G06", "L06", "L07", "T06b", "T01a", "T03", "F01b", "F01a", "F04a",
    "G-L4", "B07a", "B07l", "L12r", "T14", "B08", "G-L2a", "G-L3a", "V12", "L10", "T01c", "L04a",
];

/// State that stays altered or is left behind: each case is found by this check.
const AROUND: &[(&str, &[&str])] = &[
    ("LOCALE", &["B08g"]),
    ("TIMER", &["B08g"]),
    ("ALARM", &["B08g"]),
    ("PROFILE", &["B08g"]),
    ("BRIEF", &[]),
    ("AFFINITY", &["B08g"]),
    ("NICE", &["B08g"]),
    ("LIMITS", &["B08g"]),
    ("UMASK", &["B08g"]),
    ("ENVIRONMENT", &["B08g"]),
    ("CHDIR", &["B08g"]),
    ("TEMPORARY", &["B08p"]),
    ("WRITES", &["B08r"]),
    ("B08o", &["B08p"]),
];

/// Faults specific to FMI 3.0, and one of each group.
const FAULTS3: &[(&str, &[&str])] = &[
    ("NONE", &[]),
    ("B02a", &["B02a"]),
    ("X02b", &["X02b"]),
    ("C03", &["C03"]),
    ("G01c", &["G01c"]),
    // References count over all types.
    ("G02", &["G02", "V12"]),
    ("G05b", &["G05b"]),
    ("G05m", &["G05m"]),
    ("G06", &["G06"]),
    ("G08", &["G08"]),
    ("L01b", &["L01b"]),
    ("L03", &["L03"]),
    ("L06", &["L06"]),
    ("L07", &["L07"]),
    ("L08", &["L08"]),
    ("L08u", &["L08u"]),
    ("L09a", &["L09a"]),
    ("L12", &["L12"]),
    ("T02a", &["T02a"]),
    ("T05", &["T05"]),
    ("T06a", &["T06a"]),
    ("T06c", &["T06c"]),
    ("F02", &["F02a", "F02b"]),
    ("G_L1b", &["G-L1b"]),
    ("G_L4", &["G-L4"]),
    ("G_L3n", &["G-L3b"]),
    ("G_L3u", &["G-L3b"]),
];

#[test]
fn each_fault_is_found_by_its_check() {
    all(2, FAULTS);
}

#[test]
fn each_fault_of_fmi_3_is_found_by_its_check() {
    all(3, FAULTS3);
}

/// Each fault is found by its check, and the other checks of its group find nothing; without a fault or a run, no check does.
fn all(version: u8, faults: &[(&str, &[&str])]) {
    let whole = |fault: &str| ["NONE", "CRASH", "L01a", "X04", "F02", "G02", "L07"].contains(&fault);
    let groups = |ids: &[&str]| {
        let of = |group: &&fmu_check::Group| group.checks.iter().any(|check| ids.contains(&check.id));
        fmu_check::GROUPS.iter().filter(of).map(|group| group.name).collect::<Vec<_>>()
    };
    each(faults, |row| {
        let only = if whole(row.0) { Vec::new() } else { groups(row.1) };
        one_of(version, row, &only)
    });
}

/// Each fault is found by its check, and these checks find nothing else.
fn all_of(version: u8, faults: &[(&str, &[&str])], only: &[&str]) {
    each(faults, |row| one_of(version, row, only));
}

fn one_of(version: u8, (fault, ids): &(&str, &[&str]), only: &[&str]) -> Result<(), String> {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(version, fault) else {
        eprintln!("there is no C compiler: not tested");
        return Ok(());
    };
    let report = check(&pack(dir.path(), version, fault, &binary), only);
    if violated(&report) == *ids { Ok(()) } else { Err(format!("{fault}: {}", listed(&report))) }
}

#[test]
fn each_fault_at_run_time_is_found_by_its_check() {
    for version in [2, 3] {
        all_of(version, RUNNING, &RUNNING_GROUPS);
        all_of(version, INVENTED, &INVENTED_CHECKS);
        // Its later reads there return arbitrary data.
        all_of(version, &[("G05", &["G05"])], &["G05"]);
        all_of(version, AROUND, &["B08g", "B08p", "B08r"]);
        // Alone, because its file would also appear in the other rows.
        all_of(version, &[("SHARED", &["B08p"])], &["B08g", "B08p", "B08r"]);
    }
    all_of(3, &[("T06e", &["T06a"])], &["time"]);
    // An instance that is freed changes the others.
    all_of(2, &[("L04f", &["L04a"])], &["L04a", "S04", "L13"]);
    // Another second, in another process; or in the other of two runs, if it begins between them.
    let dir = tempfile::tempdir().unwrap();
    if let Some(binary) = compile(2, "T10t") {
        let report = check(&pack(dir.path(), 2, "T10t", &binary), &["T10", "T10p"]);
        assert!([["T10p"], ["T10"]].iter().any(|ids| violated(&report) == ids), "{}", listed(&report));
    }
    for file in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
        if file.file_name().to_string_lossy().starts_with("fault-of-fmu-check") {
            let _ = std::fs::remove_file(file.path());
        }
    }
}

/// An FMU that has derivatives of its outputs.
#[test]
fn derivatives_of_outputs() {
    let dir = tempfile::tempdir().unwrap();
    let flag = "canGetAndSetFMUstate=\"true\"";
    let xml = include_str!("fmu.xml").replace(flag, &format!("{flag} maxOutputDerivativeOrder=\"1\""));
    for (fault, ids) in [("NONE", &[][..]), ("T09e", &["T09"]), ("T09o", &["T09s"]), ("T09v", &["T09s"])] {
        let Some(binary) = compile(2, &format!("DERIVATIVES {fault}")) else { return };
        let report = check(&pack_with(dir.path(), fault, &xml, &binary), &["time", "lifecycle"]);
        assert_eq!(violated(&report), ids, "{fault}: {}", listed(&report));
    }
    // A mean over the step has no value at its beginning; and an FMU that interpolates inputs takes their derivatives.
    let claims = xml.replace(flag, &format!("{flag} canInterpolateInputs=\"true\""));
    for (fault, xml, ids) in [("MEAN", &xml, &[][..]), ("NONE", &claims, &["T11"])] {
        let Some(binary) = compile(2, &format!("DERIVATIVES {fault}")) else { return };
        let report = check(&pack_with(dir.path(), fault, xml, &binary), &["time"]);
        assert_eq!(violated(&report), ids, "{fault}: {}", listed(&report));
    }
}

/// In FMI 2.0, linux64 does not specify the processor; importers expect x86-64 there.
#[test]
fn a_library_for_another_processor() {
    let dir = tempfile::tempdir().unwrap();
    let Some(mut binary) = compile(2, "NONE") else { return };
    // The number of AArch64 in the header of an ELF file.
    binary[18..20].copy_from_slice(&[0xb7, 0]);
    let report = check(&pack(dir.path(), 2, "other", &binary), &["B13", "B00"]);
    assert_eq!(violated(&report), ["B00", "B13"], "{}", listed(&report));
    let loads = report.finding("B00").unwrap();
    assert_eq!(loads.level, fmu_check::Level::Must, "{loads:?}");
    assert!(listed(&report).contains("it is for aarch64-linux, and this computer is x86_64-linux"), "{loads:?}");
}

/// Two strings of one instance have separate values.
#[test]
fn two_strings_that_share_a_buffer() {
    let dir = tempfile::tempdir().unwrap();
    let second = "<ScalarVariable name=\"title\" valueReference=\"1\" causality=\"parameter\" variability=\"fixed\" initial=\"exact\">\
                  <String start=\"a\"/></ScalarVariable>\n  </ModelVariables>";
    let xml = include_str!("fmu.xml").replace("</ModelVariables>", second);
    for (faults, ids) in [("TITLE", &[][..]), ("TITLE G05s", &["G05"])] {
        let Some(binary) = compile(2, faults) else { return };
        let report = check(&pack_with(dir.path(), "title", &xml, &binary), &["G05"]);
        assert_eq!(violated(&report), ids, "{faults}: {}", listed(&report));
    }
}

/// Two names of one value that both can be set, with two start values: one must, and none of what follows from it.
#[test]
fn two_names_of_one_value() {
    let dir = tempfile::tempdir().unwrap();
    let second = "<ScalarVariable name=\"offset\" valueReference=\"4\" causality=\"parameter\" variability=\"tunable\" initial=\"exact\">\
                  <Real start=\"3\"/></ScalarVariable>\n  </ModelVariables>";
    let xml = include_str!("fmu.xml").replace("</ModelVariables>", second);
    let Some(binary) = compile(2, "NONE") else { return };
    let report = check(&pack_with(dir.path(), "alias", &xml, &binary), &[]);
    assert_eq!(violated(&report), ["V02b"], "{}", listed(&report));
}

#[test]
fn faults_of_the_file() {
    let dir = tempfile::tempdir().unwrap();
    if compile(2, "NONE").is_none() {
        return;
    }
    for (more, ids) in [
        (&["-Wl,-z,nodelete"][..], &["B02c", "B07b"][..]),
        (&["-Wl,-rpath,/opt/lib"], &["B03r"]),
        (&["-Wl,-z,execstack"], &["B05"]),
        (&["-Wl,--no-as-needed", "-lgcc_s"], &["B03"]),
        (&["-Wl,-z,x86-64-v3"], &["B11"]),
        (&["-DFAULT_AUTHOR"], &["B12"]),
        (&["-DSOURCE", "-g"], &[]),
    ] {
        let binary = library("fmu.c", more, "NONE").unwrap();
        let report = check(&pack(dir.path(), 2, "flags", &binary), &["binary", "instances"]);
        assert_eq!(violated(&report), ids, "{more:?}: {}", listed(&report));
    }
    let xml = include_str!("fmu.xml");
    for (start, ids) in
        [("/home/ann/table.csv", &["B12"][..]), ("D:\\tables\\x.csv", &["B12"]), ("/etc/hosts", &[]), ("x.csv", &[])]
    {
        let xml = xml.replace("<String start=\"a\"/>", &format!("<String start=\"{start}\"/>"));
        let report = check(&pack_with(dir.path(), "start", &xml, b"no library"), &["B12"]);
        assert_eq!(violated(&report), ids, "{start}: {}", listed(&report));
    }
    let report = check(&pack(dir.path(), 2, "text", b"no library"), &[]);
    assert_eq!(violated(&report), ["B00", "B10"], "{}", listed(&report));
    let open = report.findings.iter().filter(|f| matches!(f.verdict, Verdict::NotDetermined(_))).count();
    assert!(open > 40, "a check that cannot run does not pass");
}
