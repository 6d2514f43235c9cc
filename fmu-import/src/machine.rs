//! The platforms of a shared library, from its headers, and universal libraries of macOS, which contain several images.
//!
//! Formats: ELF-64, `e_machine`; Mach-O, `mach/machine.h` and `mach-o/fat.h` (all numbers of a universal header are
//! big-endian); PE/COFF, `Machine`.

use crate::platform::Platform;
use std::ops::Range;

/// Number of bytes at the head of a library that [`platforms`] needs.
pub const HEAD: u64 = 4096;

/// Magic of a 64-bit Mach-O file, little-endian.
const MACH_O: u32 = 0xfeed_facf;
/// Magic of a universal file.
const UNIVERSAL: u32 = 0xcafe_babe;
/// Size in bytes of a universal file's header, and of an entry of its table.
const HEADER: usize = 8;
const ENTRY: usize = 20;
/// Maximum number of images in a universal file; a Java class has the same magic and a greater number in this field.
const MOST: u32 = 18;
/// `cputype` with the alignment of an image as a power of 2: the page size of that processor, as in lipo.
const PROCESSORS: [(u32, Platform, u32); 2] =
    [(0x0100_0007, Platform::X64Darwin, 12), (0x0100_000c, Platform::ArmDarwin, 14)];

/// The platforms of a library; empty if it is not a library of a known platform. Its first [`HEAD`] bytes are enough.
pub fn platforms(library: &[u8]) -> Vec<Platform> {
    if let Some(images) = table(library) {
        return images.iter().filter_map(|(cpu, _)| darwin(*cpu)).collect();
    }
    let of = match library.get(..4) {
        Some(b"\x7fELF") => match (library.get(4), half(library, 18)) {
            (Some(2), Some(62)) => Some(Platform::X64Linux),
            (Some(2), Some(183)) => Some(Platform::ArmLinux),
            _ => None,
        },
        Some([b'M', b'Z', ..]) => {
            let at = word(library, 0x3c).and_then(|at| usize::try_from(at).ok());
            let at = at.filter(|&at| library.get(at..).is_some_and(|rest| rest.starts_with(b"PE\0\0")));
            match at.and_then(|at| half(library, at.checked_add(4)?)) {
                Some(0x8664) => Some(Platform::X64Windows),
                Some(0xaa64) => Some(Platform::ArmWindows),
                _ => None,
            }
        }
        _ if word(library, 0) == Some(MACH_O) => word(library, 4).and_then(darwin),
        _ => None,
    };
    of.into_iter().collect()
}

/// The images in a library: all images of a universal library, or the library itself.
///
/// # Errors
/// An image of a universal library lies outside of it.
pub fn images(library: &[u8]) -> Result<Vec<&[u8]>, String> {
    let Some(images) = table(library) else { return Ok(vec![library]) };
    let outside = |range: &Range<usize>| format!("the image at {range:?} lies outside of its {} bytes", library.len());
    images.into_iter().map(|(_, range)| library.get(range.clone()).ok_or_else(|| outside(&range))).collect()
}

/// A universal library with these images, among which dyld and dlopen of macOS choose.
///
/// # Errors
/// An image is not for macOS, two are for one processor, or all together exceed 4 GiB.
pub fn universal(images: &[&[u8]]) -> Result<Vec<u8>, String> {
    let (mut header, mut body) = (Vec::new(), Vec::new());
    let mut put = |x: u32| header.extend(x.to_be_bytes());
    let size = |n: usize| u32::try_from(n).map_err(|_| "a universal library ends at 4 GiB".to_owned());
    put(UNIVERSAL);
    put(size(images.len())?);
    let mut end = HEADER + ENTRY * images.len();
    let mut there = Vec::new();
    for image in images {
        let numbers = (word(image, 0), word(image, 4), word(image, 8));
        let (Some(MACH_O), Some(cpu), Some(subtype)) = numbers else { return Err("is not a library of macOS".into()) };
        let Some((_, platform, alignment)) = PROCESSORS.into_iter().find(|(known, ..)| *known == cpu) else {
            return Err(format!("is for an unknown processor (cputype {cpu:#x})"));
        };
        if there.contains(&platform) {
            return Err(format!("is for {platform}, like another one"));
        }
        there.push(platform);
        let at = end.next_multiple_of(1 << alignment);
        for x in [cpu, subtype, size(at)?, size(image.len())?, alignment] {
            put(x);
        }
        body.push((at, *image));
        end = at.saturating_add(image.len());
    }
    for (at, image) in body {
        header.resize(at, 0);
        header.extend(image);
    }
    Ok(header)
}

