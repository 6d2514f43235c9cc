//! The calls through the C interface, with their results.

use crate::common::unsupported::{FMI2_UNSUPPORTED, FMI3_UNSUPPORTED};
use crate::common::*;
use crate::operation::{Arrays, Categories, Kind, Mixed};
use crate::reference::elements;
use fmu_export::abi::types::*;
use std::ptr::{null, null_mut};

/// Status, name of the function.
pub(crate) type Done = (c_int, &'static str);

/// Calls the function of one standard or of the other, and names it.
macro_rules! either {
    ($version:expr, $two:ident($($a:expr),*), $three:ident($($b:expr),*)) => {
        if $version == 2 {
            (unsafe { $two($($a),*) }, stringify!($two))
        } else {
            (unsafe { $three($($b),*) }, stringify!($three))
        }
    };
}

pub(crate) fn logging(version: u8, it: InstancePointer, on: bool, categories: &Categories) -> Done {
    let terminated: Vec<Option<Vec<u8>>> = match categories {
        Categories::Names(names) => names.iter().map(|n| n.map(|n| [n, b"\0"].concat())).collect(),
        Categories::NullOf(_) => Vec::new(),
    };
    let list: Vec<Text> = terminated.iter().map(|n| n.as_ref().map_or(null(), |n| n.as_ptr().cast())).collect();
    let (n, pointer) = match categories {
        Categories::Names(_) if list.is_empty() => (0, null()),
        Categories::Names(_) => (list.len(), list.as_ptr()),
        Categories::NullOf(n) => (*n, null()),
    };
    let on = u8::from(on);
    either!(
        version,
        fmi2SetDebugLogging(it, Fmi2Boolean(on.into()), n, pointer),
        fmi3SetDebugLogging(it, Fmi3Boolean(on), n, pointer)
    )
}

pub(crate) fn set_up(it: InstancePointer, start: f64, stop: Option<f64>) -> Done {
    let (defined, stop) = (Fmi2Boolean(stop.is_some().into()), stop.unwrap_or(f64::NAN));
    (unsafe { fmi2SetupExperiment(it, Fmi2Boolean(0), f64::NAN, start, defined, stop) }, "fmi2SetupExperiment")
}

pub(crate) fn enter(version: u8, it: InstancePointer, start: f64, stop: Option<f64>) -> Done {
    let (defined, stop, no) = (Fmi3Boolean(stop.is_some().into()), stop.unwrap_or(f64::NAN), Fmi3Boolean(0));
    either!(
        version,
        fmi2EnterInitializationMode(it),
        fmi3EnterInitializationMode(it, no, f64::NAN, start, defined, stop)
    )
}

pub(crate) fn exit(version: u8, it: InstancePointer) -> Done {
    either!(version, fmi2ExitInitializationMode(it), fmi3ExitInitializationMode(it))
}

pub(crate) fn terminate(version: u8, it: InstancePointer) -> Done {
    either!(version, fmi2Terminate(it), fmi3Terminate(it))
}

pub(crate) fn reset(version: u8, it: InstancePointer) -> Done {
    either!(version, fmi2Reset(it), fmi3Reset(it))
}

/// A step; `null` is the missing result of FMI 3.0.
pub(crate) fn step(version: u8, it: InstancePointer, (t, h): (f64, f64), free: bool, null: usize) -> Done {
    let (mut flags, mut last) = ([Fmi3Boolean(7); 3], f64::NAN);
    let [a, b, c] = std::array::from_fn(|i| if i == null { null_mut() } else { &raw mut flags[i] });
    let time = if null == 3 { null_mut() } else { &raw mut last };
    let done = either!(
        version,
        fmi2DoStep(it, t, h, Fmi2Boolean(free.into())),
        fmi3DoStep(it, t, h, Fmi3Boolean(free.into()), a, b, c, time)
    );
    if version == 3 && done.0 == OK {
        assert_eq!((flags.map(|f| f.0), last.to_bits()), ([0; 3], (t + h).to_bits()));
    }
    done
}

/// Bytes that do not occur by accident.
const CANARY: u8 = 0xa5;

/// Arrays of a getter or setter in memory with guard bytes.
struct Memory {
    references: *const u32,
    n: usize,
    /// Number of values stated by the importer.
    m: usize,
    cells: Vec<u64>,
    misaligned: bool,
    null: bool,
}

impl Memory {
    fn new(version: u8, references: &[u32], arrays: Arrays) -> Self {
        let of = |&r: &u32| elements(version, r).unwrap_or(1);
        let m: usize = references.iter().map(of).sum();
        let m = match arrays {
            Arrays::More if version == 3 => m + 1,
            Arrays::Less if version == 3 => m.saturating_sub(1),
            _ => m,
        };
        let empty = references.is_empty();
        Self {
            references: if empty || arrays == Arrays::NullReferences { null() } else { references.as_ptr() },
            n: references.len(),
            m,
            cells: vec![u64::from_ne_bytes([CANARY; 8]); 48],
            misaligned: arrays == Arrays::Misaligned,
            null: m == 0 || arrays == Arrays::NullValues,
        }
    }

    fn values<T>(&mut self) -> *mut T {
        let start = self.cells.as_mut_ptr().cast::<u8>();
        if self.null { null_mut() } else { start.wrapping_add(self.misaligned.into()).cast() }
    }

    /// The values; checks that nothing is written past them.
    fn read<T>(&self) -> Vec<u64> {
        let bytes: Vec<u8> = self.cells.iter().flat_map(|cell| cell.to_ne_bytes()).collect();
        let (values, rest) = bytes[usize::from(self.misaligned)..].split_at(self.m * size_of::<T>());
        assert!(rest.iter().all(|&b| b == CANARY), "written behind the values");
        let wide = |value: &[u8]| {
            let mut bytes = [0; 8];
            bytes[..value.len()].copy_from_slice(value);
            u64::from_le_bytes(bytes)
        };
        values.chunks(size_of::<T>()).map(wide).collect()
    }
}

/// One getter or setter on a memory.
macro_rules! access {
    ($memory:ident, $it:ident, $type:ty, $name:ident($($m:expr)?)) => {{
        let values = $memory.values::<$type>();
        (unsafe { $name($it, $memory.references, $memory.n, values $(, $m)?) }, stringify!($name), size_of::<$type>())
    }};
}

pub(crate) fn get(
    version: u8,
    it: InstancePointer,
    kind: Kind,
    references: &[u32],
    arrays: Arrays,
) -> (Done, Vec<u64>) {
    let mut memory = Memory::new(version, references, arrays);
    let m = memory.m;
    let mut sizes = [0_usize; 64];
    let (status, name, width) = match (version, kind) {
        (2, Kind::Real) => access!(memory, it, f64, fmi2GetReal()),
        (2, Kind::Integer | Kind::Enumeration) => access!(memory, it, Fmi2Integer, fmi2GetInteger()),
        (2, Kind::Boolean) => access!(memory, it, Fmi2Boolean, fmi2GetBoolean()),
        (2, Kind::Foreign(_)) => access!(memory, it, Text, fmi2GetString()),
        (_, Kind::Real) => access!(memory, it, f64, fmi3GetFloat64(m)),
        (_, Kind::Integer) => access!(memory, it, i32, fmi3GetInt32(m)),
        (_, Kind::Enumeration) => access!(memory, it, i64, fmi3GetInt64(m)),
        (_, Kind::Boolean) => access!(memory, it, Fmi3Boolean, fmi3GetBoolean(m)),
        (_, Kind::Foreign(0)) => access!(memory, it, f32, fmi3GetFloat32(m)),
        (_, Kind::Foreign(1)) => access!(memory, it, i8, fmi3GetInt8(m)),
        (_, Kind::Foreign(2)) => access!(memory, it, u8, fmi3GetUInt8(m)),
        (_, Kind::Foreign(3)) => access!(memory, it, i16, fmi3GetInt16(m)),
        (_, Kind::Foreign(4)) => access!(memory, it, u16, fmi3GetUInt16(m)),
        (_, Kind::Foreign(5)) => access!(memory, it, u32, fmi3GetUInt32(m)),
        (_, Kind::Foreign(6)) => access!(memory, it, u64, fmi3GetUInt64(m)),
        (_, Kind::Foreign(7)) => access!(memory, it, Text, fmi3GetString(m)),
        (_, Kind::Foreign(_)) => {
            let values = memory.values();
            let (references, n) = (memory.references, memory.n);
            (unsafe { fmi3GetBinary(it, references, n, sizes.as_mut_ptr(), values, m) }, "fmi3GetBinary", 8)
        }
    };
    let bits = match width {
        1 => memory.read::<u8>(),
        2 => memory.read::<u16>(),
        4 => memory.read::<u32>(),
        _ => memory.read::<u64>(),
    };
    ((status, name), bits)
}

pub(crate) fn set(
    version: u8,
    it: InstancePointer,
    kind: Kind,
    references: &[u32],
    values: &[Mixed],
    arrays: Arrays,
) -> Done {
    let mut memory = Memory::new(version, references, arrays);
    let m = memory.m;
    let width = match (version, kind) {
        (_, Kind::Real) | (3, Kind::Enumeration) => 8,
        (3, Kind::Boolean) => 1,
        _ => 4,
    };
    let bytes = values.iter().flat_map(|value| match kind {
        Kind::Real => value.real.to_ne_bytes()[..width].to_vec(),
        Kind::Boolean => u32::from(value.truth).to_ne_bytes()[..width].to_vec(),
        _ => value.integer.to_ne_bytes()[..width].to_vec(),
    });
    let mut bytes: Vec<u8> = std::iter::repeat_n(CANARY, memory.misaligned.into()).chain(bytes).collect();
    bytes.resize(8 * memory.cells.len(), CANARY);
    for (cell, bytes) in memory.cells.iter_mut().zip(bytes.chunks_exact(8)) {
        *cell = u64::from_ne_bytes(bytes.try_into().unwrap());
    }
    let sizes = [0_usize; 64];
    let (status, name, _) = match (version, kind) {
        (2, Kind::Real) => access!(memory, it, f64, fmi2SetReal()),
        (2, Kind::Integer | Kind::Enumeration) => access!(memory, it, Fmi2Integer, fmi2SetInteger()),
        (2, Kind::Boolean) => access!(memory, it, Fmi2Boolean, fmi2SetBoolean()),
        (2, Kind::Foreign(_)) => access!(memory, it, Text, fmi2SetString()),
        (_, Kind::Real) => access!(memory, it, f64, fmi3SetFloat64(m)),
        (_, Kind::Integer) => access!(memory, it, i32, fmi3SetInt32(m)),
        (_, Kind::Enumeration) => access!(memory, it, i64, fmi3SetInt64(m)),
        (_, Kind::Boolean) => access!(memory, it, Fmi3Boolean, fmi3SetBoolean(m)),
        (_, Kind::Foreign(0)) => access!(memory, it, f32, fmi3SetFloat32(m)),
        (_, Kind::Foreign(1)) => access!(memory, it, i8, fmi3SetInt8(m)),
        (_, Kind::Foreign(2)) => access!(memory, it, u8, fmi3SetUInt8(m)),
        (_, Kind::Foreign(3)) => access!(memory, it, i16, fmi3SetInt16(m)),
        (_, Kind::Foreign(4)) => access!(memory, it, u16, fmi3SetUInt16(m)),
        (_, Kind::Foreign(5)) => access!(memory, it, u32, fmi3SetUInt32(m)),
        (_, Kind::Foreign(6)) => access!(memory, it, u64, fmi3SetUInt64(m)),
        (_, Kind::Foreign(7)) => access!(memory, it, Text, fmi3SetString(m)),
        (_, Kind::Foreign(_)) => {
            let values = memory.values::<*const u8>();
            let (references, n) = (memory.references, memory.n);
            (unsafe { fmi3SetBinary(it, references, n, sizes.as_ptr(), values, m) }, "fmi3SetBinary", 8)
        }
    };
    (status, name)
}

pub(crate) fn save(version: u8, it: InstancePointer, state: *mut FmuState) -> Done {
    either!(version, fmi2GetFMUstate(it, state), fmi3GetFMUState(it, state))
}

pub(crate) fn restore(version: u8, it: InstancePointer, state: FmuState) -> Done {
    either!(version, fmi2SetFMUstate(it, state), fmi3SetFMUState(it, state))
}

pub(crate) fn free_state(version: u8, it: InstancePointer, state: *mut FmuState) -> Done {
    either!(version, fmi2FreeFMUstate(it, state), fmi3FreeFMUState(it, state))
}

pub(crate) fn size(version: u8, it: InstancePointer, state: FmuState, size: *mut usize) -> Done {
    either!(version, fmi2SerializedFMUstateSize(it, state, size), fmi3SerializedFMUStateSize(it, state, size))
}

pub(crate) fn serialize(version: u8, it: InstancePointer, state: FmuState, bytes: *mut u8, n: usize) -> Done {
    either!(version, fmi2SerializeFMUstate(it, state, bytes, n), fmi3SerializeFMUState(it, state, bytes, n))
}

pub(crate) fn deserialize(version: u8, it: InstancePointer, bytes: *const u8, n: usize, state: *mut FmuState) -> Done {
    either!(version, fmi2DeSerializeFMUstate(it, bytes, n, state), fmi3DeserializeFMUState(it, bytes, n, state))
}

pub(crate) fn status(it: InstancePointer, function: u8, kind: c_int, null: bool) -> Done {
    let (mut status, mut real, mut integer, mut truth, mut text) =
        (9, f64::NAN, Fmi2Integer(9), Fmi2Boolean(9), std::ptr::null());
    macro_rules! one {
        ($name:ident, $place:expr) => {
            (unsafe { $name(it, kind, if null { null_mut() } else { &raw mut $place }) }, stringify!($name))
        };
    }
    let done = match function {
        0 => one!(fmi2GetStatus, status),
        1 => one!(fmi2GetRealStatus, real),
        2 => one!(fmi2GetIntegerStatus, integer),
        3 => one!(fmi2GetBooleanStatus, truth),
        _ => one!(fmi2GetStringStatus, text),
    };
    let written = (status != 9, !real.is_nan(), integer.0 != 9, truth.0 != 9, !text.is_null());
    let ok = done.0 == OK;
    assert_eq!(written, (false, ok && function == 1, false, ok && function == 3, false));
    done
}

pub(crate) fn unsupported(version: u8, it: InstancePointer, number: usize) -> Done {
    let table = if version == 2 { FMI2_UNSUPPORTED } else { FMI3_UNSUPPORTED };
    let (name, call) = table[number % table.len()];
    (call(it), name)
}

/// Tries to create an instance with a wrong argument; it must be NULL.
pub(crate) fn miscarry(version: u8, wrong: u8, environment: *mut c_void) -> &'static str {
    loud();
    let (token, other) = (token(), c"{00000000-0000-0000-0000-000000000000}");
    let token = match wrong {
        1 => other.as_ptr(),
        2 => null(),
        _ => token.as_ptr(),
    };
    let name = match wrong {
        3 => null(),
        4 => c" \t".as_ptr(),
        _ => c"probe".as_ptr(),
    };
    let no = Fmi3Boolean(0);
    let (it, function) = match (version, wrong) {
        (2, _) => {
            let callbacks = Fmi2Callbacks {
                logger: has_logger(2).then(|| variadic(log2)),
                allocate_memory: null(),
                free_memory: null(),
                step_finished: null(),
                environment,
            };
            let (no, kind) =
                (Fmi2Boolean(0), if wrong < 5 { 1 } else { c_int::from(wrong) - 5 + c_int::from(wrong > 5) });
            (unsafe { fmi2Instantiate(name, kind, token, null(), &raw const callbacks, no, no) }, "fmi2Instantiate")
        }
        (_, 6) => (
            unsafe { fmi3InstantiateModelExchange(name, token, null(), no, no, environment, Some(log3)) },
            "fmi3InstantiateModelExchange",
        ),
        (_, 7) => (
            unsafe {
                fmi3InstantiateScheduledExecution(
                    name,
                    token,
                    null(),
                    no,
                    no,
                    environment,
                    Some(log3),
                    None,
                    None,
                    None,
                )
            },
            "fmi3InstantiateScheduledExecution",
        ),
        _ => {
            let event = Fmi3Boolean(u8::from(wrong == 5));
            (
                unsafe {
                    fmi3InstantiateCoSimulation(
                        name,
                        token,
                        null(),
                        no,
                        no,
                        event,
                        no,
                        null(),
                        0,
                        environment,
                        Some(log3),
                        None,
                    )
                },
                "fmi3InstantiateCoSimulation",
            )
        }
    };
    assert!(it.is_null(), "{function} with the mistake {wrong}");
    function
}
