//! The binary as a file: its format, its exports and its requirements (FMI 2.0.5, 2.3; FMI 3.0.2, 2.5).

use crate::check::{Check, Levels, Run, Verdict};
use crate::checks::file::shared::libraries::{ALL3, COMMON2, COSIMULATION2, EXCHANGE2, libraries};
use crate::checks::file::shared::paths::paths;
use crate::encoding::or_null;
use crate::fmu_file::{Binary, FmuFile};
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use fmu_import::elf::{FLOOR, NEEDED, dynamic, is_system, newest_glibc, strings};
use fmu_import::machine;
use fmu_import::raw::Text;
use model_description::FmiVersion;
use object::elf;
use object::read::elf::{ElfFile64, ProgramHeader};
use object::{Architecture, BinaryFormat, Object, ObjectSection, ObjectSymbol};
use std::cell::Cell;

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "B00", clause: "2.0.5, 2.3; 3.0.2, 2.5.1.4", levels: Levels::MUST, run: Run::Probe(loads),
        requirement: "The archive contains a binary for this platform, and it loads (should, if a shared library is missing on this machine).",
        tried: "Loads the binary for this platform in a separate process.",
        fix: "Link helpers statically or pack them beside the library, with the search path $ORIGIN; ldd shows what is missing." },
    Check { id: "B10", clause: "2.0.5, 2.3; 3.0.2, 2.5.1.4", levels: Levels::MUST, run: Run::File(format),
        requirement: "Every binary is a shared library for the platform of its folder.",
        tried: "Reads the format and the processor of every library.", fix: "Build each platform with its own compiler target, as a shared library." },
    Check { id: "B13", clause: "2.0.5, 2.3", levels: Levels(Some(Level::Should), None), run: Run::File(expected_processor),
        requirement: "Libraries in linux64 and win64 are for x86-64, which importers expect there.",
        tried: "Reads the processor of every library in these folders.", fix: "Use a folder with the platform name of FMI 3.0, such as aarch64-linux." },
    Check { id: "B01", clause: "2.0.5, 2.3; 3.0.2, 2.5", levels: Levels::MUST, run: Run::File(exports),
        requirement: "Every binary exports all functions of the standard; in FMI 2.0, those of its interface types.",
        tried: "Compares the exported symbols with the functions of the interfaces.",
        fix: "Export every function of the standard; those that are not supported return Error." },
    Check { id: "B02a", clause: "3.0.2, 2.5", levels: Levels(None, Some(Level::Should)), run: Run::File(reserved),
        requirement: "No other exported symbol begins with fmi3.",
        tried: "Looks for exported symbols that begin with fmi3 and are not in the standard.", fix: "Rename or hide helper functions." },
    Check { id: "B02b", clause: "hardening", levels: Levels::HARD, run: Run::File(only_standard_functions),
        requirement: "A binary exports only functions of the standards and at most two symbols of the tool.",
        tried: "Lists exported symbols.", fix: "Compile with -fvisibility=hidden and export the functions of the standard." },
    Check { id: "B02c", clause: "hardening", levels: Levels::HARD, run: Run::File(unloadable),
        requirement: "The binary can be unloaded: it has no unique symbols and no NODELETE flag.",
        tried: "Reads the dynamic section and the unique symbols.", fix: "Link without -z nodelete, and compile C++ with -fno-gnu-unique." },
    Check { id: "B03", clause: "2.0.5, 2.3; 3.0.2, 2.5.1.4", levels: Levels::SHOULD, run: Run::File(needed),
        requirement: "A binary needs only C system libraries; the archive contains all others.",
        tried: "Reads the libraries that the binary needs.",
        fix: "Link them statically (-static-libgcc -static-libstdc++, /MT), or pack them beside the binary." },
    Check { id: "B03r", clause: "2.0.5, 2.3; 3.0.2, 2.5.1.4", levels: Levels::SHOULD, run: Run::File(rpath),
        requirement: "Every library search path is $ORIGIN or below.",
        tried: "Reads the search paths of the binary.", fix: "Set the search path to $ORIGIN, and remove the build machine's paths." },
    Check { id: "B04", clause: "hardening", levels: Levels::HARD, run: Run::File(c_library),
        requirement: "Linux binaries need at most version 2.17 (2012) of the GNU C library, so that they load on old systems.",
        tried: "Reads the versions of symbols that the binary needs.", fix: "Build on an old system, or with `zig cc -target x86_64-linux-gnu.2.17`." },
    Check { id: "B05", clause: "hardening", levels: Levels::HARD, run: Run::File(no_dangerous_flags),
        requirement: "Linux binaries have no text relocations and no executable stack.",
        tried: "Reads the program headers.", fix: "Compile with -fPIC, and assembler files with .note.GNU-stack." },
    Check { id: "B11", clause: "hardening", levels: Levels::HARD, run: Run::File(processor),
        requirement: "A binary for x86_64 Linux requires no instruction set beyond x86-64-v1 (according to its note).",
        tried: "Reads the note .note.gnu.property.", fix: "Build for x86-64, not with -march=native." },
    Check { id: "B12", clause: "hardening", levels: Levels::HARD, run: Run::File(paths),
        requirement: "Neither a binary nor the start value of a string contains a path in a user's home folder or on a drive: other machines do not \
            have that path.",
        tried: "Looks for such paths in the data of every library, without debug information and the names of sources, and in start values.",
        fix: "Pack the file into resources/, and build its path from the resource path passed on instantiation." },
    Check { id: "X02b", clause: "2.0.5, 2.1.4; 3.0.2, 2.2.5", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Probe(versions),
        requirement: "GetVersion returns 2.0 or 3.0, and GetTypesPlatform returns default.",
        tried: "Calls GetVersion, and in FMI 2.0 GetTypesPlatform.", fix: "Return the constants of the official headers." },
    Check { id: "B08", clause: "hardening", levels: Levels::HARD, run: Run::Silent(complete_run),
        requirement: "A complete run writes nothing to the console and creates no file in the working directory.",
        tried: "Runs 20 steps, provokes an Error, and watches console and working directory.",
        fix: "Send messages to the log callback, and write files only to a path given by a parameter." },
];

