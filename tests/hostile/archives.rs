//! Archives with damage, false headers, or paths that lead outside.

use crate::zip::{Entry, write};
use crate::{Place, STATIC, XML, each, entries, library};
use fmu_core::draw::Draw;
use std::fs;

fn with(more: &[Entry]) -> Place {
    let place = Place::new();
    write(&place.fmu(), &[entries(XML), more.to_vec()].concat());
    place
}

#[test]
fn names_that_lead_outside() {
    for name in [
        "../evil",
        "resources/../../evil",
        "/tmp/evil-of-fmu",
        "resources\\..\\evil",
        "C:/evil",
        "resources/./../../evil",
    ] {
        with(&[Entry::new(name, b"x")]).is_refused(name, 1, "leads outside");
        assert!(!std::path::Path::new("/tmp/evil-of-fmu").exists());
    }
    let mut link = Entry::new("resources/link", b"/etc/passwd");
    link.mode = 0o120_777;
    with(&[link]).is_refused("a link", 1, "is a link");
}

#[test]
fn entries_that_are_wrong() {
    let entry = |change: fn(&mut Entry)| {
        let mut entry = Entry::new("resources/x", b"contents");
        change(&mut entry);
        entry
    };
    for (what, status, wrong) in [
        ("encrypted", 1, entry(|e| e.flags = 1)),
        ("another method", 1, entry(|e| e.method = 12)),
        ("checksum", 1, entry(|e| e.crc = Some(7))),
        ("another disk", 1, entry(|e| e.disk = 7)),
        ("other name inside", 0, entry(|e| e.local_name = Some("resources/y".into()))),
        ("no name", 1, Entry::new("", b"x")),
    ] {
        let place = with(&[wrong]);
        let ended = place.runs("check", &["--only", STATIC]);
        assert_eq!(ended.status, status, "{what}: {ended:?}");
        place.runs("simulate", &[]);
    }
    // A full disk is not a fault of the archive.
    for name in ["resources".to_owned(), format!("resources/{}", "x".repeat(60_000))] {
        let place = with(&[Entry::new(&name, b"x")]);
        let ended = place.runs("check", &["--only", STATIC]);
        assert!(ended.status == 0 && ended.out.contains("this computer could not store an entry"), "{ended:?}");
        place.runs("simulate", &[]);
    }
    let twice = with(&[
        Entry::new("modelDescription.xml", b"<a/>"),
        Entry::new("resources/x", b"1"),
        Entry::new("resources/x", b"2"),
    ]);
    assert!(twice.runs("check", &["--only", STATIC]).out.contains("Z01k   VIOLATED"));
    twice.runs("simulate", &[]);
    let deep = with(&[Entry::new(&"resources/".repeat(1000), b"")]);
    assert!(deep.runs("check", &["--only", STATIC]).status < 2);
    deep.runs("simulate", &[]);
}

/// An archive of 100 KB whose 2000 entries share the same data, 100 MB each; one that contains more than its headers state; 70
/// 000 entries.
#[test]
fn bombs() {
    let zeros = vec![0_u8; 100_000_000];
    let mut packed = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut packed, &zeros).unwrap();
    let packed = packed.finish().unwrap();
    let mut crc = flate2::Crc::new();
    crc.update(&zeros);
    let bomb = |count: usize, claims: u32| {
        let place = with(&[Entry { method: 8, crc: Some(crc.sum()), ..Entry::new("resources/0000", &packed) }]);
        let bytes = fs::read(place.fmu()).unwrap();
        let end = bytes.len() - 22;
        let directory = u32::from_le_bytes(bytes[end + 16..end + 20].try_into().unwrap()) as usize;
        let entry = end - 46 - "resources/0000".len();
        let mut out = bytes[..entry].to_vec();
        for k in 0..count {
            let mut one = bytes[entry..end].to_vec();
            one[24..28].copy_from_slice(&claims.to_le_bytes());
            one[46..].copy_from_slice(format!("resources/{k:04}").as_bytes());
            out.extend(one);
        }
        let (size, entries) =
            (out.len() - directory, u16::try_from(count + 1 + usize::from(library().is_some())).unwrap());
        out.extend(b"PK\x05\x06\0\0\0\0");
        out.extend([entries.to_le_bytes(), entries.to_le_bytes()].concat());
        out.extend(u32::try_from(size).unwrap().to_le_bytes());
        out.extend(u32::try_from(directory).unwrap().to_le_bytes());
        out.extend([0, 0]);
        fs::write(place.fmu(), out).unwrap();
        place
    };
    bomb(2000, 100_000_000).is_refused("overlap", 2, "; the limit is 2147483648");
    bomb(1, 1000).is_refused("a lie", 1, "resources/0000: ");
    let many: Vec<_> = (0..20_000).map(|k| Entry::new(&format!("other/{k}"), b"")).collect();
    assert!(with(&many).runs("check", &["--only", STATIC]).status < 2);
}

