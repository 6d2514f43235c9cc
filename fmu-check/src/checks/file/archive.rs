//! The archive, by its raw headers (FMI 2.0.5, 2.3; FMI 3.0.2, 2.5).

use crate::check::{Check, Levels, Run, Verdict};
use crate::checks::file::shared::clock_rules::{build_description, source_files};
use crate::checks::file::shared::layered::manifests;
use crate::fmu_file::FmuFile;
use crate::level::Level;
use crate::zip_headers::{Entry, Header, is_inside};
use model_description::FmiVersion;

const ZIP: &str = "2.0.5, 2.3; 3.0.2, 2.5";
const STRUCTURE: &str = "2.0.5, 2.3; 3.0.2, 2.5.1";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "Z01a", clause: ZIP, levels: Levels::MUST, run: Run::File(extension),
        requirement: "The file extension is .fmu.",
        tried: "Reads the name of the file.", fix: "Name the archive NAME.fmu." },
    Check { id: "Z01b", clause: "2.0.5, 2.3; 3.0.2, 2.5", levels: Levels::MUST, run: Run::File(names),
        requirement: "Entries have relative names with forward slashes and stay inside the archive.",
        tried: "Reads the names of all entries in both headers.",
        fix: "Write entry names relative to the root of the FMU, with forward slashes and without `.` and `..`." },
    Check { id: "Z01c", clause: ZIP, levels: Levels::SHOULD, run: Run::File(portable),
        requirement: "Entry names are ASCII, without `:` and without `.` as a part, so that every system can store them.",
        tried: "Reads the names of all entries.", fix: "Use plain ASCII names; keep other letters inside the files." },
    Check { id: "Z01d", clause: ZIP, levels: Levels::MUST, run: Run::File(methods),
        requirement: "Entries are stored or deflated (method 0 or 8).",
        tried: "Reads the compression methods in both headers of every entry.", fix: "Set the ZIP library to deflate or store." },
    Check { id: "Z01e", clause: ZIP, levels: Levels::MUST, run: Run::File(descriptors),
        requirement: "A data descriptor (general purpose bit 3) occurs only with deflate.",
        tried: "Reads the general purpose bits in both headers of every entry.",
        fix: "Let the ZIP library write to a file it can seek in, or deflate every entry." },
    Check { id: "Z01f", clause: ZIP, levels: Levels::MUST, run: Run::File(needed),
        requirement: "The version needed to extract is at most 2.0, so ZIP64 is not used.",
        tried: "Reads the version needed in both headers of every entry, and the end records.",
        fix: "Switch ZIP64 off, and write the version 2.0 into the headers." },
    Check { id: "Z01g", clause: ZIP, levels: Levels::MUST, run: Run::File(encryption),
        requirement: "No entry is encrypted.",
        tried: "Reads the general purpose bits of every entry.", fix: "Write the archive without a password." },
    Check { id: "Z01h", clause: ZIP, levels: Levels::MUST, run: Run::File(split),
        requirement: "The archive is neither split nor spanned.",
        tried: "Reads the disk numbers of the end record and of every entry.", fix: "Write the archive as one file." },
    Check { id: "Z01i", clause: ZIP, levels: Levels::MUST, run: Run::File(links),
        requirement: "The archive contains no symbolic links.",
        tried: "Reads the file attributes of every entry.", fix: "Pack the file itself instead of the link." },
    Check { id: "Z01j", clause: "2.0.5, 2.3; 3.0.2, 2.5", levels: Levels::MUST, run: Run::File(contents),
        requirement: "Every entry unpacks and matches its checksum.",
        tried: "Unpacks every entry and compares its size and checksum with the headers.",
        fix: "Write the archive again; if it was intact before, check the disk and the transfer." },
    Check { id: "Z01k", clause: "APPNOTE 4.3", levels: Levels::HARD, run: Run::File(headers),
        requirement: "Entry names are unique, no file has the name of a folder, and local and central headers agree.",
        tried: "Compares the names of all entries, and the central header of each with its local header.",
        fix: "Add every file once, and let one library write both headers." },
    Check { id: "Z02a", clause: "2.0.5, 2.3; 3.0.2, 2.5", levels: Levels::MUST, run: Run::File(implementation),
        requirement: "The archive contains at least one implementation: binaries or sources.",
        tried: "Looks for files below binaries/ and sources/.", fix: "Pack the library below binaries/PLATFORM/, or the sources with buildDescription.xml." },
    Check { id: "Z02b", clause: STRUCTURE, levels: Levels::SHOULD, run: Run::File(root),
        requirement: "The root contains only the entries of the standard.",
        tried: "Reads the first part of every entry's name.", fix: "Move other files to extra/REVERSE.DOMAIN/ or to resources/." },
    Check { id: "Z03", clause: "2.0.5, 2.3; 3.0.2, 2.5.1.4.1", levels: Levels::SHOULD, run: Run::File(platforms),
        requirement: "Folders below binaries/ have the platform names of the standard.",
        tried: "Reads the names of the folders below binaries/.",
        fix: "Name them win64, linux64 or darwin64 in FMI 2.0, x86_64-windows, x86_64-linux, aarch64-darwin and so on in FMI 3.0." },
    Check { id: "X03", clause: "2.0.5, 2.3; 3.0.2, 2.2.2", levels: Levels::MUST, run: Run::File(base_names),
        requirement: "Every platform folder contains a library named after modelIdentifier, a C identifier.",
        tried: "Compares modelIdentifier of every interface with the libraries in each platform folder.",
        fix: "Name the library modelIdentifier.so, .dll or .dylib, and use letters, digits and underscores only." },
    Check { id: "Z04a", clause: STRUCTURE, levels: Levels::SHOULD, run: Run::File(documentation),
        requirement: "The archive contains documentation/index.html.",
        tried: "Looks for documentation/index.html.", fix: "Add a page that describes the model and its variables." },
    Check { id: "Z04b", clause: "2.0.5, 2.3; 3.0.2, 2.5.1.1.1", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::File(licenses),
        requirement: "documentation/licenses contains license.txt or license.html (in FMI 3.0 also license.spdx) as its entry point.",
        tried: "Looks for the entry point of documentation/licenses.", fix: "Add license.txt, license.html or in FMI 3.0 license.spdx." },
    Check { id: "Z04c", clause: "2.0.5, 2.3; 3.0.2, 2.5.1.1", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::File(dependencies),
        requirement: "An FMU that needs an execution tool describes it in documentation/externalDependencies.txt or .html.",
        tried: "Reads needsExecutionTool and looks for documentation/externalDependencies.",
        fix: "Describe which tool is needed, in which version, and how the FMU finds it." },
    Check { id: "Z05", clause: "3.0.2, 2.5.1", levels: Levels(None, Some(Level::Must)), run: Run::File(pictures),
        requirement: "documentation/diagram.svg and terminalsAndIcons/icon.svg are accompanied by a PNG.",
        tried: "Looks for the PNG beside each of the two SVG files.", fix: "Render the SVG and pack both." },
    Check { id: "Z06", clause: "2.0.5, 2.3; 3.0.2, 2.5.1.6", levels: Levels::SHOULD, run: Run::File(extra),
        requirement: "Folders below extra/ have reverse domain names.",
        tried: "Reads the names of the folders below extra/.", fix: "Name the folder after a domain of yours, reversed, for example extra/org.example." },
    Check { id: "Z07", clause: "3.0.2, 2.5.1.3", levels: Levels(Some(Level::Should), Some(Level::Should)), run: Run::File(sources),
        requirement: "Sources include sources/buildDescription.xml and exclude the headers of the standard.",
        tried: "Reads the names of the entries below sources/.",
        fix: "Add buildDescription.xml, and leave out the headers of the standard, which the importer has." },
    Check { id: "Z08", clause: "3.0.2, 2.4.10", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::File(build_description),
        requirement: "sources/buildDescription.xml is well-formed, of the version of the FMU, and names existing files, with one build configuration \
            per model and platform.",
        tried: "Reads the file and looks up the files that it names.", fix: "Generate it with the list of the sources." },
    Check { id: "Z10", clause: "2.0.5, 4.3.1", levels: Levels(Some(Level::Must), None), run: Run::File(source_files),
        requirement: "Every file in SourceFiles is in the folder sources/.",
        tried: "Looks each file of SourceFiles up in the archive.", fix: "Pack the file, or remove it from SourceFiles." },
    Check { id: "I03", clause: "3.0.2, 2.6", levels: Levels(None, Some(Level::Should)), run: Run::File(manifests),
        requirement: "A manifest of a layered standard (extra/*/fmi-ls-manifest.xml) is well-formed and gives name, version and description in its \
            namespace.",
        tried: "Parses every extra/*/fmi-ls-manifest.xml.",
        fix: "Give the root element fmi-ls-name, fmi-ls-version and fmi-ls-description in the namespace of manifests." },
];

