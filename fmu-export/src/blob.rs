//! A saved state as bytes: header, payload, checksum. The bytes contain no address and no host byte order: they are the same on
//! every platform.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | magic |
//! | 2 | version of this layout |
//! | 2 | `Model::STATE_VERSION` |
//! | 16 | `Model::HASH`, the model and its interface |
//! | 4 | length of the payload |
//! | n | payload in postcard's encoding, the model and its outputs last, padded with zeros to a multiple of a fixed number |
//! | 4 | CRC-32 of all preceding bytes |

use crate::binary::make_room;
use crate::lifecycle::State;
use crate::snapshot::{Head, Snapshot};
use fmu_core::resource::Shelf;
use fmu_core::saved::{self, Storing};
use fmu_core::{Block, Fault, Model};

const MAGIC: &[u8; 8] = b"FMUstate";
/// Version of this layout.
const FORMAT: u16 = 3;
const HEADER: usize = 8 + 2 + 2 + 16 + 4;
const CHECKSUM: usize = 4;

/// Number of bytes of a state. Integers have a variable length in the payload, but the padding makes the size the same for
/// every state of a model, unless it contains lists that grow.
///
/// # Errors
/// The model cannot be serialized.
pub fn size<M: Model>(state: &Snapshot<M>, storing: &Storing<M>) -> Result<usize, Fault> {
    padded(payload_size(state, storing)?, storing)
}

/// A state as bytes, [`size`] of them.
///
/// # Errors
/// The model cannot be serialized.
pub fn write<M: Model>(state: &Snapshot<M>, storing: &Storing<M>) -> Result<Vec<u8>, Fault> {
    let payload = payload_size(state, storing)?;
    let length = u32::try_from(payload).map_err(|_| Fault::new("the state is larger than 4 GB"))?;
    let mut bytes = vec![0; padded(payload, storing)?];
    let body = bytes.len() - CHECKSUM;
    bytes[..HEADER].copy_from_slice(&header::<M>(length));
    let mut at = HEADER + saved::write(&state.head(), &mut bytes[HEADER..body])?;
    at += (storing.write)(&state.block.model, &mut bytes[at..body])?;
    saved::write(&state.block.out, &mut bytes[at..body])?;
    let checksum = crc32(&bytes[..body]);
    bytes[body..].copy_from_slice(&checksum.to_le_bytes());
    Ok(bytes)
}

/// Reads a state and validates every part of it.
///
/// # Errors
/// Names the invalid part of the bytes: length, kind, version, checksum or content.
pub fn read<M: Model>(bytes: &[u8], storing: &Storing<M>) -> Result<Snapshot<M>, Fault> {
    let refuse = |why: String| Fault::new(format!("these {} bytes are not a state of this FMU: {why}", bytes.len()));
    let Some((body, checksum)) = bytes.split_last_chunk::<CHECKSUM>() else { return Err(refuse("too short".into())) };
    let Some((header, room)) = body.split_first_chunk::<HEADER>() else { return Err(refuse("too short".into())) };
    let (fixed, length) = header.split_at(HEADER - 4);
    let expected = self::header::<M>(0);
    if header[..8] != MAGIC[..] {
        return Err(refuse("they lack the header of a state".into()));
    }
    if header[12..28] != expected[12..28] {
        return Err(refuse(format!("another model, or another version than {} {}", M::INFO.name, M::INFO.version)));
    }
    if *fixed != expected[..HEADER - 4] {
        return Err(refuse("written by another version of this FMU".into()));
    }
    let length = length.iter().rev().fold(0_usize, |n, &byte| (n << 8) | usize::from(byte));
    if length > room.len() || padded(length, storing)? != bytes.len() {
        return Err(refuse(format!("{length} bytes of content do not fit this size")));
    }
    if crc32(body).to_le_bytes() != *checksum {
        return Err(refuse("the checksum differs".into()));
    }
    let read = || {
        let (head, rest) = saved::read::<Head>(&room[..length])?;
        let (model, rest) = (storing.read)(rest)?;
        let (out, rest) = saved::read(rest)?;
        Ok((head.with(Block { model, out }), rest))
    };
    let (mut state, rest) = read().map_err(|fault: Fault| refuse(fault.to_string()))?;
    if !rest.is_empty() {
        return Err(refuse("content".into()));
    }
    make_room(&mut state.block);
    if !state.fits_its_interface() {
        return Err(refuse("content".into()));
    }
    state.check().and_then(|()| state.check_time()).map_err(|fault| refuse(fault.to_string()))?;
    // Tunable parameters set since the last step are checked by the next one.
    let unjudged = matches!(
        state.life.state(),
        State::Instantiated | State::Configuration | State::Initialization | State::Reconfiguration | State::Error
    );
    if !unjudged && !state.dirty {
        let model = &state.block.model;
        let judged = model.validate().and_then(|()| model.validate_for(state.life.interface()));
        judged.map_err(|fault| refuse(fault.to_string()))?;
    }
    Ok(state)
}

fn header<M: Model>(length: u32) -> [u8; HEADER] {
    let mut header = [0; HEADER];
    header[..8].copy_from_slice(MAGIC);
    header[8..10].copy_from_slice(&FORMAT.to_le_bytes());
    header[10..12].copy_from_slice(&M::STATE_VERSION.to_le_bytes());
    header[12..28].copy_from_slice(&M::HASH.to_bytes());
    header[28..].copy_from_slice(&length.to_le_bytes());
    header
}

fn payload_size<M: Model>(state: &Snapshot<M>, storing: &Storing<M>) -> Result<usize, Fault> {
    Ok(saved::size(&state.head())? + (storing.size)(&state.block.model)? + saved::size(&state.block.out)?)
}

/// Size of a payload: twice the size for a new model, and a reserve for integers that grow from one byte to ten.
fn unit<M: Model>(storing: &Storing<M>) -> Result<usize, Fault> {
    Ok((2 * payload_size(&Snapshot::<M>::default(), storing)?).next_multiple_of(64) + 64)
}

fn padded<M: Model>(payload: usize, storing: &Storing<M>) -> Result<usize, Fault> {
    Ok(HEADER + payload.next_multiple_of(unit(storing)?) + CHECKSUM)
}

/// The resources of a model.
pub(crate) fn shelf<M: Model>(model: &M, storing: &Storing<M>) -> Shelf {
    // A model that cannot be serialized fails later, when a state is written.
    Shelf::of(|| drop((storing.size)(model)))
}

/// CRC-32 of ISO 3309, as in PNG and ZIP, by a table for one byte.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = !0_u32;
    for &byte in bytes {
        crc = (crc >> 8) ^ BY_BYTE[usize::from(byte ^ crc.to_le_bytes()[0])];
    }
    !crc
}

/// CRC-32 of each byte alone, without the inversions at start and end.
static BY_BYTE: [u32; 256] = {
    let (mut table, mut byte) = ([0; 256], 0_u32);
    while byte < 256 {
        let (mut crc, mut bit) = (byte, 0);
        while bit < 8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
            bit += 1;
        }
        table[byte as usize] = crc;
        byte += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    #[test]
    fn checksum_of_the_catalog() {
        assert_eq!(super::crc32(b"123456789"), 0xcbf4_3926);
    }
}