/// The verdict from the findings about each of these libraries; a library that a rule cannot read is not determined.
fn of_each<'f>(
    libraries: impl IntoIterator<Item = &'f Binary>,
    rule: impl Fn(&Binary, &[u8]) -> Result<Vec<String>, String>,
) -> Verdict {
    let found = libraries.into_iter().map(|binary| {
        let named = |text: String| format!("{}: {text}", binary.name);
        let findings = rule(binary, &binary.bytes()?).map_err(named)?;
        Ok(findings.into_iter().map(named).collect::<Vec<_>>())
    });
    found.collect::<Result<Vec<_>, String>>().map_or_else(Verdict::NotDetermined, |all| Verdict::of(all.concat()))
}

/// Findings about each of these libraries, and about each image of a universal one.
fn each(fmu: &FmuFile, rule: impl Fn(&Binary, &object::File<'_>) -> Vec<String>) -> Verdict {
    let libraries = libraries(fmu);
    if libraries.is_empty() {
        return Verdict::NotApplicable("no shared library is named after modelIdentifier".into());
    }
    of_each(libraries, |binary, bytes| {
        let found = machine::images(bytes)?.into_iter().map(|image| Ok(rule(binary, &object::File::parse(image)?)));
        found.collect::<Result<Vec<_>, object::Error>>().map(|all| all.concat()).map_err(|e| e.to_string())
    })
}

/// Findings about each of these libraries that is a 64-bit ELF file.
fn elf(fmu: &FmuFile, rule: impl Fn(&Binary, &ElfFile64<'_>) -> Result<Vec<String>, object::Error>) -> Verdict {
    let found_elf = Cell::new(false);
    let verdict = of_each(libraries(fmu), |binary, bytes| {
        let Ok(file) = ElfFile64::parse(bytes) else { return Ok(Vec::new()) };
        found_elf.set(true);
        rule(binary, &file).map_err(|e| e.to_string())
    });
    let none = || Verdict::NotApplicable("the archive has no 64-bit ELF binary".into());
    if found_elf.get() || matches!(verdict, Verdict::NotDetermined(_)) { verdict } else { none() }
}

fn format(fmu: &FmuFile) -> Verdict {
    let mut findings = Vec::new();
    for binary in libraries(fmu) {
        // The names of FMI 2.0 give the number of bits, not the processor.
        let expected = match binary.folder.as_str() {
            "linux64" => Some((BinaryFormat::Elf, &BITS_64[..])),
            "win64" => Some((BinaryFormat::Pe, &BITS_64[..])),
            "darwin64" => Some((BinaryFormat::MachO, &BITS_64[..])),
            "linux32" => Some((BinaryFormat::Elf, &BITS_32[..])),
            "win32" => Some((BinaryFormat::Pe, &BITS_32[..])),
            other => {
                let mut parts = other.split('-');
                let architecture = match parts.next() {
                    Some("x86_64") => Some(&BITS_64[..1]),
                    Some("aarch64") => Some(&BITS_64[1..]),
                    Some("x86") => Some(&BITS_32[..]),
                    _ => None,
                };
                let format = match parts.next() {
                    Some("linux") => Some(BinaryFormat::Elf),
                    Some("windows") => Some(BinaryFormat::Pe),
                    Some("darwin") => Some(BinaryFormat::MachO),
                    _ => None,
                };
                format.zip(architecture)
            }
        };
        let Some((format, processors)) = expected else { continue };
        let bytes = match binary.bytes() {
            Ok(bytes) => bytes,
            Err(why) => return Verdict::NotDetermined(why),
        };
        let mut find = |what: String| findings.push(format!("{}: {what}", binary.name));
        let images = match machine::images(&bytes) {
            Ok(images) => images,
            Err(why) => {
                find(why);
                continue;
            }
        };
        let mut others = Vec::new();
        let all = images.len();
        for image in images {
            let file = match object::File::parse(image) {
                Ok(file) => file,
                Err(e) => {
                    find(format!("is not a binary: {e}"));
                    continue;
                }
            };
            // A macOS bundle, which dlopen also loads, is not a kind known to the reader.
            let bundle = file.format() == BinaryFormat::MachO && file.kind() == object::ObjectKind::Unknown;
            if file.kind() != object::ObjectKind::Dynamic && !bundle {
                find(format!("is not a shared library but {:?}", file.kind()));
            }
            if file.format() != format || !processors.contains(&file.architecture()) {
                others.push(format!("is {:?} for {:?}", file.format(), file.architecture()));
            }
        }
        // One image of a universal library is enough.
        if others.len() == all {
            others.into_iter().for_each(find);
        }
    }
    Verdict::of(findings)
}

/// FMI 2.0 names no processor, but importers assume x86-64 for linux64 and win64; universal libraries of macOS are common.
fn expected_processor(fmu: &FmuFile) -> Verdict {
    each(fmu, |binary, file| {
        let other = file.architecture() != Architecture::X86_64;
        let found = other && ["linux64", "win64"].contains(&binary.folder.as_str());
        if found { vec![format!("is for {:?}", file.architecture())] } else { Vec::new() }
    })
}

/// 64-bit processors that FMUs are built for.
const BITS_64: [Architecture; 2] = [Architecture::X86_64, Architecture::Aarch64];
/// 32-bit processors.
const BITS_32: [Architecture; 1] = [Architecture::I386];

/// Names of exported symbols; macOS prefixes an underscore.
fn exported(file: &object::File<'_>) -> Vec<String> {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let mut names: Vec<String> = match file.format() {
        BinaryFormat::Elf => file
            .dynamic_symbols()
            .filter(ObjectSymbol::is_definition)
            .filter_map(|s| s.name().ok().map(str::to_owned))
            .collect(),
        _ => file.exports().into_iter().flatten().flatten().filter_map(|e| e.name().name().map(text)).collect(),
    };
    if file.format() == BinaryFormat::MachO {
        names = names.into_iter().map(|n| n.strip_prefix('_').map_or(n.clone(), str::to_owned)).collect();
    }
    names.retain(|n| !n.is_empty());
    names
}

fn exports(fmu: &FmuFile) -> Verdict {
    let needed: Vec<String> = match fmu.version {
        FmiVersion::V2 => {
            let description = fmu.description.as_ref().ok();
            let exchange = description.is_some_and(|d| d.model_exchange.is_some());
            let simulation = description.is_none_or(|d| d.co_simulation.is_some());
            let of = |has: bool, list: &'static str| if has { list } else { "" };
            let lists = [COMMON2, of(simulation, COSIMULATION2), of(exchange, EXCHANGE2)];
            lists.iter().flat_map(|l| l.split_whitespace()).map(|n| format!("fmi2{n}")).collect()
        }
        FmiVersion::V3 => ALL3.split_whitespace().map(|n| format!("fmi3{n}")).collect(),
    };
    each(fmu, |_, file| {
        let exported_names = exported(file);
        needed.iter().filter(|n| !exported_names.contains(n)).map(|n| format!("does not export {n}")).collect()
    })
}

fn reserved(fmu: &FmuFile) -> Verdict {
    each(fmu, |_, file| {
        let known = |n: &str| ALL3.split_whitespace().any(|f| f == n);
        let bad = |n: &String| n.strip_prefix("fmi3").is_some_and(|rest| !known(rest));
        exported(file).into_iter().filter(bad).map(|n| format!("exports {n}")).collect()
    })
}

fn only_standard_functions(fmu: &FmuFile) -> Verdict {
    each(fmu, |_, file| {
        let functions = |n: &String| n.starts_with("fmi2") || n.starts_with("fmi3");
        let linker = ["_init", "_fini", "_edata", "_end", "__bss_start", "DllMain"];
        let other_symbols: Vec<_> =
            exported(file).into_iter().filter(|n| !functions(n) && !linker.contains(&n.as_str())).collect();
        let shown = other_symbols.iter().take(5).cloned().collect::<Vec<_>>().join(", ");
        if other_symbols.len() > 2 {
            vec![format!("exports {} other symbols, for example {shown}", other_symbols.len())]
        } else {
            Vec::new()
        }
    })
}

fn unloadable(fmu: &FmuFile) -> Verdict {
    elf(fmu, |_, file| {
        let mut findings = Vec::new();
        for (tag, value) in dynamic(file)? {
            if tag == 0x6fff_fffb && value & 8 != 0 {
                findings.push("has the flag NODELETE".into());
            }
        }
        let unique = |s: &object::read::elf::ElfSymbol64<'_, '_>| {
            let flags = s.flags();
            matches!(flags, object::SymbolFlags::Elf { st_info, .. } if st_info.0 >> 4 == 10)
        };
        let names: Vec<_> =
            file.dynamic_symbols().filter(unique).filter_map(|s| s.name().ok().map(str::to_owned)).collect();
        if let Some(first) = names.first() {
            findings.push(format!("has {} unique symbols, for example {first}", names.len()));
        }
        Ok(findings)
    })
}

const RPATH: i64 = 15;
const RUNPATH: i64 = 29;

fn needed(fmu: &FmuFile) -> Verdict {
    elf(fmu, |binary, file| {
        let shipped = |name: &str| fmu.zip.find(&format!("binaries/{}/{name}", binary.folder)).is_some();
        let foreign = |n: &String| !is_system(n) && !shipped(n);
        Ok(strings(file, NEEDED)?.into_iter().filter(foreign).map(|n| format!("needs {n}")).collect())
    })
}

fn rpath(fmu: &FmuFile) -> Verdict {
    elf(fmu, |_, file| {
        let mut findings = Vec::new();
        for path in strings(file, RPATH)?.into_iter().chain(strings(file, RUNPATH)?) {
            findings.extend(path.split(':').filter(|p| !p.starts_with("$ORIGIN")).map(|p| format!("searches {p:?}")));
        }
        Ok(findings)
    })
}

fn c_library(fmu: &FmuFile) -> Verdict {
    elf(fmu, |_, file| {
        let newest = newest_glibc(file)?.filter(|newest| *newest > FLOOR);
        Ok(newest.map(|newest| format!("needs {newest}")).into_iter().collect())
    })
}

fn no_dangerous_flags(fmu: &FmuFile) -> Verdict {
    elf(fmu, |_, file| {
        let mut findings = Vec::new();
        for (tag, value) in dynamic(file)? {
            if tag == 22 || (tag == 30 && value & 4 != 0) {
                findings.push("has text relocations".into());
            }
        }
        for segment in file.elf_program_headers() {
            if segment.p_type(file.endian()) == elf::PT_GNU_STACK
                && segment.p_flags(file.endian()) & elf::PF_X != elf::ProgramFlags(0)
            {
                findings.push("requires an executable stack".into());
            }
        }
        Ok(findings)
    })
}

/// `GNU_PROPERTY_X86_ISA_1_NEEDED` of the note `.note.gnu.property`: bit 0 is the baseline, the others are x86-64-v2 to v4.
fn processor(fmu: &FmuFile) -> Verdict {
    const NEEDED: u32 = 0xc000_8002;
    elf(fmu, |_, file| {
        let mut findings = Vec::new();
        let Some(section) = file.section_by_name(".note.gnu.property") else { return Ok(findings) };
        let data = section.data()?;
        let word = |at: usize| data.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        // Name size, description size, type, "GNU", then properties: type, size, data padded to 8 bytes.
        let mut at = 16;
        while let (Some(kind), Some(size)) = (word(at), word(at + 4)) {
            if kind == NEEDED && word(at + 8).is_some_and(|bits| bits & !1 != 0) {
                findings.push(format!(
                    "its note requires instruction sets beyond x86-64-v1 ({:#x})",
                    word(at + 8).unwrap_or(0)
                ));
            }
            at += 8 + usize::try_from(size).unwrap_or(usize::MAX / 2).next_multiple_of(8);
        }
        Ok(findings)
    })
}

/// The session has loaded it already.
fn loads(_: &Session) -> Result<(), NotDetermined> {
    Ok(())
}

fn versions(session: &Session) -> Result<(), NotDetermined> {
    let mut texts = vec![(Text::GetVersion, session.description.version.to_string())];
    if session.is_v2() {
        texts.push((Text::GetTypesPlatform, "default".into()));
    }
    for (name, expected) in texts {
        session.record_call(&session.raw.name(name.as_str()));
        let version = session.raw.text(name);
        session.require(version.as_ref() == Some(&expected), || {
            format!("{} returned {}, expected {expected:?}", session.raw.name(name.as_str()), or_null(&version))
        });
    }
    Ok(())
}

fn complete_run(session: &Session) -> Result<(), NotDetermined> {
    session.complete_run()?;
    // An Error belongs in the log, not on the console.
    if session.description.co_simulation.is_some() {
        let _ = session.stepping()?.provoke();
    }
    Ok(())
}