/// A finding for each entry that the rule refuses.
fn each_entry(fmu: &FmuFile, rule: impl Fn(&Entry) -> Option<String>) -> Verdict {
    let say = |entry| rule(entry).map(|why| format!("entry {:?}: {why}", entry.name()));
    Verdict::of(fmu.zip.entries.iter().filter_map(say).collect())
}

/// Both headers of an entry with their names.
fn headers_of(entry: &Entry) -> impl Iterator<Item = (&'static str, &Header)> {
    [("central", Some(&entry.central)), ("local", entry.local.as_ref())].into_iter().filter_map(|(n, h)| Some((n, h?)))
}

fn extension(fmu: &FmuFile) -> Verdict {
    let found = fmu.path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    Verdict::holds(found == "fmu", || format!("the extension is {found:?}, expected fmu"))
}

fn names(fmu: &FmuFile) -> Verdict {
    each_entry(fmu, |entry| {
        let name = entry.name();
        (name.is_empty() || !is_inside(&name)).then(|| "is not a plain relative path with forward slashes".into())
    })
}

/// Windows cannot store colons in names, and `.` is not a folder name on any system; ZIP and FMI forbid neither.
fn portable(fmu: &FmuFile) -> Verdict {
    each_entry(fmu, |entry| {
        let name = entry.name();
        let odd = !entry.central.name.is_ascii() || name.contains(':') || name.split('/').any(|part| part == ".");
        odd.then(|| "is not a name that every system can store".into())
    })
}

