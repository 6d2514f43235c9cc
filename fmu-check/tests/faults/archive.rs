//! Faults of the archive, by its raw headers.

use crate::zip::{Entry, write};
use crate::{check, listed, violated};

const XML: &str = include_str!("fmu.xml");

fn good() -> Vec<Entry> {
    let text = |name: &str| Entry::new(name, b"text");
    vec![Entry::new("modelDescription.xml", XML.as_bytes()), text("documentation/index.html"), text("sources/fmu.c")]
}

#[test]
fn each_fault_is_found_by_its_check() {
    type Fault = (&'static str, &'static [&'static str], fn(&mut Vec<Entry>));
    let faults: &[Fault] = &[
        ("nothing", &[], |_| {}),
        ("backslash", &["Z01b", "Z02b"], |e| e.push(Entry::new("a\\b", b""))),
        ("absolute", &["Z01b", "Z02b"], |e| e.push(Entry::new("/etc/passwd", b""))),
        ("outside", &["Z01b"], |e| e.push(Entry::new("resources/../../x", b""))),
        ("drive", &["Z01b", "Z01c", "Z02b"], |e| e.push(Entry::new("c:/x", b""))),
        // ZIP and FMI allow these.
        ("dot", &["Z01c", "Z02b"], |e| e.push(Entry::new("./x", b""))),
        ("colon", &["Z01c"], |e| e.push(Entry::new("resources/a:b", b""))),
        ("umlaut", &["Z01c"], |e| e.push(Entry::new("resources/\u{e4}", b""))),
        ("method 12", &["Z01d", "Z01j"], |e| e[2].method = 12),
        ("descriptor without deflate", &["Z01e"], |e| e[2].flags = 8),
        ("needs 4.5", &["Z01f"], |e| e[2].needed = 45),
        ("encrypted", &["Z01g"], |e| e[2].flags = 1),
        ("another disk", &["Z01h"], |e| e[2].disk = 1),
        ("link", &["Z01i"], |e| e[2].mode = 0o120_777),
        ("checksum", &["Z01j"], |e| e[2].crc = Some(7)),
        ("twice", &["Z01k"], |e| e.push(e[2].clone())),
        ("file and folder", &["Z01k", "Z02b"], |e| e.push(Entry::new("sources", b""))),
        ("other name inside", &["Z01k"], |e| e[2].local_name = Some("sources/xyz.c".into())),
        ("a source that is missing", &["Z10"], |e| {
            let sources = "><SourceFiles><File name=\"fmu.c\"/><File name=\"gone.c\"/></SourceFiles></CoSimulation>";
            let xml =
                XML.replacen("canSerializeFMUstate=\"true\"/>", &format!("canSerializeFMUstate=\"true\"{sources}"), 1);
            e[0] = Entry::new("modelDescription.xml", xml.as_bytes());
        }),
        ("no implementation", &["Z02a"], |e| {
            e.pop();
        }),
        ("foreign root", &["Z02b"], |e| e.push(Entry::new("readme.txt", b""))),
        ("no documentation", &["Z04a"], |e| {
            e.remove(1);
        }),
        ("licenses without entry", &["Z04b"], |e| e.push(Entry::new("documentation/licenses/x", b""))),
        ("odd platform", &["Z03"], |e| e.push(Entry::new("binaries/My Computer/x", b""))),
        ("extra", &["Z06"], |e| e.push(Entry::new("extra/stuff/x", b""))),
        ("header", &["Z07"], |e| e.push(Entry::new("sources/fmi2Functions.h", b""))),
        ("other name of the binary", &["X03", "B10"], |e| e.push(Entry::new("binaries/linux64/Other.so", b"x"))),
        // OpenModelica names its sources so.
        ("sources by relative paths", &[], |e| {
            let sources = "><SourceFiles><File name=\"./fmu.c\"/></SourceFiles></CoSimulation>";
            let xml =
                XML.replacen("canSerializeFMUstate=\"true\"/>", &format!("canSerializeFMUstate=\"true\"{sources}"), 1);
            e[0] = Entry::new("modelDescription.xml", xml.as_bytes());
        }),
    ];
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    for (what, ids, fault) in faults {
        let mut entries = good();
        fault(&mut entries);
        write(&path, &entries);
        let report = check(&path, &["archive", "xml"]);
        let expected: Vec<_> = ids.iter().filter(|id| **id != "B10").copied().collect();
        assert_eq!(violated(&report), expected, "{what}: {}", listed(&report));
    }
    let other = dir.path().join("x.zip");
    write(&other, &good());
    assert_eq!(violated(&check(&other, &["archive"])), ["Z01a"]);
}

/// Faults of sources/buildDescription.xml, in both standards, and a folder instead of a library.
#[test]
fn faults_of_the_build_description() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.fmu");
    let set = "<SourceFileSet><SourceFile name=\"fmu.c\"/></SourceFileSet>";
    let one = format!("<BuildConfiguration modelIdentifier=\"Small\">{set}</BuildConfiguration>");
    let good = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?><fmiBuildDescription fmiVersion=\"3.0\">{one}</fmiBuildDescription>"
    );
    let faults: [(&[&str], String); 8] = [
        (&[], good.clone()),
        (&["Z08"], good.replace("</BuildConfiguration>", "")),
        (&["Z08"], good.replace("name=\"fmu.c\"", "name=\"model.c\"")),
        (&["Z08"], good.replace(&one, &format!("{one}{one}"))),
        (&["Z08"], good.replace(&one, "")),
        (&["Z08"], good.replace("modelIdentifier=\"Small\"", "modelIdentifier=\"Large\"")),
        (&["Z08"], good.replace("fmiBuildDescription", "buildDescription")),
        (&[], good.replace(&one, &format!("{one}{}", one.replace("\">", "\" platform=\"x86_64-linux\">")))),
    ];
    for xml in [XML, include_str!("fmu3.xml")] {
        for (expected, build) in &faults {
            let description = Entry::new("modelDescription.xml", xml.as_bytes());
            let build = Entry::new("sources/buildDescription.xml", build.as_bytes());
            write(&path, &[description, build, Entry::new("sources/fmu.c", b"text")]);
            let report = check(&path, &["Z07", "Z08"]);
            assert_eq!(violated(&report), *expected, "{}", listed(&report));
        }
    }
    let other = good.replace("fmiVersion=\"3.0\"", "fmiVersion=\"2.0\"");
    for (xml, expected) in [(XML, &[][..]), (include_str!("fmu3.xml"), &["Z08"])] {
        let description = Entry::new("modelDescription.xml", xml.as_bytes());
        let build = Entry::new("sources/buildDescription.xml", other.as_bytes());
        write(&path, &[description, build, Entry::new("sources/fmu.c", b"text")]);
        assert_eq!(violated(&check(&path, &["Z08"])), expected);
    }
    let folder = Entry::new("binaries/linux64/Small.so/x", b"x");
    write(&path, &[Entry::new("modelDescription.xml", XML.as_bytes()), Entry::new("sources/fmu.c", b"x"), folder]);
    assert_eq!(violated(&check(&path, &["X03"])), ["X03"]);
}
