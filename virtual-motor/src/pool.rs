//! Motors by ids, for callers that must not hold a pointer.
//!
//! A motor stands in one of [`MOST`] slots until it is destroyed. Its id is the number of the slot and the slot's generation,
//! which grows with every destroyed motor, so an old id is refused, and the id 0 belongs to no motor. Each slot has a lock of its
//! own: threads with different motors do not wait for each other, and two calls on one motor take place one after the other.

use crate::error::{Error, ErrorCode, Result};
use crate::motor::VirtualMotor;
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

/// Maximum number of motors at a time.
pub const MOST: usize = 256;

/// The id of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct MotorId {
    /// Number of the slot, from 1 on; 0: no motor.
    pub index: u32,
    /// Generation of the slot.
    pub generation: u32,
}

struct Place {
    generation: u32,
    /// A call uses the motor; afterward, a panic has ended that call.
    busy: bool,
    motor: Option<Box<VirtualMotor>>,
}

static PLACES: [Mutex<Place>; MOST] = [const { Mutex::new(Place { generation: 1, busy: false, motor: None }) }; MOST];

/// Makes a motor and puts it into a free slot.
///
/// # Errors
/// There are [`MOST`] motors, or those of `make`.
pub fn insert(make: impl FnOnce() -> Result<VirtualMotor>) -> Result<MotorId> {
    let motor = Box::new(make()?);
    for (place, index) in PLACES.iter().zip(1..) {
        // A slot with a call in progress has a motor.
        let mut place = match place.try_lock() {
            Ok(place) => place,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => continue,
        };
        if place.motor.is_none() {
            place.motor = Some(motor);
            return Ok(MotorId { index, generation: place.generation });
        }
    }
    Err(Error::new(ErrorCode::TooMany, format_args!("there are {MOST} motors, the maximum number: destroy one first")))
}

/// Destroys a motor, also one in which a call has panicked. Its id is not valid anymore.
///
/// # Errors
/// The id belongs to no motor.
pub fn remove(id: MotorId) -> Result<()> {
    let mut place = at(id)?;
    let motor = place.motor.take();
    (place.generation, place.busy) = (place.generation.wrapping_add(1), false);
    drop(place);
    drop(motor);
    Ok(())
}

/// Whether the id belongs to a motor.
pub fn contains(id: MotorId) -> bool {
    at(id).is_ok()
}

/// Uses a motor.
///
/// # Errors
/// The id belongs to no motor, a call on this motor has panicked, or those of `body`.
pub fn with<T>(id: MotorId, body: impl FnOnce(&mut VirtualMotor) -> Result<T>) -> Result<T> {
    let mut place = at(id)?;
    if place.busy {
        let text = format_args!("{}: an earlier call on this motor panicked: destroy it", named(id));
        return Err(Error::new(ErrorCode::Panicked, text));
    }
    let place = &mut *place;
    let Some(motor) = &mut place.motor else { return Err(unknown(id)) };
    place.busy = true;
    let result = body(motor);
    place.busy = false;
    result
}

/// The locked slot of a motor.
fn at(id: MotorId) -> Result<MutexGuard<'static, Place>> {
    let place = (id.index as usize).checked_sub(1).and_then(|index| PLACES.get(index));
    let place = place.ok_or_else(|| unknown(id))?.lock().unwrap_or_else(PoisonError::into_inner);
    if place.generation == id.generation && place.motor.is_some() { Ok(place) } else { Err(unknown(id)) }
}

fn named(id: MotorId) -> String {
    format!("motor = {{{}, {}}}", id.index, id.generation)
}

#[cold]
fn unknown(id: MotorId) -> Error {
    let why = if id.index == 0 { "it is the null id" } else { "no motor has this id, or it was destroyed" };
    Error::new(ErrorCode::BadId, format_args!("{} is not allowed: {why}", named(id)))
}
