//! The arguments of a call in memory, made from the values of a log.

use fmu_core::call_log::{LogValue, LoggedCall};
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fmt::Debug;
use std::ptr;
use std::str::FromStr;

/// Maximum number of elements of an array.
const MOST: usize = 1 << 24;

/// The memory of a call.
pub(super) struct Memory<'a> {
    call: &'a LoggedCall,
    /// Elements of each array: the largest count of the call.
    room: usize,
    /// Saved states by their numbers, from 1.
    states: &'a RefCell<Vec<usize>>,
    /// Arrays; their addresses do not change when the list grows.
    arrays: Vec<Box<[u64]>>,
    texts: Vec<CString>,
    bytes: Vec<Vec<u8>>,
    written: Vec<Written>,
}

/// An array or a variable that the function writes.
struct Written {
    name: &'static str,
    place: *const c_void,
    /// Elements to show.
    n: usize,
    kind: Kind,
    show: unsafe fn(*const c_void, usize) -> Vec<LogValue>,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Numbers,
    Texts,
    Bytes,
    Sizes,
    /// One array of bytes.
    Blob,
    State,
    Event,
}

impl<'a> Memory<'a> {
    pub(super) fn new(call: &'a LoggedCall, states: &'a RefCell<Vec<usize>>) -> Result<Self, String> {
        let (mut room, mut has_arrays) = (1, false);
        for (_, value) in &call.arguments {
            let (n, is_array) = match value {
                LogValue::Room(n) => (*n, true),
                LogValue::List(values) => (values.len(), true),
                LogValue::Bytes(bytes) => (bytes.len(), true),
                // Counts and all other integers.
                LogValue::Number(text) => (text.parse().unwrap_or(0), false),
                _ => (0, false),
            };
            room = room.max(n);
            has_arrays |= is_array;
        }
        if has_arrays && room > MOST {
            return Err(format!("an array of {room} elements; at most {MOST} are repeated"));
        }
        let (arrays, texts, bytes, written) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Ok(Self { call, room, states, arrays, texts, bytes, written })
    }

    /// An argument of the call.
    pub(super) fn pass<T: Pass>(&mut self, name: &'static str) -> Result<T, String> {
        let value = self.call.arguments.iter().find(|(of, _)| of == name).map(|(_, value)| value);
        let value = value.ok_or_else(|| format!("the argument {name} is missing"))?;
        if *value == LogValue::Unreadable {
            return Err(format!("{name} could not be read when it was logged, so the call cannot be repeated"));
        }
        if let LogValue::State(number) = value
            && self.state(*number).is_none()
        {
            return Err(format!("{name}={value} is a saved state of another instance, so the call cannot be repeated"));
        }
        T::pass(self, name, value).ok_or_else(|| format!("{name}={value} is not what this function takes"))
    }

    fn array<T>(&mut self) -> *mut T {
        let words = (self.room * size_of::<T>()).div_ceil(8) + 1;
        self.arrays.push(vec![0; words].into());
        self.arrays.last_mut().map_or(ptr::null_mut(), |array| array.as_mut_ptr().cast())
    }

    fn state(&self, number: usize) -> Option<*mut c_void> {
        if number == 0 {
            return Some(ptr::null_mut());
        }
        self.states.borrow().get(number - 1).map(|address| ptr::with_exposed_provenance_mut(*address))
    }

    fn number_of(&self, state: *mut c_void) -> usize {
        if state.is_null() {
            return 0;
        }
        let (address, mut states) = (state.expose_provenance(), self.states.borrow_mut());
        1 + states.iter().position(|known| *known == address).unwrap_or_else(|| {
            states.push(address);
            states.len() - 1
        })
    }

    /// What the function has written, in the form of the log: `logged` decides between a value and a list of one.
    ///
    /// # Safety
    /// The call has returned with success.
    pub(super) unsafe fn results(&self, logged: &[(String, LogValue)]) -> Vec<(String, LogValue)> {
        let mut found = Vec::new();
        let sizes = self.written.iter().find(|written| written.kind == Kind::Sizes);
        for written in &self.written {
            let Written { name, place, n, kind, show } = *written;
            // SAFETY: our array with at least these elements, of this type; texts and bytes are the FMU's, valid until its
            // next call.
            let mut values = unsafe {
                match (kind, sizes) {
                    (Kind::Bytes, Some(sizes)) => shown_bytes(place.cast(), sizes.place.cast(), n),
                    (Kind::State, _) => vec![LogValue::State(self.number_of(place.cast::<*mut c_void>().read()))],
                    (Kind::Event, _) => {
                        found.extend(shown_event(place.cast()));
                        continue;
                    }
                    (Kind::Blob, _) => vec![LogValue::Bytes(std::slice::from_raw_parts(place.cast(), n).to_vec())],
                    _ => show(place, n),
                }
            };
            let before = logged.iter().find(|(of, _)| of == name).map(|(_, value)| value);
            let single = values.len() == 1 && before.is_some_and(|value| !matches!(value, LogValue::List(_)));
            let value = if single { values.pop().unwrap_or(LogValue::Null) } else { LogValue::List(values) };
            found.push((name.to_owned(), value));
        }
        found
    }
}

