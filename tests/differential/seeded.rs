//! Ten faults, each seeded into an FMU without faults: the checker reports all of them.

use crate::findings::{check, listed};
use crate::musts;
use std::path::Path;

/// A fault: its name, the checks of which one reports it, in FMI 2.0 or in FMI 3.0, and the change of an entry of the archive, its
/// name and its contents; `None` if
/// nothing was changed.
type Fault = (&'static str, &'static [&'static str], fn(&str, &str) -> Option<(String, String)>);

const DESCRIPTION: &str = "modelDescription.xml";

/// Replaces a text of the description once.
fn replaced(name: &str, text: &str, from: &str, to: &str) -> Option<(String, String)> {
    (name == DESCRIPTION && text.contains(from)).then(|| (name.to_owned(), text.replacen(from, to, 1)))
}

/// The text between two others.
fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    let rest = &text[text.find(before)? + before.len()..];
    Some(&rest[..rest.find(after)?])
}

/// The value reference of the output `held`, or in FMI 2.0 its index.
fn held(text: &str) -> Option<String> {
    if text.contains("fmiVersion=\"3.0\"") {
        return between(text, "name=\"held\" valueReference=\"", "\"").map(str::to_owned);
    }
    let before = &text[..text.find("name=\"held\"")?];
    Some(before.matches("<ScalarVariable ").count().to_string())
}

/// The element of the output `held` in the model structure.
fn output(text: &str) -> Option<String> {
    let (of, held) =
        (if text.contains("fmiVersion=\"3.0\"") { "Output valueReference" } else { "Unknown index" }, held(text)?);
    let start = format!("<{of}=\"{held}\"");
    let at = text.find(&start)?;
    Some(text[at..at + text[at..].find("/>")? + 2].to_owned())
}

const FAULTS: [Fault; 10] = [
    ("a value reference twice", &["V02a", "V02b"], |name, text| {
        let own = between(text, "name=\"held\" valueReference=\"", "\"")?;
        replaced(name, text, &format!("name=\"held\" valueReference=\"{own}\""), "name=\"held\" valueReference=\"1\"")
    }),
    ("a missing unit", &["V09a"], |name, text| {
        let unit = between(text, "<Unit name=\"s\">", "</Unit>")?;
        replaced(name, text, &format!("<Unit name=\"s\">{unit}</Unit>"), "")
    }),
    ("a start value outside of its range", &["V07"], |name, text| {
        let start = between(text, "max=\"10\" start=\"", "\"")?;
        replaced(name, text, &format!("max=\"10\" start=\"{start}\""), "max=\"10\" start=\"20\"")
    }),
    ("a continuous parameter", &["V04a"], |name, text| {
        let (from, to) =
            ("causality=\"parameter\" variability=\"fixed\"", "causality=\"parameter\" variability=\"continuous\"");
        replaced(name, text, from, to)
    }),
    ("the token of another model", &["L00"], |name, text| {
        let attribute = if text.contains("fmiVersion=\"3.0\"") { "instantiationToken=\"{" } else { "guid=\"{" };
        let own = between(text, attribute, "}")?;
        replaced(name, text, own, "00000000-0000-0000-0000-000000000000")
    }),
    ("a library of another name", &["X03"], |name, text| {
        let renamed = name.starts_with("binaries/").then(|| name.replace(".so", "_.so"));
        renamed.map(|renamed| (renamed, text.to_owned()))
    }),
    ("a name twice", &["V01a"], |name, text| replaced(name, text, "name=\"held\"", "name=\"tau\"")),
    ("a dependency on nothing", &["S03a"], |name, text| {
        let old = output(text)?;
        let new = old.split(" dependencies").next()?.trim_end_matches("/>").to_owned() + " dependencies=\"99999\"/>";
        replaced(name, text, &old, &new)
    }),
    ("a missing output", &["S01"], |name, text| replaced(name, text, &output(text)?, "")),
    ("a real number that is an integer", &["L00", "P00"], |name, text| {
        let variable = between(text, "name=\"held\"", "/>")?;
        if text.contains("fmiVersion=\"3.0\"") {
            let plain = variable.split(" declaredType").next()?;
            return replaced(
                name,
                text,
                &format!("<Float64 name=\"held\"{variable}"),
                &format!("<Int32 name=\"held\"{plain}"),
            );
        }
        let plain = variable.replace("<Real declaredType=\"Number\"", "<Integer");
        replaced(name, text, &format!("name=\"held\"{variable}"), &format!("name=\"held\"{plain}"))
    }),
];

/// Seeds all faults; returns their number.
pub(crate) fn all(seed: u64, file: &Path, folder: &Path) -> u64 {
    let mut seeded = 0;
    for (fault, ids, change) in FAULTS {
        let to = folder.join(format!("seeded-{seeded}.fmu"));
        rewrite(file, &to, change).unwrap_or_else(|| panic!("seed {seed}, {}: {fault} is not seeded", file.display()));
        let report = check(&to, ids);
        let found = musts(&report);
        assert!(!found.is_empty(), "seed {seed}, {}: {fault}: {}", file.display(), listed(&report));
        std::fs::remove_file(to).unwrap();
        seeded += 1;
    }
    seeded
}

/// Copies an archive with one entry changed; `None` if none was.
fn rewrite(from: &Path, to: &Path, change: impl Fn(&str, &str) -> Option<(String, String)>) -> Option<()> {
    let mut source = zip::ZipArchive::new(std::fs::File::open(from).unwrap()).unwrap();
    let mut target = zip::ZipWriter::new(std::fs::File::create(to).unwrap());
    let (options, mut changed) = (zip::write::SimpleFileOptions::default(), false);
    for index in 0..source.len() {
        let mut bytes = Vec::new();
        let name = {
            let mut entry = source.by_index(index).unwrap();
            if entry.name().unwrap() == DESCRIPTION {
                std::io::copy(&mut entry, &mut bytes).unwrap();
            }
            entry.name().unwrap().into_owned()
        };
        match change(&name, &String::from_utf8(bytes).unwrap()) {
            Some((_, text)) if name == DESCRIPTION => {
                target.start_file(&name, options).unwrap();
                std::io::Write::write_all(&mut target, text.as_bytes()).unwrap();
                changed = true;
            }
            Some((renamed, _)) => {
                target.raw_copy_file_rename(source.by_index_raw(index).unwrap(), renamed).unwrap();
                changed = true;
            }
            None => target.raw_copy_file(source.by_index_raw(index).unwrap()).unwrap(),
        }
    }
    target.finish().unwrap();
    changed.then_some(())
}
