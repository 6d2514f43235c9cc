//! The raw headers of a ZIP archive, without the corrections of a tolerant reader (APPNOTE 6.3).

use flate2::bufread::DeflateDecoder;
use fmu_import::limits;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};

/// One header, local or central.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) needed: u16,
    pub(super) flags: u16,
    pub(super) method: u16,
    pub(super) crc: u32,
    pub(super) packed: u32,
    pub(super) size: u32,
    pub(super) name: Vec<u8>,
    pub(super) extra: Vec<u8>,
}

/// An entry: its central header, its local one where it can be read, and where its data begin.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) central: Header,
    pub(super) local: Option<Header>,
    pub(super) made_by: u16,
    pub(super) attributes: u32,
    pub(super) disk: u16,
    start: u64,
}

impl Entry {
    pub(super) fn name(&self) -> String {
        String::from_utf8_lossy(&self.central.name).into_owned()
    }

    /// A Unix mode of a link: high half of the external attributes, when made on Unix.
    pub(super) fn is_link(&self) -> bool {
        self.made_by >> 8 == 3 && (self.attributes >> 16) & 0o170_000 == 0o120_000
    }
}

/// All entries.
#[derive(Clone, Debug)]
pub(super) struct Archive {
    pub(super) entries: Vec<Entry>,
    /// The end record counts disks.
    pub(super) split: bool,
    /// The archive has a ZIP64 end record, or a size that needs one.
    pub(super) zip64: bool,
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at.checked_add(2)?)?.try_into().ok()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

fn slice(bytes: &[u8], at: usize, len: usize) -> Option<Vec<u8>> {
    Some(bytes.get(at..at.checked_add(len)?)?.to_vec())
}

/// Bytes of a file; fewer at its end.
fn bytes_at(file: &File, at: u64, len: u64) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let mut file = file;
    file.seek(SeekFrom::Start(at)).and_then(|_| file.take(len).read_to_end(&mut bytes)).map_err(|e| e.to_string())?;
    Ok(bytes)
}

impl Archive {
    /// Reads the directory of an archive of this size.
    pub(super) fn read(file: &File, size: u64) -> Result<Self, String> {
        // The comment of the end record may be 64 KiB long; a record of ZIP64 may be before it.
        let tail_at = size.saturating_sub(20 + 22 + 0xffff);
        let tail = bytes_at(file, tail_at, size)?;
        let end = end_record(&tail).ok_or("not a ZIP archive, or truncated: it has no end record")?;
        let truncated = || "the end record is truncated".to_owned();
        let field = |at| u16_at(&tail, end + at).ok_or_else(truncated);
        let split = [4, 6].iter().try_fold(false, |any, at| Ok::<_, String>(any || field(*at)? != 0))?;
        let count = usize::from(field(10)?);
        let offset = u64::from(u32_at(&tail, end + 16).ok_or_else(truncated)?);
        let zip64 = (end >= 20 && u32_at(&tail, end - 20) == Some(0x0706_4b50)) || count == 0xffff;
        let length = (tail_at + end as u64).saturating_sub(offset);
        limits::DIRECTORY.check(length)?;
        let directory = bytes_at(file, offset, length)?;
        let (mut entries, mut at) = (Vec::new(), 0);
        while entries.len() < count {
            let entry = entry(file, &directory, &mut at)
                .ok_or_else(|| format!("entry {} of {count} in the directory cannot be read", entries.len() + 1))?;
            entries.push(entry);
        }
        let unpacked = entries.iter().map(|e| u64::from(e.central.size)).sum();
        limits::UNPACKED.check(unpacked)?;
        Ok(Self { entries, split, zip64 })
    }

    pub(super) fn find(&self, name: &str) -> Option<&Entry> {
        self.entries.iter().find(|e| e.central.name == name.as_bytes())
    }

    /// Names of files that are also folders of other entries: no system can store both.
    pub(super) fn files_and_folders(&self) -> Vec<String> {
        let mut names: Vec<&[u8]> = self.entries.iter().map(|e| &*e.central.name).collect();
        names.sort_unstable();
        let is_folder = |name: &&&[u8]| {
            let below = [name, &b"/"[..]].concat();
            names.get(names.partition_point(|n| *n < &*below)).is_some_and(|next| next.starts_with(&below))
        };
        names.iter().filter(is_folder).map(|name| String::from_utf8_lossy(name).into_owned()).collect()
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.entries.iter().map(Entry::name).collect()
    }
}

/// Offset of the end record, searched from the end because its comment may be 64 KiB long.
fn end_record(bytes: &[u8]) -> Option<usize> {
    let first = bytes.len().saturating_sub(22 + 0xffff);
    let last = bytes.len().checked_sub(22)?;
    (first..=last).rev().find(|&at| u32_at(bytes, at) == Some(0x0605_4b50))
}

