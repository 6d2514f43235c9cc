//! Legal behavior, and behavior that is not the FMU's fault, violates no must; a lesser violation is reported at its lower level.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use crate::zip::{Entry, write};
use crate::{check, compile, library, listed, pack, pack_with, verdict, violated};
use fmu_check::{Level, Verdict, report::Report};
use std::path::Path;

/// The violated checks of a level.
fn at(report: &Report, level: Level) -> Vec<&'static str> {
    report.violated().filter(|f| f.level == level).map(|f| f.id).collect()
}

/// The report on the small FMU with one property.
fn small(dir: &Path, version: u8, property: &str, only: &[&str]) -> Option<Report> {
    let binary = compile(version, property)?;
    Some(check(&pack(dir, version, property, &binary), only))
}

/// An FMU may end the simulation: Discard with fmi2Terminated (FMI 2.0.5, 4.2.3), terminateSimulation (FMI 3.0.2, 4.2.1).
#[test]
fn an_fmu_may_end_itself() {
    let dir = tempfile::tempdir().unwrap();
    for version in [2, 3] {
        let Some(report) = small(dir.path(), version, "ENDS", &[]) else { return };
        assert!(violated(&report).is_empty(), "FMI {version}: {}", listed(&report));
        for id in ["L00", "T01c", "T04"] {
            assert!(
                matches!(verdict(&report, id), Verdict::Pass(_)),
                "FMI {version}: {id}: {:?}",
                verdict(&report, id)
            );
        }
        assert!(matches!(verdict(&report, "F02a"), Verdict::NotDetermined(_)), "{:?}", verdict(&report, "F02a"));
    }
}

/// With OK and without an early return, lastSuccessfulTime may deviate (FMI 3.0.2, 4.2.1); but time must advance.
#[test]
fn a_step_may_end_a_little_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let Some(report) = small(dir.path(), 3, "LATE", &["time"]) else { return };
    assert!(violated(&report).is_empty(), "{}", listed(&report));
    let report = small(dir.path(), 3, "STANDS", &["time"]).unwrap();
    assert_eq!((at(&report, Level::Must), at(&report, Level::Should)), (vec![], vec!["T06a"]), "{}", listed(&report));
}

/// An FMU for Model Exchange alone does not need the functions (FMI 2.0.5, 2.3) and flags of co-simulation.
#[test]
fn model_exchange_alone() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = library("exchange.c", &["-DALL_OF_EXCHANGE"], "NONE") else {
        return;
    };
    let xml: Vec<_> = include_str!("exchange2.xml").lines().filter(|line| !line.contains("<CoSimulation")).collect();
    let path = pack_with(dir.path(), "exchange-only", &xml.join("\n"), &binary);
    let report = check(&path, &["B01", "X08", "L00", "E00"]);
    assert!(violated(&report).is_empty(), "{}", listed(&report));
    for id in ["B01", "X08", "E00"] {
        assert!(matches!(verdict(&report, id), Verdict::Pass(_)), "{id}: {:?}", verdict(&report, id));
    }
    assert!(matches!(verdict(&report, "L00"), Verdict::NotApplicable(_)));
    // One function of Model Exchange less, and it is found.
    let binary = library("exchange.c", &[], "NONE").unwrap();
    let report = check(&pack_with(dir.path(), "exchange-less", &xml.join("\n"), &binary), &["B01"]);
    assert_eq!(violated(&report), ["B01"]);
}

/// The manifest of a layered standard is a matter of FMI 3.0 (3.0.2, 2.6), which recommends it.
#[test]
fn manifests_are_of_fmi_3() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let of = |more: &str| {
        let names = "xmlns:a='http://fmi-standard.org/fmi-ls-manifest' a:fmi-ls-name='org.x' a:fmi-ls-version='1'";
        format!("<fmiLayeredStandardManifest {names} {more}/>")
    };
    let (good, bad) = (of("a:fmi-ls-description='x'"), of(""));
    let (xml2, xml3) = (include_str!("fmu.xml"), include_str!("fmu3.xml"));
    for (xml, manifest, expected) in [(xml2, &bad, vec![]), (xml3, &bad, vec!["I03"]), (xml3, &good, vec![])] {
        let manifest = Entry::new("extra/org.x/fmi-ls-manifest.xml", manifest.as_bytes());
        write(&path, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/x.c", b"x"), manifest]);
        let report = check(&path, &["I03"]);
        assert_eq!((at(&report, Level::Must), at(&report, Level::Should)), (vec![], expected), "{}", listed(&report));
    }
}

