//! Arguments and results of calls for the call log: from C pointers to values.

use super::pointer::{array, text};
use super::structs::Fmi2EventInfo;
use crate::call_log::CallLog;
use crate::value::{Fmi2Boolean, Fmi2Integer, Fmi3Boolean};
use fmu_core::call_log::{LogValue, NamedValue};
use std::ffi::{c_char, c_int, c_void};
use std::fmt::Debug;

/// An argument with its name.
pub type Passed = (&'static str, Argument);

/// An argument of a C function.
#[derive(Clone, Debug)]
pub enum Argument {
    /// A number, a text, or whether there is a function.
    Value(LogValue),
    /// Number of elements of arrays.
    Count(usize),
    /// An array that the function reads, or a saved state.
    Read(*const c_void, Element),
    /// An array or a variable that the function writes.
    Write(*const c_void, Element),
}

/// The type of an element behind a pointer.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the C types")]
pub enum Element {
    F32,
    F64,
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    Size,
    /// A text or bytes.
    Pointer,
    /// The pointer itself is a saved state.
    State,
    /// A variable for a saved state.
    StatePlace,
    EventInfo,
}

/// A C type behind a pointer.
pub trait CElement {
    /// Which one.
    const ELEMENT: Element;
}

/// A C type of an argument.
pub trait CArgument {
    /// The argument for the log. No pointer is followed yet.
    fn argument(self) -> Argument;
}

macro_rules! elements {
    ($($type:ty => $element:ident),* $(,)?) => { $(impl CElement for $type {
        const ELEMENT: Element = Element::$element;
    })* };
}

elements! {
    f32 => F32, f64 => F64, i8 => I8, i16 => I16, i32 => I32, i64 => I64, u8 => U8, u16 => U16, u32 => U32, u64 => U64,
    usize => Size, Fmi2Boolean => I32, Fmi2Integer => I32, Fmi3Boolean => U8, *const i8 => Pointer, *const u8 => Pointer,
    c_void => State, *mut c_void => StatePlace, Fmi2EventInfo => EventInfo,
}

macro_rules! numbers {
    ($($type:ty: $x:ident => $number:expr),* $(,)?) => { $(impl CArgument for $type {
        fn argument(self) -> Argument {
            let $x = self;
            Argument::Value(number(&$number))
        }
    })* };
}

numbers! { f64: x => x, c_int: x => x, u32: x => x, Fmi2Boolean: x => x.0, Fmi3Boolean: x => x.0 }

impl CArgument for usize {
    fn argument(self) -> Argument {
        Argument::Count(self)
    }
}

impl<T: CElement> CArgument for *const T {
    fn argument(self) -> Argument {
        Argument::Read(self.cast(), T::ELEMENT)
    }
}

impl<T: CElement> CArgument for *mut T {
    fn argument(self) -> Argument {
        Argument::Write(self.cast_const().cast(), T::ELEMENT)
    }
}

impl Argument {
    /// A text.
    ///
    /// # Safety
    /// `pointer` is NULL or a C string.
    pub unsafe fn text(pointer: *const c_char) -> Self {
        // SAFETY: the caller's promise.
        Self::Value(unsafe { shown_text(pointer) })
    }

    /// Whether a pointer or a function was passed.
    pub fn given(is_given: bool) -> Self {
        Self::Value(if is_given { LogValue::Given } else { LogValue::Null })
    }
}

fn number(x: &impl Debug) -> LogValue {
    LogValue::Number(format!("{x:?}"))
}

/// # Safety
/// `pointer` is NULL or a C string.
unsafe fn shown_text(pointer: *const c_char) -> LogValue {
    // SAFETY: the caller's promise.
    unsafe { text(pointer) }.map_or(LogValue::Null, |text| LogValue::Text(text.to_bytes().to_vec()))
}

/// The arguments at the beginning of the call `function`.
///
/// # Safety
/// The arguments follow the standard.
pub(super) unsafe fn arguments(function: &str, passed: &[Passed], log: &mut CallLog) -> Vec<NamedValue> {
    let value = |(i, (name, argument)): (usize, &Passed)| {
        let value = match *argument {
            Argument::Value(ref value) => value.clone(),
            Argument::Count(n) => number(&n),
            Argument::Read(pointer, _) | Argument::Write(pointer, _) if pointer.is_null() => LogValue::Null,
            Argument::Read(pointer, Element::State) | Argument::Write(pointer, Element::State) => {
                log.state(pointer.addr())
            }
            // SAFETY: the importer's variable, which it has initialized for these two functions.
            Argument::Write(..) if is_state_kept(function, argument) => unsafe { shown(passed, i, log) },
            Argument::Write(..) => LogValue::Room(count(passed, i).unwrap_or(1)),
            // SAFETY: the importer's array.
            Argument::Read(..) => unsafe { shown(passed, i, log) },
        };
        (name.trim_start_matches('_').to_owned(), value)
    };
    passed.iter().enumerate().map(value).collect()
}

/// What a call that succeeded has written.
///
/// # Safety
/// As [`arguments`]; the function has written every result.
pub(super) unsafe fn results(passed: &[Passed], log: &mut CallLog) -> Vec<NamedValue> {
    let mut found = Vec::new();
    for (i, (name, argument)) in passed.iter().enumerate() {
        let Argument::Write(pointer, element) = *argument else { continue };
        if element == Element::State || pointer.is_null() {
            continue;
        }
        if element == Element::EventInfo {
            // SAFETY: the importer's struct, as the gate has checked.
            found.extend(unsafe { event_info(pointer.cast()) });
            continue;
        }
        // SAFETY: the importer's array or variable, which the function has written.
        found.push((name.trim_start_matches('_').to_owned(), unsafe { shown(passed, i, log) }));
    }
    found
}

/// Whether the function reads the variable for a state before it writes it.
fn is_state_kept(function: &str, argument: &Argument) -> bool {
    matches!(argument, Argument::Write(_, Element::StatePlace)) && !function.contains("erialize")
}

/// The number of elements of an array, `None` for a variable. It is the next count, or the last one before; results of FMI 2.0
/// and orders have that of the references.
fn count(passed: &[Passed], at: usize) -> Option<usize> {
    if let Argument::Write(_, Element::StatePlace | Element::EventInfo) = passed[at].1 {
        return None;
    }
    let counts = |range: &[Passed]| -> Vec<usize> {
        range
            .iter()
            .filter_map(|(_, argument)| if let Argument::Count(n) = *argument { Some(n) } else { None })
            .collect()
    };
    let (before, after) = (counts(&passed[..at]), counts(&passed[at..]));
    match passed[at].0 {
        "orders" => before.first().copied(),
        "sensitivity" => after.first().or(before.first()).copied(),
        _ => after.first().or(before.last()).copied(),
    }
}

/// # Safety
/// As [`shown`].
unsafe fn all<T: Debug>(pointer: *const c_void, n: usize) -> Option<Vec<LogValue>> {
    // SAFETY: the caller's promise.
    unsafe { array(pointer.cast::<T>(), n, "") }.ok().map(|values| values.iter().map(number).collect())
}

/// The elements behind an argument.
///
/// # Safety
/// They are initialized, as many as the counts say.
unsafe fn shown(passed: &[Passed], at: usize, log: &mut CallLog) -> LogValue {
    let (name, Argument::Read(pointer, element) | Argument::Write(pointer, element)) = &passed[at] else {
        return LogValue::Unreadable;
    };
    let (pointer, counted) = (*pointer, count(passed, at));
    let n = counted.unwrap_or(1);
    // SAFETY: the caller's promise, for the type of the argument.
    let values = unsafe {
        match element {
            Element::U8 if *name == "bytes" => {
                return array(pointer.cast::<u8>(), n, "")
                    .map_or(LogValue::Unreadable, |x| LogValue::Bytes(x.to_vec()));
            }
            Element::F32 => all::<f32>(pointer, n),
            Element::F64 => all::<f64>(pointer, n),
            Element::I8 => all::<i8>(pointer, n),
            Element::I16 => all::<i16>(pointer, n),
            Element::I32 => all::<i32>(pointer, n),
            Element::I64 => all::<i64>(pointer, n),
            Element::U8 => all::<u8>(pointer, n),
            Element::U16 => all::<u16>(pointer, n),
            Element::U32 => all::<u32>(pointer, n),
            Element::U64 => all::<u64>(pointer, n),
            Element::Size => all::<usize>(pointer, n),
            Element::Pointer => pointers(passed, pointer, n),
            Element::StatePlace => {
                array(pointer.cast::<*mut c_void>(), 1, "").ok().map(|states| vec![log.state(states[0].addr())])
            }
            Element::State | Element::EventInfo => None,
        }
    };
    match (values, counted) {
        (None, _) => LogValue::Unreadable,
        (Some(mut values), None) => values.pop().unwrap_or(LogValue::Unreadable),
        (Some(values), Some(_)) => LogValue::List(values),
    }
}

/// Texts, or, if the call has sizes, bytes.
///
/// # Safety
/// As [`shown`].
unsafe fn pointers(passed: &[Passed], pointer: *const c_void, n: usize) -> Option<Vec<LogValue>> {
    // SAFETY: the caller's promise.
    let places = unsafe { array(pointer.cast::<*const u8>(), n, "") }.ok()?;
    let sizes = passed.iter().find(|(name, _)| *name == "sizes");
    let Some((_, Argument::Read(sizes, _) | Argument::Write(sizes, _))) = sizes else {
        // SAFETY: NULL or C strings by the caller's promise.
        return Some(places.iter().map(|place| unsafe { shown_text(place.cast()) }).collect());
    };
    // SAFETY: the caller's promise.
    let sizes = unsafe { array(sizes.cast::<usize>(), n, "") }.ok()?;
    let bytes = |(place, size): (&*const u8, &usize)| {
        if place.is_null() {
            return LogValue::Null;
        }
        // SAFETY: as many bytes as the size says, by the caller's promise.
        unsafe { array(*place, *size, "") }.map_or(LogValue::Unreadable, |bytes| LogValue::Bytes(bytes.to_vec()))
    };
    Some(places.iter().zip(sizes).map(bytes).collect())
}

/// # Safety
/// The struct is initialized.
unsafe fn event_info(pointer: *const Fmi2EventInfo) -> Vec<NamedValue> {
    // SAFETY: the caller's promise.
    let info = unsafe { *pointer };
    let flags = [
        ("again", info.new_discrete_states_needed),
        ("terminate", info.terminate_simulation),
        ("nominals", info.nominals_of_continuous_states_changed),
        ("values", info.values_of_continuous_states_changed),
        ("next_defined", info.next_event_time_defined),
    ];
    let mut found: Vec<NamedValue> = flags.map(|(name, flag)| (name.to_owned(), number(&flag.0))).to_vec();
    found.push(("next".into(), number(&info.next_event_time)));
    found
}