/// An archive that unpacks to 1 GB: `fmu info` needs little memory for it, and unpacking counts as time of `fmu simulate`.
#[test]
fn a_gigabyte_in_a_megabyte() {
    let gigabyte = 1_000_000_000;
    let mut packed = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::fast());
    let mut crc = flate2::Crc::new();
    for block in std::iter::repeat_n(vec![0_u8; 10_000_000], gigabyte / 10_000_000) {
        std::io::Write::write_all(&mut packed, &block).unwrap();
        crc.update(&block);
    }
    let size = u32::try_from(gigabyte).unwrap();
    let packed = packed.finish().unwrap();
    let place =
        with(&[Entry { method: 8, crc: Some(crc.sum()), size: Some(size), ..Entry::new("resources/x", &packed) }]);
    // Data in private memory, in kB.
    let script = "ulimit -d 100000; exec \"$0\" info \"$1\"";
    let output = std::process::Command::new("bash")
        .args(["-c", script, env!("CARGO_BIN_EXE_fmu")])
        .arg(place.fmu())
        .output()
        .unwrap();
    let (said, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && said.contains("size "), "{said}{errors}");
    let ended = place.runs("simulate", &["--timeout", "0.1"]);
    let part = "did not return within 0.1 s; --timeout changes the limit";
    assert!(ended.status == 2 && ended.errors.contains(part), "{ended:?}");
}

/// An XML document of 70 MB in 70 KB.
#[test]
fn a_description_that_swells() {
    let xml = format!("{XML}{}", " ".repeat(70_000_000));
    let mut packed = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, xml.as_bytes()).unwrap();
    let mut crc = flate2::Crc::new();
    crc.update(xml.as_bytes());
    let place = Place::new();
    let packed = packed.finish().unwrap();
    write(&place.fmu(), &[Entry { method: 8, crc: Some(crc.sum()), ..Entry::new("modelDescription.xml", &packed) }]);
    // The test's writer claims the packed size.
    place.is_refused("a lie", 2, "modelDescription.xml: ");
}

#[test]
fn files_that_are_cut_short() {
    let place = with(&[Entry::new("resources/x", b"contents")]);
    let whole = fs::read(place.fmu()).unwrap();
    let places: Vec<usize> = (0..50).map(|k| whole.len() * k / 50).collect();
    each(&places, |&at| {
        let place = Place::new();
        fs::write(place.fmu(), &whole[..at]).unwrap();
        assert_eq!(place.runs("check", &["--only", STATIC]).status, 2, "{at}");
        assert_eq!(place.runs("simulate", &[]).status, 2, "{at}");
    });
}

/// A truncated library in a complete archive: the system loader may end the process.
#[test]
fn libraries_that_are_cut_short() {
    let Some(library) = library() else { return };
    let places: Vec<usize> = (0..50).map(|k| library.len() * k / 50).collect();
    each(&places, |&at| {
        let place = Place::new();
        let library = Entry::new("binaries/linux64/Hostile.so", &library[..at]);
        write(&place.fmu(), &[Entry::new("modelDescription.xml", XML.as_bytes()), library]);
        place.runs("check", &["--only", "binary", "--patience", "90"]);
        // The missing end of a library is not always needed.
        assert!(place.runs("simulate", &["--timeout", "90"]).status != 1, "{at}");
    });
}

/// One flipped bit in the archive, or in its library.
#[test]
fn bytes_that_are_changed() {
    let Some(library) = library() else { return };
    let whole = fs::read(with(&[Entry::new("resources/x", b"contents")]).fmu()).unwrap();
    let mut draw = Draw(1);
    let mut next = |below: usize| draw.below(below);
    let flips: Vec<(bool, usize, u8)> = (0..250)
        .map(|k| {
            let of_library = k % 2 == 0;
            (of_library, next(if of_library { library.len() } else { whole.len() }), 1 << next(8))
        })
        .collect();
    each(&flips, |&(of_library, at, bit)| {
        let place = Place::new();
        if of_library {
            let mut library = library.to_vec();
            library[at] ^= bit;
            let library = Entry::new("binaries/linux64/Hostile.so", &library);
            write(&place.fmu(), &[Entry::new("modelDescription.xml", XML.as_bytes()), library]);
        } else {
            let mut whole = whole.clone();
            whole[at] ^= bit;
            fs::write(place.fmu(), whole).unwrap();
        }
        place.runs("check", &["--only", STATIC, "--patience", "20"]);
        place.runs("simulate", &["--timeout", "20"]);
    });
}