fn entry(file: &File, bytes: &[u8], at: &mut usize) -> Option<Entry> {
    let here = *at;
    if u32_at(bytes, here)? != 0x0201_4b50 {
        return None;
    }
    let (name, extra) = (usize::from(u16_at(bytes, here + 28)?), usize::from(u16_at(bytes, here + 30)?));
    let comment = usize::from(u16_at(bytes, here + 32)?);
    let central = Header {
        needed: u16_at(bytes, here + 6)?,
        flags: u16_at(bytes, here + 8)?,
        method: u16_at(bytes, here + 10)?,
        crc: u32_at(bytes, here + 16)?,
        packed: u32_at(bytes, here + 20)?,
        size: u32_at(bytes, here + 24)?,
        name: slice(bytes, here + 46, name)?,
        extra: slice(bytes, here + 46 + name, extra)?,
    };
    let offset = u64::from(u32_at(bytes, here + 42)?);
    let (local, start) = local(file, offset).map_or((None, 0), |(header, start)| (Some(header), start));
    *at = here + 46 + name + extra + comment;
    Some(Entry {
        central,
        local,
        made_by: u16_at(bytes, here + 4)?,
        attributes: u32_at(bytes, here + 38)?,
        disk: u16_at(bytes, here + 34)?,
        start,
    })
}

/// A local header, and where its data begin.
fn local(file: &File, at: u64) -> Option<(Header, u64)> {
    let fixed = bytes_at(file, at, 30).ok()?;
    if u32_at(&fixed, 0)? != 0x0403_4b50 {
        return None;
    }
    let (name, extra) = (usize::from(u16_at(&fixed, 26)?), usize::from(u16_at(&fixed, 28)?));
    let names = bytes_at(file, at + 30, (name + extra) as u64).ok()?;
    let header = Header {
        needed: u16_at(&fixed, 4)?,
        flags: u16_at(&fixed, 6)?,
        method: u16_at(&fixed, 8)?,
        crc: u32_at(&fixed, 14)?,
        packed: u32_at(&fixed, 18)?,
        size: u32_at(&fixed, 22)?,
        name: slice(&names, 0, name)?,
        extra: slice(&names, name, extra)?,
    };
    Some((header, at + 30 + (name + extra) as u64))
}

/// The contents of an entry, at most `limit` bytes, checked against its checksum.
pub(super) fn contents(file: &File, entry: &Entry, limit: u64) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    copy(file, entry, limit, &mut out)?;
    Ok(out)
}

/// Writes the contents of an entry, at most `limit` bytes, and checks them against its checksum; returns their number.
pub(super) fn copy(file: &File, entry: &Entry, limit: u64, out: &mut impl Write) -> Result<u64, String> {
    let name = entry.name();
    if entry.local.is_none() {
        return Err(format!("{name}: its local header cannot be read"));
    }
    let failed = |e: std::io::Error| format!("{name}: {e}");
    let mut raw = file;
    let size = raw.seek(SeekFrom::End(0)).map_err(failed)?;
    let packed = u64::from(entry.central.packed);
    if entry.start + packed > size {
        return Err(format!("{name}: its data are truncated"));
    }
    raw.seek(SeekFrom::Start(entry.start)).map_err(failed)?;
    let packed = BufReader::with_capacity(1 << 16, raw.take(packed));
    let mut data: Box<dyn Read + '_> = match entry.central.method {
        0 => Box::new(packed),
        8 => Box::new(DeflateDecoder::new(packed)),
        other => return Err(format!("{name}: the compression method {other} is not supported")),
    };
    let (mut crc, mut written, mut buffer) = (flate2::Crc::new(), 0, vec![0; 1 << 16]);
    loop {
        let n = data.read(&mut buffer).map_err(failed)?;
        if n == 0 {
            break;
        }
        written += n as u64;
        if written > u64::from(entry.central.size) {
            return Err(format!("{name}: is larger than the {} bytes that its headers claim", entry.central.size));
        }
        if written > limit {
            return Err(format!("{name}: {}", limits::UNPACKED.exceeded(format!("more than {limit}"))));
        }
        crc.update(&buffer[..n]);
        out.write_all(&buffer[..n]).map_err(failed)?;
    }
    let (found, expected) = (crc.sum(), entry.central.crc);
    if found != expected {
        return Err(format!("{name}: the checksum of its contents is {found:08x}, not {expected:08x}"));
    }
    Ok(written)
}

/// Whether a name stays below the folder that it is joined to. A colon after the first letter makes it a drive.
pub(super) fn is_inside(name: &str) -> bool {
    !name.contains(['\\', '\0'])
        && name.as_bytes().get(1) != Some(&b':')
        && !name.starts_with('/')
        && name.split('/').all(|part| part != "..")
}