/// A C type of an argument.
pub(super) trait Pass: Sized {
    /// Makes it from a value of the log; `None` for a value of another kind.
    fn pass(memory: &mut Memory<'_>, name: &'static str, value: &LogValue) -> Option<Self>;
}

/// A number of C.
pub(super) trait Number: Copy + FromStr + Debug {}

macro_rules! numbers {
    ($($type:ty)*) => { $(
        impl Number for $type {}

        impl Pass for $type {
            fn pass(_: &mut Memory<'_>, _: &'static str, value: &LogValue) -> Option<Self> {
                parsed(value)
            }
        }
    )* };
}

numbers! { f64 f32 i8 u8 i16 u16 i32 u32 i64 u64 usize }

fn parsed<T: Number>(value: &LogValue) -> Option<T> {
    if let LogValue::Number(text) = value { text.parse().ok() } else { None }
}

/// Numbers that the function reads.
#[repr(transparent)]
pub(super) struct In<T>(*const T);

/// Numbers that the function writes.
#[repr(transparent)]
pub(super) struct Out<T>(*mut T);

/// A text.
#[repr(transparent)]
pub(super) struct Text(*const c_char);

/// Texts, or bytes, that the function reads.
#[repr(transparent)]
pub(super) struct Texts(*const *const c_char);

/// Texts that the function writes.
#[repr(transparent)]
pub(super) struct TextsOut(*mut *const c_char);

/// Bytes of several variables that the function writes; their sizes are `sizes`.
#[repr(transparent)]
pub(super) struct BytesOut(*mut *const u8);

/// An array of bytes that the function reads.
#[repr(transparent)]
pub(super) struct Blob(*const u8);

/// An array of bytes that the function writes.
#[repr(transparent)]
pub(super) struct BlobOut(*mut u8);

/// A saved state.
#[repr(transparent)]
pub(super) struct Saved(*mut c_void);

/// A variable for a saved state.
#[repr(transparent)]
pub(super) struct Place(*mut *mut c_void);

/// `fmi2EventInfo`.
#[repr(transparent)]
pub(super) struct EventInfo(*mut Event);

#[repr(C)]
struct Event {
    flags: [c_int; 5],
    next: f64,
}

impl<T> In<T> {
    pub(super) fn pointer(&self) -> *const T {
        self.0
    }
}

impl Text {
    pub(super) fn pointer(&self) -> *const c_char {
        self.0
    }
}

impl<T: Number> Pass for In<T> {
    fn pass(memory: &mut Memory<'_>, _: &'static str, value: &LogValue) -> Option<Self> {
        let values: Vec<T> = match value {
            LogValue::Null => return Some(Self(ptr::null())),
            LogValue::List(values) => values.iter().map(parsed).collect::<Option<_>>()?,
            _ => return None,
        };
        let array = memory.array::<T>();
        // SAFETY: the array has room for the longest list of the call.
        unsafe { ptr::copy_nonoverlapping(values.as_ptr(), array, values.len()) };
        Some(Self(array))
    }
}

/// Room for values that a function writes: how many are shown.
fn room(value: &LogValue) -> Option<usize> {
    if let LogValue::Room(n) = value { Some(*n) } else { None }
}

impl<T: Number> Pass for Out<T> {
    fn pass(memory: &mut Memory<'_>, name: &'static str, value: &LogValue) -> Option<Self> {
        /// # Safety
        /// `n` elements at `place` are initialized.
        unsafe fn show<T: Number>(place: *const c_void, n: usize) -> Vec<LogValue> {
            // SAFETY: the caller's promise.
            let values = unsafe { std::slice::from_raw_parts(place.cast::<T>(), n) };
            values.iter().map(|value| LogValue::Number(format!("{value:?}"))).collect()
        }
        if *value == LogValue::Null {
            return Some(Self(ptr::null_mut()));
        }
        let (n, place) = (room(value)?, memory.array::<T>());
        let kind = if name == "sizes" { Kind::Sizes } else { Kind::Numbers };
        memory.written.push(Written { name, place: place.cast_const().cast(), n, kind, show: show::<T> });
        Some(Self(place))
    }
}

impl Pass for Text {
    fn pass(memory: &mut Memory<'_>, _: &'static str, value: &LogValue) -> Option<Self> {
        match value {
            LogValue::Null => Some(Self(ptr::null())),
            LogValue::Text(text) => {
                memory.texts.push(CString::new(text.clone()).ok()?);
                memory.texts.last().map(|text| Self(text.as_ptr()))
            }
            _ => None,
        }
    }
}

impl Pass for Texts {
    fn pass(memory: &mut Memory<'_>, name: &'static str, value: &LogValue) -> Option<Self> {
        let values = match value {
            LogValue::Null => return Some(Self(ptr::null())),
            LogValue::List(values) => values,
            _ => return None,
        };
        let array = memory.array::<*const c_char>();
        for i in 0..memory.room {
            let place = match values.get(i) {
                Some(LogValue::Bytes(bytes)) => {
                    memory.bytes.push(bytes.clone());
                    memory.bytes.last()?.as_ptr().cast()
                }
                Some(value) => Text::pass(memory, name, value)?.0,
                None => c"".as_ptr(),
            };
            // SAFETY: the array has this room.
            unsafe { array.add(i).write(place) };
        }
        Some(Self(array))
    }
}