fn methods(fmu: &FmuFile) -> Verdict {
    each_entry(fmu, |entry| {
        headers_of(entry)
            .find(|(_, h)| ![0, 8].contains(&h.method))
            .map(|(n, h)| format!("{n} header: method {}", h.method))
    })
}

fn descriptors(fmu: &FmuFile) -> Verdict {
    each_entry(fmu, |entry| {
        let bad = headers_of(entry).find(|(_, h)| h.flags & 8 != 0 && h.method != 8);
        bad.map(|(n, h)| format!("{n} header: bit 3 with method {}", h.method))
    })
}

fn needed(fmu: &FmuFile) -> Verdict {
    let mut findings = Vec::new();
    if fmu.zip.zip64 {
        findings.push("the archive has a ZIP64 end record".into());
    }
    for entry in &fmu.zip.entries {
        if let Some((n, h)) = headers_of(entry).find(|(_, h)| h.needed & 0xff > 20) {
            let (major, minor) = ((h.needed & 0xff) / 10, h.needed % 10);
            findings.push(format!("entry {:?}: {n} header: version needed {major}.{minor}", entry.name()));
        }
    }
    Verdict::of(findings)
}

fn encryption(fmu: &FmuFile) -> Verdict {
    each_entry(fmu, |entry| {
        headers_of(entry).find(|(_, h)| h.flags & 0x41 != 0).map(|(n, _)| format!("{n} header: encrypted"))
    })
}

fn split(fmu: &FmuFile) -> Verdict {
    let other = |e: &Entry| (e.disk != 0).then(|| format!("entry {:?}: on disk {}", e.name(), e.disk));
    let mut findings: Vec<_> = fmu.zip.entries.iter().filter_map(other).collect();
    if fmu.zip.split {
        findings.push("the end record names more than one disk".into());
    }
    Verdict::of(findings)
}

fn links(fmu: &FmuFile) -> Verdict {
    each_entry(fmu, |entry| entry.is_link().then(|| "is a symbolic link".into()))
}

fn contents(fmu: &FmuFile) -> Verdict {
    match (fmu.unpack_errors.is_empty(), fmu.own_errors.first()) {
        (true, Some(cause)) => Verdict::NotDetermined(format!("this computer could not store an entry: {cause}")),
        _ => Verdict::of(fmu.unpack_errors.clone()),
    }
}

