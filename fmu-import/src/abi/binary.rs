//! Getting and setting bytes (FMI 3.0.2, 2.2.7.2).

use super::arguments::{Answer, Given};
use super::functions::Calls;
use super::log::Status;
use crate::standard::{Outcome, Refusal};
use std::ptr;
use std::slice;

/// Maximum size of a value that is copied from an FMU, in bytes.
const MOST: usize = 1 << 30;

/// Address and number of bytes in the FMU.
type Place = (*const u8, usize);

impl Calls {
    /// The `count` values of a variable.
    pub(super) fn get_binary(&self, i: Given<'_>, reference: u32, count: usize) -> Outcome<Vec<Vec<u8>>> {
        let (answer, places) = self.places(i, &[reference], count);
        answer.outcome()?;
        let copy = |(place, size): Place| match size {
            0 => Ok(Vec::new()),
            size if place.is_null() || size > MOST => {
                Err(Refusal::Impossible(format!("the FMU gives {size} bytes at {place:?}")))
            }
            // SAFETY: the FMU's bytes, as many as it states, valid until its next call.
            size => Ok(unsafe { slice::from_raw_parts(place, size) }.to_vec()),
        };
        places.into_iter().map(copy).collect()
    }

    /// Sets the values of a variable.
    pub(super) fn set_binary(&self, i: Given<'_>, reference: u32, values: &[Vec<u8>]) -> Outcome {
        self.put_binaries(i, &[reference], values).outcome()
    }

    /// For the checker: a value for each reference, `None` for NULL and for more bytes than the limit.
    pub(super) fn binaries(&self, i: Given<'_>, references: &[u32]) -> Option<(Status, Vec<Option<Vec<u8>>>)> {
        let (answer, places) = self.places(i, references, references.len());
        let status = answer.status()?;
        let copy = |(place, size): Place| {
            // SAFETY: as above.
            (!place.is_null() && size <= MOST).then(|| unsafe { slice::from_raw_parts(place, size) }.to_vec())
        };
        Some((status, if status.is_ok() { places.into_iter().map(copy).collect() } else { Vec::new() }))
    }

    /// Passes these values.
    pub(super) fn put_binaries(&self, i: Given<'_>, references: &[u32], values: &[Vec<u8>]) -> Answer {
        let sizes: Vec<usize> = values.iter().map(Vec::len).collect();
        let places: Vec<*const u8> = values.iter().map(Vec::as_ptr).collect();
        let (list, n) = (references.as_ptr(), references.len());
        // SAFETY: the standard's type; the arrays have all values, which outlive the call.
        self.set_binary_3.call(|f| unsafe { f(i.0, list, n, sizes.as_ptr(), places.as_ptr(), values.len()) })
    }

    /// Address of the values in the FMU.
    fn places(&self, i: Given<'_>, references: &[u32], count: usize) -> (Answer, Vec<Place>) {
        let (mut sizes, mut places) = (vec![0; count], vec![ptr::null(); count]);
        let (list, n) = (references.as_ptr(), references.len());
        let answer = self.get_binary_3.call(|f| {
            // SAFETY: the standard's type; both arrays have room for all values.
            unsafe { f(i.0, list, n, sizes.as_mut_ptr(), places.as_mut_ptr(), count) }
        });
        (answer, places.into_iter().zip(sizes).collect())
    }
}
