//! The raw headers of a ZIP archive, without the corrections of a tolerant reader (APPNOTE 6.3).

use flate2::bufread::DeflateDecoder;
use std::io::Read;

/// Maximum number of entries that are read.
const MAX_ENTRIES: usize = 100_000;

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
    start: usize,
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
    /// There is a ZIP64 end record, or a size that needs one.
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

impl Archive {
    /// Reads the directory of an archive.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let end = end_record(bytes).ok_or("not a ZIP archive, or truncated: it has no end record")?;
        let truncated = || "the end record is truncated".to_owned();
        let field = |at| u16_at(bytes, end + at).ok_or_else(truncated);
        let split = [4, 6].iter().try_fold(false, |any, at| Ok::<_, String>(any || field(*at)? != 0))?;
        let count = usize::from(field(10)?);
        let offset = u32_at(bytes, end + 16).ok_or_else(truncated)?;
        let zip64 = (end >= 20 && u32_at(bytes, end - 20) == Some(0x0706_4b50)) || count == 0xffff;
        let mut at = usize::try_from(offset).map_err(|e| e.to_string())?;
        let mut entries = Vec::new();
        while entries.len() < count && entries.len() < MAX_ENTRIES {
            let entry = entry(bytes, &mut at)
                .ok_or_else(|| format!("entry {} of {count} in the directory cannot be read", entries.len() + 1))?;
            entries.push(entry);
        }
        Ok(Self { entries, split, zip64 })
    }

    pub(super) fn find(&self, name: &str) -> Option<&Entry> {
        self.entries.iter().find(|e| e.central.name == name.as_bytes())
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.entries.iter().map(Entry::name).collect()
    }
}

/// Place of the end record, searched from the end as its comment may be 64 KiB long.
fn end_record(bytes: &[u8]) -> Option<usize> {
    let first = bytes.len().saturating_sub(22 + 0xffff);
    let last = bytes.len().checked_sub(22)?;
    (first..=last).rev().find(|&at| u32_at(bytes, at) == Some(0x0605_4b50))
}

fn entry(bytes: &[u8], at: &mut usize) -> Option<Entry> {
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
    let offset = usize::try_from(u32_at(bytes, here + 42)?).ok()?;
    let (local, start) = local(bytes, offset).map_or((None, 0), |(header, start)| (Some(header), start));
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

fn local(bytes: &[u8], at: usize) -> Option<(Header, usize)> {
    if u32_at(bytes, at)? != 0x0403_4b50 {
        return None;
    }
    let (name, extra) = (usize::from(u16_at(bytes, at + 26)?), usize::from(u16_at(bytes, at + 28)?));
    let header = Header {
        needed: u16_at(bytes, at + 4)?,
        flags: u16_at(bytes, at + 6)?,
        method: u16_at(bytes, at + 8)?,
        crc: u32_at(bytes, at + 14)?,
        packed: u32_at(bytes, at + 18)?,
        size: u32_at(bytes, at + 22)?,
        name: slice(bytes, at + 30, name)?,
        extra: slice(bytes, at + 30 + name, extra)?,
    };
    Some((header, at + 30 + name + extra))
}

/// The contents of an entry, at most `limit` bytes, checked against its checksum.
pub(super) fn contents(bytes: &[u8], entry: &Entry, limit: u64) -> Result<Vec<u8>, String> {
    let name = entry.name();
    if entry.local.is_none() {
        return Err(format!("{name}: its local header cannot be read"));
    }
    let packed = usize::try_from(entry.central.packed).map_err(|e| e.to_string())?;
    let end = entry.start.checked_add(packed).filter(|&end| end <= bytes.len());
    let data = end.map(|end| &bytes[entry.start..end]).ok_or_else(|| format!("{name}: its data are truncated"))?;
    let mut out = Vec::new();
    match entry.central.method {
        0 => out.extend_from_slice(&data[..data.len().min(usize::try_from(limit).unwrap_or(usize::MAX))]),
        8 => {
            let mut inflated = DeflateDecoder::new(data).take(limit);
            inflated.read_to_end(&mut out).map_err(|e| format!("{name}: {e}"))?;
        }
        other => return Err(format!("{name}: the compression method {other} is not supported")),
    }
    if out.len() as u64 >= limit {
        return Err(format!("{name}: unpacks to {limit} bytes or more"));
    }
    let mut crc = flate2::Crc::new();
    crc.update(&out);
    if crc.sum() != entry.central.crc {
        return Err(format!(
            "{name}: the checksum of its contents is {:08x}, not {:08x}",
            crc.sum(),
            entry.central.crc
        ));
    }
    Ok(out)
}

/// Whether a name stays below the folder that it is joined to, on every system.
pub(super) fn is_inside(name: &str) -> bool {
    !name.contains(['\\', ':', '\0']) && !name.starts_with('/') && name.split('/').all(|part| part != "..")
}