/// `cputype` and range of each image of a universal library.
fn table(library: &[u8]) -> Option<Vec<(u32, Range<usize>)>> {
    let number = |at: usize| Some(u32::from_be_bytes(library.get(at..at.checked_add(4)?)?.try_into().ok()?));
    let count = number(4).filter(|count| number(0) == Some(UNIVERSAL) && (1..=MOST).contains(count))?;
    let image = |i: u32| {
        let entry = HEADER + ENTRY * usize::try_from(i).ok()?;
        let (at, size) = (usize::try_from(number(entry + 8)?).ok()?, usize::try_from(number(entry + 12)?).ok()?);
        Some((number(entry)?, at..at.checked_add(size)?))
    };
    (0..count).map(image).collect()
}

fn darwin(cpu: u32) -> Option<Platform> {
    PROCESSORS.into_iter().find(|(known, ..)| *known == cpu).map(|(_, platform, _)| platform)
}

fn half(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at.checked_add(2)?)?.try_into().ok()?))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use object::read::macho::{FatArch, MachOFatFile32};
    use object::{Architecture, FileKind};

    /// A Mach-O header followed by only a name.
    fn image(cpu: u32, subtype: u32, name: &str) -> Vec<u8> {
        let words = [MACH_O, cpu, subtype, 6, 0, 0, 0, 0];
        words.iter().flat_map(|word| word.to_le_bytes()).chain(name.bytes()).collect()
    }

    #[test]
    fn a_universal_library_holds_both_images() {
        let (intel, arm) = (image(0x0100_0007, 3, "intel"), image(0x0100_000c, 0x8000_0002, "arm"));
        let both = universal(&[&intel, &arm]).unwrap();
        assert_eq!(platforms(&both), [Platform::X64Darwin, Platform::ArmDarwin]);
        assert_eq!(platforms(&both[..usize::try_from(HEAD).unwrap()]), [Platform::X64Darwin, Platform::ArmDarwin]);
        assert_eq!(images(&both).unwrap(), [&intel[..], &arm]);
        // A second reader: the crate object.
        assert_eq!(FileKind::parse(&*both).unwrap(), FileKind::MachOFat32);
        let read = MachOFatFile32::parse(&*both).unwrap();
        let found: Vec<_> =
            read.arches().iter().map(|a| (a.architecture(), a.align(), a.data(&*both).unwrap())).collect();
        let expected = [(Architecture::X86_64, 12, &intel[..]), (Architecture::Aarch64, 14, &arm)];
        assert_eq!(found, expected);
        assert!(read.arches().iter().all(|a| a.offset() % (1 << a.align()) == 0), "aligned to a page");
        assert_eq!(read.arches()[1].cpusubtype(), object::macho::CpuSubtype(0x8000_0002), "that of the image");
        assert!(universal(&[&intel, &intel]).unwrap_err().contains("like another one"));
        assert!(universal(&[b"\x7fELF"]).unwrap_err().contains("is not a library of macOS"));
        assert!(images(&both[..both.len() - 1]).unwrap_err().contains("lies outside"));
    }

    #[test]
    fn thin_libraries() {
        assert_eq!(platforms(&image(0x0100_000c, 0, "")), [Platform::ArmDarwin]);
        let elf = |class: u8, machine: u8| {
            let mut bytes = vec![0; 64];
            bytes[..5].copy_from_slice(&[0x7f, b'E', b'L', b'F', class]);
            bytes[18] = machine;
            bytes
        };
        assert_eq!(
            (platforms(&elf(2, 62)), platforms(&elf(2, 183))),
            (vec![Platform::X64Linux], vec![Platform::ArmLinux])
        );
        let mut pe = vec![0; 128];
        (pe[0], pe[1], pe[0x3c]) = (b'M', b'Z', 64);
        pe[64..70].copy_from_slice(b"PE\0\0\x64\xaa");
        assert_eq!(platforms(&pe), [Platform::ArmWindows]);
        // Not libraries: text, a 32-bit library, a Java class, a truncated file.
        for bytes in [&b"text"[..], &elf(1, 3), b"\xca\xfe\xba\xbe\0\0\0\x41", b"MZ", b"", &[0xcf, 0xfa, 0xed, 0xfe]] {
            assert!(platforms(bytes).is_empty(), "{bytes:?}");
        }
        let host = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        assert_eq!(platforms(&host), [Platform::host()]);
    }
}