fn headers(fmu: &FmuFile) -> Verdict {
    let entries = &fmu.zip.entries;
    let mut names: Vec<_> = entries.iter().map(|e| e.central.name.to_ascii_lowercase()).collect();
    names.sort();
    let twice = names.windows(2).filter(|w| w[0] == w[1]);
    let mut findings: Vec<_> =
        twice.map(|w| format!("entry {:?}: occurs twice (ignoring case)", String::from_utf8_lossy(&w[0]))).collect();
    let both = fmu.zip.files_and_folders();
    findings.extend(both.iter().map(|name| format!("entry {name:?}: is a file, and the folder of other entries")));
    for entry in entries {
        let c = &entry.central;
        match &entry.local {
            None => findings.push(format!("entry {:?}: has no local header", entry.name())),
            Some(l) if l.name != c.name => findings.push(format!(
                "entry {:?}: is {:?} in its local header",
                entry.name(),
                String::from_utf8_lossy(&l.name)
            )),
            // With a data descriptor the local header may omit the sizes.
            Some(l) => {
                let sizes = l.flags & 8 != 0 || (l.crc, l.packed, l.size) == (c.crc, c.packed, c.size);
                if !sizes || l.method != c.method || l.flags != c.flags {
                    findings.push(format!("entry {:?}: local and central header differ", entry.name()));
                }
            }
        }
    }
    Verdict::of(findings)
}

/// Whether the archive has a file in a folder.
fn has_files(fmu: &FmuFile, folder: &str) -> bool {
    fmu.zip.names().iter().any(|n| n.starts_with(folder) && !n.ends_with('/'))
}

fn implementation(fmu: &FmuFile) -> Verdict {
    let present = has_files(fmu, "sources/") || has_files(fmu, "binaries/");
    Verdict::holds(present, || "the archive contains neither binaries/ nor sources/".into())
}

fn root(fmu: &FmuFile) -> Verdict {
    let folders = ["binaries", "documentation", "extra", "resources", "sources", "terminalsAndIcons"];
    each_entry(fmu, |entry| {
        let name = entry.name();
        let known = match name.split_once('/') {
            Some((folder, _)) => folders.contains(&folder),
            None => name == "modelDescription.xml" || (fmu.version == FmiVersion::V2 && name == "model.png"),
        };
        (!known).then(|| "is not part of the standard's structure; move it to extra/".into())
    })
}

fn platforms(fmu: &FmuFile) -> Verdict {
    let old = ["win32", "win64", "linux32", "linux64", "darwin32", "darwin64"];
    let tuple = |folder: &str| {
        let parts: Vec<_> = folder.split('-').collect();
        let arch = ["aarch32", "aarch64", "riscv32", "riscv64", "x86", "x86_64", "ppc32", "ppc64"];
        let plain =
            |p: &&str| !p.is_empty() && p.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
        (2..=3).contains(&parts.len()) && (arch.contains(&parts[0]) || plain(&parts[0])) && parts[1..].iter().all(plain)
    };
    let mut folders: Vec<_> = fmu
        .zip
        .names()
        .iter()
        .filter_map(|n| Some(n.strip_prefix("binaries/")?.split_once('/')?.0.to_owned()))
        .collect();
    folders.sort();
    folders.dedup();
    let known = |f: &&String| match fmu.version {
        FmiVersion::V2 => old.contains(&f.as_str()) || tuple(f),
        FmiVersion::V3 => tuple(f),
    };
    Verdict::of(folders.iter().filter(|f| !known(f)).map(|f| format!("binaries/{f} is not a platform tuple")).collect())
}

fn base_names(fmu: &FmuFile) -> Verdict {
    let description = match &fmu.description {
        Ok(description) => description,
        Err(cause) => return Verdict::NotDetermined(cause.clone()),
    };
    let mut identifiers: Vec<&str> =
        [&description.model_exchange, &description.scheduled_execution, &description.co_simulation]
            .into_iter()
            .flatten()
            .map(|interface| interface.model_identifier.as_str())
            .collect();
    identifiers.sort_unstable();
    // Interfaces may share a library.
    identifiers.dedup();
    let folders: Vec<String> = fmu.zip.names();
    let folder = folders.iter().find(|n| {
        let parts: Vec<_> = n.split('/').collect();
        let extension = |name: &str| [".so", ".dll", ".dylib"].iter().any(|e| name.ends_with(e));
        parts.len() > 3 && parts[0] == "binaries" && extension(parts[2])
    });
    if let Some(name) = folder {
        return Verdict::Violated(vec![format!("{name}: a folder has the name of a library")]);
    }
    if fmu.binaries.is_empty() {
        return Verdict::NotApplicable("there are no shared libraries".into());
    }
    let sources = has_files(fmu, "sources/");
    let mut findings = Vec::new();
    for identifier in &identifiers {
        let c_name = identifier.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
            && identifier.bytes().next().is_some_and(|b| !b.is_ascii_digit());
        if !c_name {
            findings.push(format!("modelIdentifier={identifier:?} is not a C identifier"));
        }
    }
    let mut folders: Vec<_> = fmu.binaries.iter().map(|b| b.folder.as_str()).collect();
    folders.sort_unstable();
    folders.dedup();
    for folder in folders {
        let extension = if folder.contains("win") && !folder.contains("darwin") {
            "dll"
        } else if folder.contains("darwin") {
            "dylib"
        } else {
            "so"
        };
        let present = |identifier: &&str| {
            let name = format!("binaries/{folder}/{identifier}.{extension}");
            fmu.binaries.iter().any(|b| b.name == name)
        };
        // Another interface may come as sources.
        if sources && identifiers.iter().any(present) {
            continue;
        }
        for identifier in &identifiers {
            let name = format!("binaries/{folder}/{identifier}.{extension}");
            if !fmu.binaries.iter().any(|b| b.name == name) {
                let present: Vec<_> =
                    fmu.binaries.iter().filter(|b| b.folder == folder).map(|b| b.name.as_str()).collect();
                findings.push(format!("{name} is missing; the folder contains {}", present.join(", ")));
            }
        }
    }
    Verdict::of(findings)
}