/// Order 0 is the importer's fault (FMI 2.0.5, 4.2.1): so any answer of the FMU is accepted.
#[test]
fn order_zero_is_not_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let flag = "canGetAndSetFMUstate=\"true\"";
    let xml = include_str!("fmu.xml").replace(flag, &format!("{flag} maxOutputDerivativeOrder=\"1\""));
    for accepts in [false, true] {
        let faults = if accepts { "DERIVATIVES ORDER_ZERO" } else { "DERIVATIVES" };
        let Some(binary) = compile(2, faults) else { return };
        let report = check(&pack_with(dir.path(), "order", &xml, &binary), &["T09", "T09s"]);
        assert!(violated(&report).is_empty(), "{}", listed(&report));
    }
}

/// XML may start with a byte order mark.
#[test]
fn a_byte_order_mark_is_no_must() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let xml = format!("\u{feff}{}", include_str!("fmu.xml"));
    write(&path, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/x.c", b"x")]);
    let report = check(&path, &["xml"]);
    assert_eq!((violated(&report), at(&report, Level::Hard)), (vec!["X01m"], vec!["X01m"]), "{}", listed(&report));
}

/// A library missing on this computer is a should (FMI 2.0.5, 2.3); a missing symbol of the FMU itself is not.
#[test]
fn a_missing_library() {
    let dir = tempfile::tempdir().unwrap();
    let nowhere = dir.path().join("libnowhere.so");
    let empty = dir.path().join("empty.c");
    std::fs::write(&empty, "int nowhere(void) { return 1; }").unwrap();
    let built = std::process::Command::new("cc").args(["-shared", "-o"]).arg(&nowhere).arg(&empty).status();
    if !built.is_ok_and(|status| status.success()) {
        return;
    }
    let more = ["-Wl,--no-as-needed", nowhere.to_str().unwrap()];
    let binary = library("fmu.c", &more, "NONE").unwrap();
    std::fs::remove_file(&nowhere).unwrap();
    let report = check(&pack(dir.path(), 2, "library", &binary), &["binary"]);
    assert_eq!(
        (at(&report, Level::Must), at(&report, Level::Should)),
        (vec![], vec!["B00", "B03"]),
        "{}",
        listed(&report)
    );
    let binary = compile(2, "UNDEFINED").unwrap();
    let report = check(&pack(dir.path(), 2, "symbol", &binary), &["B00"]);
    assert_eq!(at(&report, Level::Must), ["B00"], "{}", listed(&report));
}

/// Limits of this computer are not the FMU's fault: long names, few open files, another working directory.
#[test]
fn our_own_errors() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let long = Entry::new(&format!("resources/{}", "x".repeat(300)), b"x");
    let xml = Entry::new("modelDescription.xml", include_bytes!("fmu.xml"));
    write(&path, &[xml, Entry::new("sources/x.c", b"x"), long]);
    let report = check(&path, &["archive"]);
    assert!(at(&report, Level::Must).is_empty(), "{}", listed(&report));
    assert!(matches!(verdict(&report, "Z01j"), Verdict::NotDetermined(_)), "{:?}", verdict(&report, "Z01j"));
    // Only the check for side effects reports them.
    let Some(report) = small(dir.path(), 2, "CHDIR", &[]) else { return };
    assert_eq!(violated(&report), ["B08g"], "{}", listed(&report));
    let report = small(dir.path(), 2, "FEWFILES", &[]).unwrap();
    assert!(at(&report, Level::Must).is_empty() && at(&report, Level::Should).is_empty(), "{}", listed(&report));
}

