//! System requirements of a Linux binary, read from its ELF file.

use object::read::elf::{Dyn, ElfFile64, FileHeader, SectionHeader};
use std::fmt;

/// The oldest C library supported by our Linux binaries: released in 2012, and older than every system still in use.
pub const FLOOR: Glibc = Glibc(2, 17);

/// Tag of a needed library in the dynamic section.
pub const NEEDED: i64 = 1;

/// A version of the GNU C library.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Glibc(pub u32, pub u32);

impl fmt::Display for Glibc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "GLIBC_{}.{}", self.0, self.1)
    }
}

/// Needs of a Linux binary.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Needs {
    /// The newest version of the GNU C library that one of its symbols requires.
    pub glibc: Option<Glibc>,
    /// Needed libraries outside the C library.
    pub others: Vec<String>,
}

impl Needs {
    /// The requirements of a 64-bit ELF file.
    ///
    /// # Errors
    /// The file is not a 64-bit ELF file.
    pub fn of(bytes: &[u8]) -> Result<Self, object::Error> {
        let file = ElfFile64::parse(bytes)?;
        let others = strings(&file, NEEDED)?.into_iter().filter(|n| !is_system(n)).collect();
        Ok(Self { glibc: newest_glibc(&file)?, others })
    }

    /// Whether a system with only the C library of [`FLOOR`] loads it.
    pub fn are_modest(&self) -> bool {
        self.others.is_empty() && self.glibc <= Some(FLOOR)
    }
}

impl fmt::Display for Needs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let glibc = self.glibc.map(|g| g.to_string());
        let all: Vec<String> = glibc.into_iter().chain(self.others.iter().cloned()).collect();
        f.pad(&all.join(" and "))
    }
}

/// Whether a library belongs to the C library.
pub fn is_system(library: &str) -> bool {
    ["libc.so", "libm.so", "libpthread.so", "libdl.so", "librt.so", "ld-linux"].iter().any(|s| library.starts_with(s))
}

/// The entries of the dynamic section.
///
/// # Errors
/// The file is damaged.
pub fn dynamic(file: &ElfFile64<'_>) -> Result<Vec<(i64, u64)>, object::Error> {
    let (endian, data) = (file.endian(), file.data());
    let header = file.elf_header();
    let sections = header.sections(endian, data)?;
    let mut entries = Vec::new();
    for section in sections.iter() {
        if let Some((list, _)) = section.dynamic(endian, data)? {
            entries.extend(list.iter().map(|d| (d.d_tag(endian).0, d.d_val(endian))));
        }
    }
    Ok(entries)
}

/// Strings of dynamic entries with this tag.
///
/// # Errors
/// The file is damaged.
pub fn strings(file: &ElfFile64<'_>, tag: i64) -> Result<Vec<String>, object::Error> {
    let (endian, data) = (file.endian(), file.data());
    let sections = file.elf_header().sections(endian, data)?;
    let mut found = Vec::new();
    for section in sections.iter() {
        let Some((list, link)) = section.dynamic(endian, data)? else { continue };
        let names = sections.strings(endian, data, link)?;
        for entry in list.iter().filter(|d| d.d_tag(endian).0 == tag) {
            let offset = u32::try_from(entry.d_val(endian)).unwrap_or(u32::MAX);
            let text = names.get(offset).map_err(|()| object_error())?;
            found.push(String::from_utf8_lossy(text).into_owned());
        }
    }
    Ok(found)
}

fn object_error() -> object::Error {
    // The crate has no public constructor; parsing an empty input creates one.
    object::File::parse(&[][..]).err().unwrap_or_else(|| unreachable!("no bytes make an object file"))
}

/// The newest version of the GNU C library that a symbol requires.
///
/// # Errors
/// The file is damaged.
pub fn newest_glibc(file: &ElfFile64<'_>) -> Result<Option<Glibc>, object::Error> {
    let mut newest = None;
    let (endian, data) = (file.endian(), file.data());
    let sections = file.elf_header().sections(endian, data)?;
    let Some((mut needs, link)) = sections.gnu_verneed(endian, data)? else { return Ok(None) };
    let names = sections.strings(endian, data, link)?;
    while let Some((_, mut versions)) = needs.next()? {
        while let Some(version) = versions.next()? {
            newest = newest.max(version_of(&String::from_utf8_lossy(version.name(endian, names)?)));
        }
    }
    Ok(newest)
}

/// The C library version of a symbol's version: GLIBC_2.2.5 is 2.2 here, GLIBC_PRIVATE has no version, and relative relocations
/// came with 2.36.
fn version_of(name: &str) -> Option<Glibc> {
    let number = name.strip_prefix("GLIBC_")?;
    let mut parts = number.split('.').map(str::parse);
    match (parts.next(), parts.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => Some(Glibc(major, minor)),
        _ => (number == "ABI_DT_RELR").then_some(Glibc(2, 36)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use object::{Object, ObjectSection};

    #[test]
    fn what_is_modest() {
        let needs = |glibc, others: &[&str]| Needs { glibc, others: others.iter().map(ToString::to_string).collect() };
        assert!(needs(None, &[]).are_modest());
        assert!(needs(Some(FLOOR), &[]).are_modest());
        assert!(needs(Some(Glibc(2, 4)), &[]).are_modest(), "4 is less than 17");
        assert!(!needs(Some(Glibc(2, 18)), &[]).are_modest());
        assert!(!needs(Some(Glibc(2, 4)), &["libgcc_s.so.1"]).are_modest());
        let text = needs(Some(Glibc(2, 34)), &["libgcc_s.so.1"]).to_string();
        assert_eq!(text, "GLIBC_2.34 and libgcc_s.so.1");
    }

    #[test]
    fn the_newest_version_is_the_greatest_number() {
        let names = ["GLIBC_2.2.5", "GLIBC_2.34", "GLIBC_2.4", "GCC_3.0", "GLIBC_PRIVATE"];
        let versions = names.map(version_of);
        assert_eq!(versions, [Some(Glibc(2, 2)), Some(Glibc(2, 34)), Some(Glibc(2, 4)), None, None]);
        assert_eq!(versions.into_iter().max(), Some(Some(Glibc(2, 34))));
        assert_eq!(version_of("GLIBC_ABI_DT_RELR"), Some(Glibc(2, 36)));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn this_program_needs_the_c_library() {
        let bytes = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        let needs = Needs::of(&bytes).unwrap();
        // The names of all versions are among the strings of the dynamic symbols.
        let file = ElfFile64::<object::Endianness>::parse(&*bytes).unwrap();
        let strings = file.section_by_name(".dynstr").unwrap().data().unwrap();
        let names = strings.split(|byte| *byte == 0).map(String::from_utf8_lossy);
        assert_eq!(needs.glibc, names.filter_map(|name| version_of(&name)).max());
        assert!(needs.glibc >= Some(Glibc(2, 2)), "{needs:?}");
        assert!(Needs::of(&bytes[..100]).is_err());
    }
}
