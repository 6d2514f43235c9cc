//! Writes ZIP archives with any header, right or wrong.

use std::path::Path;

/// A stored entry; every field of its headers can be wrong.
#[derive(Clone)]
pub struct Entry {
    pub name: String,
    pub bytes: Vec<u8>,
    pub needed: u16,
    pub flags: u16,
    pub method: u16,
    pub mode: u32,
    pub disk: u16,
    pub crc: Option<u32>,
    /// Size when unpacked, if different.
    pub size: Option<u32>,
    pub local_name: Option<String>,
}

impl Entry {
    pub fn new(name: &str, bytes: &[u8]) -> Self {
        let (name, bytes) = (name.into(), bytes.into());
        Self {
            name,
            bytes,
            needed: 10,
            flags: 0,
            method: 0,
            mode: 0o100_644,
            disk: 0,
            crc: None,
            size: None,
            local_name: None,
        }
    }
}

pub fn write(path: &Path, entries: &[Entry]) {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for e in entries {
        let offset = u32::try_from(out.len()).unwrap();
        let size = u32::try_from(e.bytes.len()).unwrap();
        let mut crc = flate2::Crc::new();
        crc.update(&e.bytes);
        let crc = e.crc.unwrap_or(crc.sum());
        let common = |name: &str| {
            let mut h = Vec::new();
            for x in [e.needed, e.flags, e.method, 0, 33] {
                h.extend(x.to_le_bytes());
            }
            for x in [crc, size, e.size.unwrap_or(size)] {
                h.extend(x.to_le_bytes());
            }
            for x in [u16::try_from(name.len()).unwrap(), 0] {
                h.extend(x.to_le_bytes());
            }
            h
        };
        let local = e.local_name.as_deref().unwrap_or(&e.name);
        out.extend(b"PK\x03\x04");
        out.extend(common(local));
        out.extend(local.as_bytes());
        out.extend(&e.bytes);
        directory.extend(b"PK\x01\x02");
        directory.extend(0x0314_u16.to_le_bytes());
        directory.extend(common(&e.name));
        for x in [0, e.disk, 0] {
            directory.extend(x.to_le_bytes());
        }
        directory.extend((e.mode << 16).to_le_bytes());
        directory.extend(offset.to_le_bytes());
        directory.extend(e.name.as_bytes());
    }
    let (at, size, count) = (out.len(), directory.len(), u16::try_from(entries.len()).unwrap());
    out.extend(directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend([count.to_le_bytes(), count.to_le_bytes()].concat());
    out.extend(u32::try_from(size).unwrap().to_le_bytes());
    out.extend(u32::try_from(at).unwrap().to_le_bytes());
    out.extend([0, 0]);
    std::fs::write(path, out).unwrap();
}
