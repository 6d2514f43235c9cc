//! The archive of an FMU: its contents, and a writer that produces the same bytes for the same contents.

use crate::TOOL;
use crate::documentation;
use crate::error::{Context, Result, ensure, invalid};
use crate::licenses::Licenses;
use fmu_core::Description;
use fmu_import::platform::Platform;
use fmu_import::{machine, whole};
use model_description::{FmiVersion, Generation, date_from_epoch};
use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// A file of an archive.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct PackedFile {
    /// Its contents.
    pub bytes: Vec<u8>,
    /// Whether it is executable.
    pub executable: bool,
}

impl PackedFile {
    fn text(text: String) -> Self {
        Self { bytes: text.into_bytes(), executable: false }
    }
}

/// The time of generation: `SOURCE_DATE_EPOCH`, or now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GenerationTime {
    seconds: i64,
    fixed: bool,
}

impl GenerationTime {
    /// The time from the environment, or from the clock.
    ///
    /// # Errors
    /// `SOURCE_DATE_EPOCH` is not a number of seconds.
    pub fn of_environment() -> Result<Self> {
        if let Ok(text) = std::env::var("SOURCE_DATE_EPOCH") {
            let seconds =
                text.trim().parse().with_context(|| format!("SOURCE_DATE_EPOCH={text} is not a number of seconds"))?;
            return Ok(Self::fixed(seconds));
        }
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Ok(Self { seconds: i64::try_from(since.as_secs()).unwrap_or(i64::MAX), fixed: false })
    }

    /// This many seconds after 1970-01-01T00:00:00Z.
    pub const fn fixed(seconds: i64) -> Self {
        Self { seconds, fixed: true }
    }

    /// The time in the form of `generationDateAndTime`.
    pub fn date_and_time(self) -> String {
        date_from_epoch(self.seconds)
    }

    /// The time of every file: 1980-01-01 unless it is fixed, since the description already has the date.
    fn of_files(self) -> DateTime {
        let text = date_from_epoch(self.seconds);
        let field = |range: std::ops::Range<usize>| text[range].parse::<u16>().unwrap_or(0);
        let small = |range| u8::try_from(field(range)).unwrap_or(0);
        let time = DateTime::from_date_and_time(
            field(0..4),
            small(5..7),
            small(8..10),
            small(11..13),
            small(14..16),
            small(17..19),
        );
        // ZIP time starts in 1980; an earlier time becomes 1980-01-01.
        if self.fixed { time.unwrap_or_default() } else { DateTime::default() }
    }
}

/// All files of an FMU.
///
/// # Errors
/// A library for macOS is not a Mach-O file, so no universal library can be created.
pub fn contents(
    description: &Description,
    binaries: &[(Platform, Vec<u8>)],
    licenses: &Licenses,
    version: FmiVersion,
    moment: GenerationTime,
    linux64: Platform,
) -> Result<BTreeMap<String, PackedFile>> {
    let generation = Generation { tool: TOOL.into(), date_and_time: moment.date_and_time() };
    let mut files = BTreeMap::from([
        ("modelDescription.xml".into(), PackedFile::text(model_description::write(description, version, &generation))),
        ("documentation/index.html".into(), PackedFile::text(documentation::page(description, version))),
        ("documentation/licenses/license.txt".into(), PackedFile::text(licenses.text(description))),
    ]);
    if version == FmiVersion::V3 {
        let spdx = licenses.spdx(description, &generation.date_and_time);
        files.insert("documentation/licenses/license.spdx".into(), PackedFile::text(spdx));
    }
    let libraries = binaries.iter().map(|(platform, bytes)| (*platform, bytes.as_slice())).collect();
    for (path, bytes) in libraries_of(&description.name, &libraries, version, linux64)? {
        files.insert(path, PackedFile { bytes, executable: true });
    }
    Ok(files)
}

/// Paths of the libraries of a model identifier in an archive. In FMI 2.0 `darwin64` receives both macOS binaries as one
/// universal library, and `linux64` the binary of the platform `linux64`.
///
/// # Errors
/// A library for macOS is not a Mach-O file.
pub fn libraries_of(
    name: &str,
    libraries: &BTreeMap<Platform, &[u8]>,
    version: FmiVersion,
    linux64: Platform,
) -> Result<BTreeMap<String, Vec<u8>>> {
    let folder = |platform: Platform| match (version, platform) {
        (FmiVersion::V2, Platform::X64Linux | Platform::ArmLinux) if platform == linux64 => "linux64",
        (FmiVersion::V2, Platform::X64Linux) => platform.tuple(),
        _ => platform.folders(version)[0],
    };
    let mut folders: BTreeMap<&str, Vec<(Platform, &[u8])>> = BTreeMap::new();
    for (&platform, &bytes) in libraries {
        folders.entry(folder(platform)).or_default().push((platform, bytes));
    }
    let one = |(folder, images): (&str, Vec<(Platform, &[u8])>)| {
        let path = format!("binaries/{folder}/{name}.{}", images[0].0.extension());
        let bytes = match &images[..] {
            [(_, bytes)] => bytes.to_vec(),
            all => machine::universal(&all.iter().map(|(_, bytes)| *bytes).collect::<Vec<_>>())
                .map_err(|why| invalid!("{path}: one of the libraries for macOS {why}"))?,
        };
        Ok((path, bytes))
    };
    folders.into_iter().map(one).collect()
}