/// A file with the name of a folder does not hide the contents of that folder, whichever comes first.
#[test]
fn a_file_beside_a_folder_of_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let Some(binary) = compile(2, "NONE") else { return };
    let binary = Entry::new("binaries/linux64/Small.so", &binary);
    let xml = Entry::new("modelDescription.xml", include_bytes!("fmu.xml"));
    for file in ["binaries", "binaries/linux64"] {
        let file = Entry::new(file, b"");
        for entries in [[&xml, &file, &binary], [&xml, &binary, &file]] {
            write(&path, &entries.map(Clone::clone));
            let report = check(&path, &["archive", "B00", "L00"]);
            assert!(at(&report, Level::Must).is_empty(), "{}", listed(&report));
            assert_eq!(at(&report, Level::Hard), ["Z01k"], "{}", listed(&report));
            for id in ["B00", "L00", "Z01j", "X03"] {
                assert!(matches!(verdict(&report, id), Verdict::Pass(_)), "{id}: {:?}", verdict(&report, id));
            }
        }
    }
}

/// The standards nowhere say bit for bit: a deviation within the tolerance is hard, and the finding has its size.
#[test]
fn rounding_is_no_must() {
    let dir = tempfile::tempdir().unwrap();
    for (property, ids) in [("F02s", &["F02a", "F02b"][..]), ("T05s", &["T05"])] {
        let Some(report) = small(dir.path(), 2, property, &["state", "T05"]) else { return };
        assert!(at(&report, Level::Must).is_empty(), "{property}: {}", listed(&report));
        let hard = at(&report, Level::Hard);
        assert!(ids.iter().all(|id| hard.contains(id)), "{property}: {}", listed(&report));
        assert!(
            listed(&report).contains("e-13, within the tolerance 1e-6")
                || listed(&report).contains("e-12, within the tolerance 1e-6"),
            "{}",
            listed(&report)
        );
    }
    let report = small(dir.path(), 2, "T05", &["T05"]).unwrap();
    assert_eq!(at(&report, Level::Should), ["T05"], "{}", listed(&report));
}

/// A variable that cannot be read between steps cannot be read after Terminate either: a finding of G15, and none of L10.
#[test]
fn a_value_that_could_not_be_read_before_is_not_lost() {
    let dir = tempfile::tempdir().unwrap();
    let Some(report) = small(dir.path(), 2, "L10g", &["L10", "G15"]) else { return };
    assert_eq!(violated(&report), ["G15"], "{}", listed(&report));
    assert!(matches!(verdict(&report, "L10"), Verdict::Pass(_)), "{:?}", verdict(&report, "L10"));
}

/// Logging without a callback is undefined (FMI 3.0.2, 2.3.1), and so is a step of -1: a crash there is hard.
#[test]
fn logging_to_nowhere_is_no_must() {
    let dir = tempfile::tempdir().unwrap();
    let Some(report) = small(dir.path(), 3, "L01b", &["L01b"]) else { return };
    assert_eq!((at(&report, Level::Hard), report.fatal()), (vec!["L01b"], vec!["L01b"]), "{}", listed(&report));
}

/// A state without the time does not lead back. That is one must, and no matter of noSetFMUStatePriorToCurrentPoint, of the
/// variables (the time of the next step is an argument), or of overwriting, serializing and restoring elsewhere.
#[test]
fn a_state_without_the_time() {
    let dir = tempfile::tempdir().unwrap();
    for version in [2, 3] {
        let Some(report) = small(dir.path(), version, "TIME_STAYS", &["state", "T05"]) else { return };
        assert_eq!(violated(&report), ["F02a"], "{}", listed(&report));
        assert!(matches!(verdict(&report, "F02b"), Verdict::Pass(_)), "{:?}", verdict(&report, "F02b"));
        assert!(matches!(verdict(&report, "T05"), Verdict::NotDetermined(_)), "{:?}", verdict(&report, "T05"));
        for id in ["F01b", "F02c", "F03a", "F04a"] {
            let Verdict::NotDetermined(why) = verdict(&report, id) else { panic!("{id}: {:?}", verdict(&report, id)) };
            assert!(why.starts_with("see F02a: "), "{id}: {why}");
        }
    }
}