fn documentation(fmu: &FmuFile) -> Verdict {
    let present = fmu.zip.find("documentation/index.html").is_some();
    Verdict::holds(present, || "documentation/index.html is missing".into())
}

fn licenses(fmu: &FmuFile) -> Verdict {
    let names = fmu.zip.names();
    if !names.iter().any(|n| n.starts_with("documentation/licenses/")) {
        return Verdict::NotApplicable("there is no documentation/licenses".into());
    }
    let entries = match fmu.version {
        FmiVersion::V2 => &["license.txt", "license.html"][..],
        FmiVersion::V3 => &["license.txt", "license.html", "license.spdx"][..],
    };
    let present = entries.iter().any(|e| names.contains(&format!("documentation/licenses/{e}")));
    Verdict::holds(present, || format!("documentation/licenses has none of {}", entries.join(", ")))
}

fn dependencies(fmu: &FmuFile) -> Verdict {
    match fmu.interface() {
        None => Verdict::NotDetermined("the description cannot be read".into()),
        Some(i) if !i.needs_execution_tool() => Verdict::NotApplicable("needsExecutionTool is false".into()),
        Some(i) => {
            let present = ["txt", "html"]
                .iter()
                .any(|e| fmu.zip.find(&format!("documentation/externalDependencies.{e}")).is_some());
            Verdict::holds(present, || {
                format!(
                    "line {}: needsExecutionTool is true, but documentation/externalDependencies is missing",
                    i.line
                )
            })
        }
    }
}

fn pictures(fmu: &FmuFile) -> Verdict {
    each_entry(fmu, |entry| {
        let png = entry
            .name()
            .strip_suffix(".svg")
            .filter(|n| !n.starts_with("extra/") && !n.starts_with("resources/"))
            .map(|n| format!("{n}.png"))?;
        let known = png == "terminalsAndIcons/icon.png" || png == "documentation/diagram.png";
        (known && fmu.zip.find(&png).is_none()).then(|| format!("{png} is missing"))
    })
}

fn extra(fmu: &FmuFile) -> Verdict {
    if !fmu.zip.names().iter().any(|n| n.starts_with("extra/") && n != "extra/") {
        return Verdict::NotApplicable("there is no extra/".into());
    }
    each_entry(fmu, |entry| {
        let name = entry.name();
        let first = name.strip_prefix("extra/").filter(|r| !r.is_empty())?.split('/').next().unwrap_or_default();
        (!first.contains('.')).then(|| "is not below a reverse domain name".into())
    })
}

fn sources(fmu: &FmuFile) -> Verdict {
    let names = fmu.zip.names();
    if !has_files(fmu, "sources/") {
        return Verdict::NotApplicable("there are no sources".into());
    }
    let mut findings = Vec::new();
    if fmu.version == FmiVersion::V3 && fmu.zip.find("sources/buildDescription.xml").is_none() {
        findings.push("sources/buildDescription.xml is missing".into());
    }
    let header = |n: &&String| {
        let file = n.rsplit('/').next().unwrap_or_default();
        ["Functions.h", "FunctionTypes.h", "TypesPlatform.h", "PlatformTypes.h"]
            .iter()
            .any(|h| file == format!("fmi2{h}") || file == format!("fmi3{h}"))
    };
    findings.extend(names.iter().filter(header).map(|n| format!("entry {n:?}: is a header file of the standard")));
    Verdict::of(findings)
}
