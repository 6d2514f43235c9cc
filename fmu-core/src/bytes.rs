//! The bytes of a binary variable of FMI 3.0.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::{Deref, DerefMut};

/// Bytes with spare capacity. The exporter reserves the maximum size of the row, and a clone keeps that capacity, so setting
/// them allocates nothing.
///
/// ```
/// # use fmu_core::Bytes;
/// let mut frame = Bytes::from(b"foo");
/// frame.set(&[1, 2, 3]);
/// frame.extend(&[255]);
/// assert_eq!((frame.len(), frame.to_string()), (4, "010203ff".into()));
/// ```
#[derive(Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bytes(Vec<u8>);

impl Bytes {
    /// Replaces the content.
    pub fn set(&mut self, bytes: &[u8]) {
        self.0.clear();
        self.0.extend_from_slice(bytes);
    }

    /// Adds to the content.
    pub fn extend(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }

    /// Removes the content and keeps the capacity.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Reserves capacity for `most` bytes in total.
    pub fn reserve(&mut self, most: usize) {
        self.0.reserve_exact(most.saturating_sub(self.0.len()));
    }

    /// Parses pairs of hexadecimal digits; `None` for any other text.
    pub fn from_hex(text: &str) -> Option<Self> {
        let (pairs, rest) = text.as_bytes().as_chunks::<2>();
        let digit = |byte: u8| char::from(byte).to_digit(16).and_then(|x| u8::try_from(x).ok());
        let byte = |[high, low]: &[u8; 2]| Some(16 * digit(*high)? + digit(*low)?);
        if rest.is_empty() { pairs.iter().map(byte).collect::<Option<_>>().map(Self) } else { None }
    }
}

impl Clone for Bytes {
    fn clone(&self) -> Self {
        let mut bytes = Vec::with_capacity(self.0.capacity());
        bytes.extend_from_slice(&self.0);
        Self(bytes)
    }

    fn clone_from(&mut self, source: &Self) {
        self.set(source);
    }
}

impl<T: AsRef<[u8]>> From<T> for Bytes {
    fn from(bytes: T) -> Self {
        Self(bytes.as_ref().to_vec())
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}

impl DerefMut for Bytes {
    fn deref_mut(&mut self) -> &mut [u8] {
        &mut self.0
    }
}

/// Two hexadecimal digits for each byte.
impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clone_has_the_same_room() {
        let mut bytes = Bytes::from([1, 2]);
        bytes.reserve(100);
        let mut copy = bytes.clone();
        let place = copy.as_ptr();
        copy.set(&[7; 100]);
        assert_eq!((copy.as_ptr(), copy.len()), (place, 100));
        copy.clone_from(&bytes);
        assert_eq!((copy.as_ptr(), &*copy), (place, &[1, 2][..]));
    }

    #[test]
    fn cleared_bytes_keep_their_room() {
        let mut bytes = Bytes::from([1, 2]);
        bytes.reserve(100);
        let place = bytes.as_ptr();
        bytes.clear();
        assert!(bytes.is_empty());
        bytes.extend(&[3; 100]);
        assert_eq!((bytes.as_ptr(), bytes.len()), (place, 100));
    }

    #[test]
    fn digits_come_in_pairs() {
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(Bytes::from_hex(&Bytes::from(&all).to_string()), Some(Bytes::from(&all)));
        assert_eq!(Bytes::from_hex("666F6f"), Some(Bytes::from(b"foo")));
        assert_eq!(Bytes::from_hex(""), Some(Bytes::default()));
        for wrong in ["6", "6g", "0x66", "66 6f", "\u{e9}"] {
            assert_eq!(Bytes::from_hex(wrong), None, "{wrong}");
        }
    }
}