impl Pass for TextsOut {
    fn pass(memory: &mut Memory<'_>, name: &'static str, value: &LogValue) -> Option<Self> {
        /// # Safety
        /// `n` texts of C at `place`, or NULL.
        unsafe fn show(place: *const c_void, n: usize) -> Vec<LogValue> {
            // SAFETY: the caller's promise.
            let texts = unsafe { std::slice::from_raw_parts(place.cast::<*const c_char>(), n) };
            let text = |text: &*const c_char| {
                // SAFETY: the caller's promise.
                (!text.is_null()).then(|| LogValue::Text(unsafe { CStr::from_ptr(*text) }.to_bytes().to_vec()))
            };
            texts.iter().map(|it| text(it).unwrap_or(LogValue::Null)).collect()
        }
        if *value == LogValue::Null {
            return Some(Self(ptr::null_mut()));
        }
        let (n, place) = (room(value)?, memory.array::<*const c_char>());
        memory.written.push(Written { name, place: place.cast_const().cast(), n, kind: Kind::Texts, show });
        Some(Self(place))
    }
}

/// # Safety
/// `n` arrays of bytes of these sizes, or NULL.
unsafe fn shown_bytes(places: *const *const u8, sizes: *const usize, n: usize) -> Vec<LogValue> {
    // SAFETY: the caller's promise.
    let (places, sizes) = unsafe { (std::slice::from_raw_parts(places, n), std::slice::from_raw_parts(sizes, n)) };
    let bytes = |(place, size): (&*const u8, &usize)| {
        if place.is_null() || *size > MOST {
            return LogValue::Null;
        }
        // SAFETY: the caller's promise.
        LogValue::Bytes(unsafe { std::slice::from_raw_parts(*place, *size) }.to_vec())
    };
    places.iter().zip(sizes).map(bytes).collect()
}

/// A value without a way to show it on its own.
///
/// # Safety
/// None is needed.
unsafe fn nothing(_: *const c_void, _: usize) -> Vec<LogValue> {
    Vec::new()
}

/// Room for one kind of result.
macro_rules! outputs {
    ($($type:ident($element:ty) = $kind:ident;)*) => { $(impl Pass for $type {
        fn pass(memory: &mut Memory<'_>, name: &'static str, value: &LogValue) -> Option<Self> {
            if *value == LogValue::Null {
                return Some(Self(ptr::null_mut()));
            }
            let (n, place) = (room(value)?, memory.array::<$element>());
            let (place_of, kind) = (place.cast_const().cast(), Kind::$kind);
            memory.written.push(Written { name, place: place_of, n, kind, show: nothing });
            Some(Self(place))
        }
    })* };
}

outputs! {
    BytesOut(*const u8) = Bytes;
    BlobOut(u8) = Blob;
    EventInfo(Event) = Event;
}

impl Pass for Blob {
    fn pass(memory: &mut Memory<'_>, _: &'static str, value: &LogValue) -> Option<Self> {
        let bytes = match value {
            LogValue::Null => return Some(Self(ptr::null())),
            LogValue::Bytes(bytes) => bytes,
            _ => return None,
        };
        let array = memory.array::<u8>();
        // SAFETY: the array has room for the longest value of the call.
        unsafe { ptr::copy_nonoverlapping(bytes.as_ptr(), array, bytes.len()) };
        Some(Self(array))
    }
}

impl Pass for Saved {
    fn pass(memory: &mut Memory<'_>, _: &'static str, value: &LogValue) -> Option<Self> {
        match value {
            LogValue::Null => Some(Self(ptr::null_mut())),
            LogValue::State(number) => memory.state(*number).map(Self),
            _ => None,
        }
    }
}

impl Pass for Place {
    fn pass(memory: &mut Memory<'_>, name: &'static str, value: &LogValue) -> Option<Self> {
        let state = match value {
            LogValue::Null => return Some(Self(ptr::null_mut())),
            LogValue::Room(_) => ptr::null_mut(),
            LogValue::State(number) => memory.state(*number)?,
            _ => return None,
        };
        let place = memory.array::<*mut c_void>();
        // SAFETY: our array of at least one element.
        unsafe { place.write(state) };
        memory.written.push(Written { name, place: place.cast_const().cast(), n: 1, kind: Kind::State, show: nothing });
        Some(Self(place))
    }
}

/// # Safety
/// The struct is ours.
unsafe fn shown_event(place: *const Event) -> Vec<(String, LogValue)> {
    // SAFETY: the caller's promise.
    let Event { flags, next } = unsafe { place.read() };
    let names = ["again", "terminate", "nominals", "values", "next_defined"];
    let flags = names.into_iter().zip(flags);
    let mut found: Vec<_> = flags.map(|(name, x)| (name.to_owned(), LogValue::Number(x.to_string()))).collect();
    found.push(("next".into(), LogValue::Number(format!("{next:?}"))));
    found
}