/// The schema of FMI 3.0 allows any attribute of an interface (fmi3InterfaceType.xsd of 3.0.2). A misspelled flag is false.
#[test]
fn a_misspelled_flag_is_false() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(3, "F02") else { return };
    let xml = include_str!("fmu3.xml").replace("FMUState=", "FMUstate=");
    let report = check(&pack_with(dir.path(), "flag", &xml, &binary), &["xml", "state"]);
    assert_eq!((at(&report, Level::Must), at(&report, Level::Should)), (vec![], vec!["X01s"]), "{}", listed(&report));
    assert!(listed(&report).contains("canSerializeFMUstate"), "{}", listed(&report));
    assert!(matches!(verdict(&report, "F02a"), Verdict::NotApplicable(_)), "{:?}", verdict(&report, "F02a"));
}

/// That the next event never comes is odd; the texts do not forbid it. Nor do they require that a state change is reported:
/// they only forbid to tell one that does not change (FMI 2.0.5, 3.2.2).
#[test]
fn events_that_the_text_leaves_open() {
    let dir = tempfile::tempdir().unwrap();
    let xml = include_str!("exchange2.xml");
    for (property, id) in [("E20s", "E20"), ("E24a", "E24a")] {
        let Some(binary) = library("exchange.c", &[], property) else { return };
        let report = check(&pack_with(dir.path(), property, xml, &binary), &[id]);
        assert_eq!((at(&report, Level::Must), at(&report, Level::Should)), (vec![], vec![id]), "{}", listed(&report));
    }
}

/// An FMU that crashes the importer is reported.
#[test]
fn a_crash_stands_out() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = compile(2, "L08n") else { return };
    let path = pack(dir.path(), 2, "L08n", &binary);
    let report = check(&path, &["lifecycle"]);
    assert_eq!((violated(&report), report.fatal()), (vec!["L08n"], vec!["L08n"]));
    let text = report.text(false);
    assert!(text.contains("L08n   VIOLATED, takes the importer down (hard)"), "{text}");
    assert!(text.contains("An importer would have crashed or hung in: L08n."), "{text}");
    assert!(report.json().unwrap().contains("\"fatal\": true"));
    // One that only answers wrongly does not.
    let report = small(dir.path(), 2, "G01a", &["G01a"]).unwrap();
    assert_eq!((violated(&report), report.fatal()), (vec!["G01a"], vec![]));
}

/// In FMI 2.0 a wrong value reference "has to return with an error" (2.0.5, 2.1.2), and a variable that is not Real states its
/// variability, because continuous is the default (2.0.5, 2.2.7).
#[test]
fn what_fmi_2_requires() {
    let dir = tempfile::tempdir().unwrap();
    for fault in ["G02", "V12"] {
        let Some(report) = small(dir.path(), 2, fault, &["access"]) else { return };
        assert_eq!(at(&report, Level::Must), [fault], "{}", listed(&report));
    }
    let path = dir.path().join("x.fmu");
    let xml = include_str!("fmu.xml").replace("causality=\"output\" variability=\"discrete\"", "causality=\"output\"");
    write(&path, &[Entry::new("modelDescription.xml", xml.as_bytes()), Entry::new("sources/x.c", b"x")]);
    let report = check(&path, &["variables"]);
    assert_eq!(at(&report, Level::Must), ["V05"], "{}", listed(&report));
    assert!(listed(&report).contains("variable n: is a continuous Int32 by default"), "{}", listed(&report));
}

