//! Getting and setting bytes (FMI 3.0.2, 2.2.7.2).

use super::arguments::Given;
use super::functions::Calls;
use crate::standard::{Outcome, Refusal};
use std::ptr;
use std::slice;

/// Greatest size of a value that is copied from an FMU, in bytes.
const MOST: usize = 1 << 30;

impl Calls {
    /// The `count` values of a variable.
    pub(super) fn get_binary(&self, i: Given<'_>, reference: u32, count: usize) -> Outcome<Vec<Vec<u8>>> {
        let (mut sizes, mut places) = (vec![0; count], vec![ptr::null(); count]);
        let answer = self.get_binary_3.call(|f| {
            // SAFETY: the standard's type; both arrays have room for all values.
            unsafe { f(i.0, &raw const reference, 1, sizes.as_mut_ptr(), places.as_mut_ptr(), count) }
        });
        answer.outcome()?;
        let copy = |(place, size): (*const u8, usize)| match size {
            0 => Ok(Vec::new()),
            size if place.is_null() || size > MOST => {
                Err(Refusal::Impossible(format!("the FMU gives {size} bytes at {place:?}")))
            }
            // SAFETY: the FMU's bytes, as many as it says, which live until its next call.
            size => Ok(unsafe { slice::from_raw_parts(place, size) }.to_vec()),
        };
        places.into_iter().zip(sizes).map(copy).collect()
    }

    /// Sets the values of a variable.
    pub(super) fn set_binary(&self, i: Given<'_>, reference: u32, values: &[Vec<u8>]) -> Outcome {
        let sizes: Vec<usize> = values.iter().map(Vec::len).collect();
        let places: Vec<*const u8> = values.iter().map(Vec::as_ptr).collect();
        let answer = self.set_binary_3.call(|f| {
            // SAFETY: the standard's type; the arrays have all values, which outlive the call.
            unsafe { f(i.0, &raw const reference, 1, sizes.as_ptr(), places.as_ptr(), values.len()) }
        });
        answer.outcome()
    }
}
