//! Saved states of an instance, and their bytes.

use super::{Fmu, OK};
use crate::fmi::*;
use fmu_export::abi::types::*;
use std::ptr::null_mut;

impl Fmu {
    pub fn save(&self, state: &mut FmuState) -> c_int {
        either!(self, fmi2GetFMUstate(state), fmi3GetFMUState(state))
    }

    pub fn restore(&self, state: FmuState) -> c_int {
        either!(self, fmi2SetFMUstate(state), fmi3SetFMUState(state))
    }

    pub fn free_state(&self, state: &mut FmuState) -> c_int {
        either!(self, fmi2FreeFMUstate(state), fmi3FreeFMUState(state))
    }

    pub fn deserialize(&self, bytes: &[u8], state: &mut FmuState) -> c_int {
        let (p, n) = (bytes.as_ptr(), bytes.len());
        either!(self, fmi2DeSerializeFMUstate(p, n, state), fmi3DeserializeFMUState(p, n, state))
    }

    /// A saved state as bytes.
    pub fn serialized(&self, state: FmuState) -> Vec<u8> {
        let mut size = 0;
        let status = either!(
            self,
            fmi2SerializedFMUstateSize(state, &raw mut size),
            fmi3SerializedFMUStateSize(state, &raw mut size)
        );
        assert_eq!(status, OK);
        let mut bytes = vec![0xaa; size];
        let p = bytes.as_mut_ptr();
        assert_eq!(either!(self, fmi2SerializeFMUstate(state, p, size), fmi3SerializeFMUState(state, p, size)), OK);
        bytes
    }

    /// The state as bytes.
    pub fn bytes(&self) -> Vec<u8> {
        let mut state = null_mut();
        assert_eq!(self.save(&mut state), OK);
        let bytes = self.serialized(state);
        assert_eq!(self.free_state(&mut state), OK);
        bytes
    }
}