/// Exceeding a limit of the checker is not a fault of the FMU, which is then not run: here it has more files than the checker
/// copies.
#[test]
fn our_own_limits() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let Some(binary) = compile(2, "NONE") else { return };
    let mut entries = vec![
        Entry::new("modelDescription.xml", include_bytes!("fmu.xml")),
        Entry::new("binaries/linux64/Small.so", &binary),
        Entry::new("extra/org.x/x", b"x"),
    ];
    entries.extend((0..10_500).map(|n| Entry::new(&format!("resources/{n}"), b"")));
    write(&path, &entries);
    let report = check(&path, &["I02", "Z09", "B08p", "B08g", "B08r"]);
    assert!(violated(&report).is_empty(), "{}", listed(&report));
    for id in ["I02", "Z09", "B08r"] {
        let Verdict::NotDetermined(why) = verdict(&report, id) else { panic!("{id}: {:?}", verdict(&report, id)) };
        assert!(why.contains("not tried"), "{id}: {why}");
    }
    assert!(matches!(verdict(&report, "B08p"), Verdict::Pass(_)), "{:?}", verdict(&report, "B08p"));
}

/// A settable value need not be readable before the end of the initialization in FMI 2.0; FMI 3.0 lets start values be read in
/// Instantiated by its table and not by its list of calls.
#[test]
fn what_cannot_be_read_has_no_value() {
    let dir = tempfile::tempdir().unwrap();
    let Some(report) = small(dir.path(), 2, "NO_GET", &["access", "lifecycle"]) else { return };
    assert!(violated(&report).is_empty(), "{}", listed(&report));
    let report = small(dir.path(), 3, "NOT_YET", &["access", "lifecycle"]).unwrap();
    assert_eq!((at(&report, Level::Must), at(&report, Level::Should)), (vec![], vec!["V07"]), "{}", listed(&report));
    let library = library("exchange.c", &["-DFMI3"], "NOT_YET").unwrap();
    let report = check(&pack_with(dir.path(), "not-yet", include_str!("exchange3.xml"), &library), &["exchange"]);
    assert!(violated(&report).is_empty(), "{}", listed(&report));
}

/// Without an early return the next communication point is the importer's, regardless of lastSuccessfulTime (FMI 3.0.2, 4.2.1).
#[test]
fn the_importer_chooses_communication_points() {
    let dir = tempfile::tempdir().unwrap();
    let Some(binary) = library("exchange.c", &["-DFMI3"], "LAST") else { return };
    let report = check(&pack_with(dir.path(), "last", include_str!("exchange3.xml"), &binary), &["event-mode", "T06b"]);
    assert!(violated(&report).is_empty(), "{}", listed(&report));
}

/// A restarted integrator may deviate by a few tolerances, and a text of a megabyte is unusual.
#[test]
fn what_can_be_disputed_is_a_should() {
    let dir = tempfile::tempdir().unwrap();
    for (property, ids) in [("F02t", &["F02a", "F02b"][..]), ("SHORT", &["G05"])] {
        let Some(report) = small(dir.path(), 2, property, &["state", "T05", "G05"]) else { return };
        assert_eq!(
            (at(&report, Level::Must), at(&report, Level::Should)),
            (vec![], ids.to_vec()),
            "{}",
            listed(&report)
        );
    }
}

/// Explicit steps of a stiff model must be short: if the checker's own integrator diverges, this is not the FMU's fault.
#[test]
fn a_stiff_model_is_integrated_in_short_steps() {
    let dir = tempfile::tempdir().unwrap();
    for (xml, options) in [(include_str!("exchange2.xml"), &[][..]), (include_str!("exchange3.xml"), &["-DFMI3"])] {
        let Some(binary) = library("exchange.c", options, "STIFF") else { return };
        let report = check(&pack_with(dir.path(), "stiff", xml, &binary), &["E00", "E01", "E05", "E12", "E15"]);
        assert!(violated(&report).is_empty(), "{}", listed(&report));
        let Verdict::Pass(notes) = verdict(&report, "E00") else { panic!("{:?}", verdict(&report, "E00")) };
        assert!(notes.iter().any(|note| note.contains("stiff")), "{notes:?}");
    }
}