/// The files of a folder and its subfolders, as `resources/` of an FMU. Hidden files are omitted: systems and editors create
/// them.
///
/// # Errors
/// A file cannot be read, is neither file nor folder (links are followed), or has a name that is invalid on some system.
pub fn resources(folder: &Path) -> Result<BTreeMap<String, PackedFile>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![(folder.to_owned(), "resources".to_owned(), 0)];
    while let Some((folder, prefix, depth)) = folders.pop() {
        // A link may point back to its own folder.
        ensure!(depth < 32, "{}: folders are nested more than 32 deep", folder.display());
        for entry in fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            let of = || path.display().to_string();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or("\u{fffd}");
            if name.starts_with('.') {
                continue;
            }
            let plain = name.bytes().all(|b| (b' '..=b'~').contains(&b) && !br#"\:*?"<>|"#.contains(&b));
            ensure!(plain, "{}: rename it: letters of ASCII without \\ : * ? \" < > | are in every archive", of());
            let name = format!("{prefix}/{name}");
            let kind = fs::metadata(&path).with_context(of)?;
            if kind.is_dir() {
                folders.push((path, name, depth + 1));
            } else {
                ensure!(kind.is_file(), "{}: is neither a file nor a folder", of());
                files.insert(name, PackedFile { bytes: fs::read(&path).with_context(of)?, executable: false });
            }
        }
    }
    Ok(files)
}

/// The bytes of a ZIP archive as FMI requires it (FMI 2.0.5, 2.3; FMI 3.0.2, 2.5): deflate, `/` in names, files only, no
/// ZIP64, no data descriptors. Equal files give equal bytes: sorted names, one time, one compressor.
///
/// # Errors
/// A file is larger than 4 GiB.
pub fn archive(files: &BTreeMap<String, PackedFile>, moment: GenerationTime) -> Result<Vec<u8>> {
    zipped(files, moment, CompressionMethod::Deflated)
}

/// An archive that this program reads itself and then removes: not compressed, because that takes longer than all else.
///
/// # Errors
/// A file is larger than 4 GiB.
pub fn temporary(files: &BTreeMap<String, PackedFile>, moment: GenerationTime) -> Result<Vec<u8>> {
    zipped(files, moment, CompressionMethod::Stored)
}

fn zipped(files: &BTreeMap<String, PackedFile>, moment: GenerationTime, method: CompressionMethod) -> Result<Vec<u8>> {
    let level = (method == CompressionMethod::Deflated).then_some(9);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, PackedFile { bytes, executable }) in files {
        let options = SimpleFileOptions::default()
            .compression_method(method)
            .compression_level(level)
            .last_modified_time(moment.of_files())
            .unix_permissions(if *executable { 0o755 } else { 0o644 });
        zip.start_file(name.as_str(), options).with_context(|| name.clone())?;
        zip.write_all(bytes).with_context(|| name.clone())?;
    }
    Ok(zip.finish()?.into_inner())
}

/// Writes a file atomically, so that no reader sees a partial file: [`whole::write`].
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    Ok(whole::write(path, bytes)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> BTreeMap<String, PackedFile> {
        let file = |bytes: &[u8], executable| PackedFile { bytes: bytes.into(), executable };
        BTreeMap::from([
            ("modelDescription.xml".into(), file(b"<x/>", false)),
            ("binaries/linux64/X.so".into(), file(&[7; 5000], true)),
        ])
    }

    #[test]
    fn the_same_files_give_the_same_bytes() {
        let make = |seconds| archive(&sample(), GenerationTime::fixed(seconds)).unwrap();
        assert_eq!(make(1_700_000_000), make(1_700_000_000));
        assert_ne!(make(1_700_000_000), make(1_800_000_000));
        assert_eq!(make(0), make(5), "before 1980");
    }

    /// Reads the raw headers, because `zip`'s own reader is too lenient.
    #[test]
    fn headers_are_plain() {
        let bytes = archive(&sample(), GenerationTime::fixed(1_700_000_000)).unwrap();
        let u16_at = |i: usize| u16::from_le_bytes([bytes[i], bytes[i + 1]]);
        let starts = |magic: &[u8]| {
            bytes.windows(4).enumerate().filter(|(_, w)| *w == magic).map(|(i, _)| i).collect::<Vec<_>>()
        };
        let local = starts(b"PK\x03\x04");
        assert_eq!(local.len(), 2);
        for i in local {
            assert!(u16_at(i + 4) <= 20, "version needed {}", u16_at(i + 4));
            assert_eq!(u16_at(i + 6), 0, "flags: no data descriptor, no UTF-8");
            assert_eq!(u16_at(i + 8), 8, "deflate");
            assert_eq!(u16_at(i + 28), 0, "no extra field");
        }
        let central = starts(b"PK\x01\x02");
        let modes: Vec<u16> = central.iter().map(|i| u16_at(i + 40)).collect();
        assert_eq!(modes, [0o100_755, 0o100_644]);
        assert!(central.iter().all(|i| u16_at(i + 6) <= 20 && u16_at(i + 30) == 0));
        assert!(starts(b"PK\x06\x06").is_empty(), "no ZIP64");
    }

    #[test]
    fn resources_are_all_files_but_hidden_ones() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(dir.path().join("b/c")).unwrap();
        for name in ["a.csv", "b/c/d", ".gitkeep", "b/.hidden"] {
            fs::write(dir.path().join(name), name).unwrap();
        }
        let names = |folder| resources(folder).map(|files| files.into_keys().collect::<Vec<_>>());
        assert_eq!(names(dir.path()).unwrap(), ["resources/a.csv", "resources/b/c/d"]);
        fs::write(dir.path().join("b/ü"), "").unwrap();
        assert!(names(dir.path()).unwrap_err().to_string().contains("b/ü: rename it"));
    }

    #[test]
    fn a_file_is_written_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("fmi2/X.fmu");
        write(&path, b"one").unwrap();
        write(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(fs::read_dir(dir.path().join("fmi2")).unwrap().count(), 1);
    }
}
