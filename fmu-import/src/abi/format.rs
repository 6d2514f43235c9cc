//! Texts with the values of a C format (`printf`), for the log messages of FMI 2.0.
//!
//! The format is divided into conversions, and the C library formats each with its value, so the text is the same as in C.
//! `%n`, which writes, and `%L...`, whose values have no common size, are not supported; from there on the format is copied
//! unchanged, with a note in the text.
//!
//! A variadic function cannot see how many arguments it was given. One case of a missing argument is certain: compilers often call
//! the callback through the next free register, which is where the first argument would be, so its value is the callback's address.

use std::ffi::{CStr, CString, c_char, c_int};

unsafe extern "C" {
    /// The C library's.
    fn snprintf(text: *mut c_char, size: usize, format: *const c_char, ...) -> c_int;
}

/// Maximum width, and maximum precision.
const WIDEST: i32 = 4096;

/// The arguments of a variadic call, where its caller has placed them.
pub(super) struct Arguments<'a> {
    integers: std::slice::Iter<'a, u64>,
    floats: std::slice::Iter<'a, f64>,
    words: std::slice::Iter<'a, u64>,
    callback: u64,
}

impl<'a> Arguments<'a> {
    /// Registers for integers and for floating-point numbers, words of the stack, which follow for both, and the address of the
    /// function that was called.
    pub(super) fn new(integers: &'a [u64], floats: &'a [f64], words: &'a [u64], callback: u64) -> Self {
        Self { integers: integers.iter(), floats: floats.iter(), words: words.iter(), callback }
    }

    /// Whether the next integer or pointer is one that no caller passes.
    fn is_missing(&self) -> bool {
        self.integers.clone().next().or_else(|| self.words.clone().next()) == Some(&self.callback)
    }

    fn integer(&mut self) -> Option<u64> {
        self.integers.next().or_else(|| self.words.next()).copied()
    }

    fn int(&mut self) -> Option<c_int> {
        self.integer().map(low)
    }

    fn float(&mut self) -> Option<f64> {
        self.floats.next().copied().or_else(|| self.words.next().map(|&bits| f64::from_bits(bits)))
    }
}

/// An `int`, which is the low half of its word.
#[expect(clippy::cast_possible_truncation, reason = "the high half of the word is ignored")]
fn low(word: u64) -> c_int {
    word as c_int
}

/// What `%` introduces.
struct Conversion<'a> {
    /// The whole conversion, including the `%`.
    text: &'a [u8],
    flags: &'a [u8],
    width: Number,
    precision: Number,
    /// `hh`, `h`, `l`, `ll`, `j`, `z`, `t` or nothing.
    length: &'a [u8],
    /// The letter.
    letter: u8,
}

#[derive(Clone, Copy, PartialEq)]
enum Number {
    None,
    Is(i32),
    /// `*`: an argument.
    Argument,
}

/// Splits off the leading bytes that satisfy `is`.
fn run<'a>(rest: &mut &'a [u8], is: impl Fn(u8) -> bool) -> &'a [u8] {
    let n = rest.iter().position(|&c| !is(c)).unwrap_or(rest.len());
    let (front, back) = rest.split_at(n);
    *rest = back;
    front
}

fn number(rest: &mut &[u8]) -> Number {
    if let [b'*', back @ ..] = *rest {
        *rest = back;
        return Number::Argument;
    }
    let digits = run(rest, |c| c.is_ascii_digit());
    if digits.is_empty() {
        return Number::None;
    }
    Number::Is(std::str::from_utf8(digits).ok().and_then(|d| d.parse().ok()).unwrap_or(i32::MAX))
}

/// The conversion at the start of `format`, which begins with `%`, and the remainder.
fn conversion(format: &[u8]) -> (Conversion<'_>, &[u8]) {
    let mut rest = &format[1..];
    let flags = run(&mut rest, |c| b"-+ #0".contains(&c));
    let width = number(&mut rest);
    let precision = match rest {
        [b'.', back @ ..] => {
            rest = back;
            match number(&mut rest) {
                Number::None => Number::Is(0),
                given => given,
            }
        }
        _ => Number::None,
    };
    let length = run(&mut rest, |c| b"hljztL".contains(&c));
    let (letter, rest) = rest.split_first().map_or((0, rest), |(&letter, rest)| (letter, rest));
    (Conversion { text: &format[..format.len() - rest.len()], flags, width, precision, length, letter }, rest)
}

impl Conversion<'_> {
    /// Whether C or POSIX defines it.
    fn exists(&self) -> bool {
        b"diouxXfFeEgGaAcspnCSm".contains(&self.letter)
    }

    /// Whether its value is in the registers for integers.
    fn takes_integer(&self) -> bool {
        b"diouxXcs".contains(&self.letter) || self.width == Number::Argument || self.precision == Number::Argument
    }

    /// The text of the next argument; `None` if this conversion is not supported or no argument is left.
    ///
    /// # Safety
    /// The arguments match the format; an argument of `%s` is NULL, a C string, or at least as long as the precision.
    unsafe fn write(&self, arguments: &mut Arguments<'_>) -> Option<Vec<u8>> {
        let mut size = |number| match number {
            Number::None => Some(None),
            Number::Is(n) => Some(Some(n)),
            Number::Argument => arguments.int().map(Some),
        };
        let (width, precision) = (size(self.width)?, size(self.precision)?);
        if [width, precision].into_iter().flatten().any(|n| n.unsigned_abs() > WIDEST.unsigned_abs()) {
            return None;
        }
        // The same conversion with the sizes as numbers, and integers as `long long`.
        let mut format = [b"%", self.flags].concat();
        format.extend(width.map(|n| n.to_string()).unwrap_or_default().bytes());
        // A negative precision counts as none.
        format.extend(precision.filter(|&n| n >= 0).map(|n| format!(".{n}")).unwrap_or_default().bytes());
        match (self.letter, self.length) {
            (b'd' | b'i' | b'u' | b'x' | b'X' | b'o', _) => {
                let value = self.integer(arguments.integer()?)?;
                format.extend([b'l', b'l', self.letter]);
                // SAFETY: the format has one conversion, of this type.
                unsafe { print(format, value) }
            }
            (b'c', b"") => {
                format.push(b'c');
                // SAFETY: the format has one conversion, of this type.
                unsafe { print(format, arguments.int()?) }
            }
            (b'f' | b'F' | b'e' | b'E' | b'g' | b'G' | b'a' | b'A', b"" | b"l") => {
                format.push(self.letter);
                // SAFETY: the format has one conversion, of this type.
                unsafe { print(format, arguments.float()?) }
            }
            (b's', b"") => {
                let text = pointer(arguments.integer()?).cast::<c_char>();
                if text.is_null() {
                    return Some(b"(null)".to_vec());
                }
                if precision.is_none() && width.is_none() {
                    // SAFETY: the caller's promise.
                    return Some(unsafe { CStr::from_ptr(text) }.to_bytes().to_vec());
                }
                format.push(b's');
                // SAFETY: the format has one conversion, of this type.
                unsafe { print(format, text) }
            }
            (b'p', b"") => {
                format.push(b'p');
                // SAFETY: the format has one conversion, of this type.
                unsafe { print(format, pointer(arguments.integer()?)) }
            }
            _ => None,
        }
    }

    /// An integer of this length as a `long long`; `None` for a length that does not exist in C.
    #[expect(clippy::cast_possible_truncation, reason = "the low bits are the value")]
    fn integer(&self, word: u64) -> Option<i64> {
        let signed = matches!(self.letter, b'd' | b'i');
        let bytes = match self.length {
            b"hh" => 1,
            b"h" => 2,
            b"" => 4,
            b"l" => size_of::<std::ffi::c_long>(),
            b"ll" | b"j" | b"z" | b"t" => 8,
            _ => return None,
        };
        let shift = 64 - 8 * bytes as u32;
        let cut = word << shift;
        Some(if signed { cut.cast_signed() >> shift } else { (cut >> shift).cast_signed() })
    }
}

fn pointer(word: u64) -> *const std::ffi::c_void {
    std::ptr::with_exposed_provenance(usize::try_from(word).unwrap_or(0))
}

/// One conversion as formatted by the C library.
///
/// # Safety
/// The format has one conversion, of the value's type.
unsafe fn print<T: Copy>(format: Vec<u8>, value: T) -> Option<Vec<u8>> {
    let format = CString::new(format).ok()?;
    // SAFETY: no more than 0 bytes are written.
    let length = unsafe { snprintf(std::ptr::null_mut(), 0, format.as_ptr(), value) };
    let length = usize::try_from(length).ok()?;
    let mut text = vec![0; length + 1];
    // SAFETY: there are `length + 1` bytes.
    unsafe { snprintf(text.as_mut_ptr().cast(), text.len(), format.as_ptr(), value) };
    text.pop();
    Some(text)
}

/// A text with its values.
pub(super) struct Formatted {
    /// In the encoding of the format and of its arguments.
    pub(super) text: Vec<u8>,
    /// Certain defects of the format or its arguments.
    pub(super) fault: Option<String>,
}

/// The text of a format and its arguments.
///
/// # Safety
/// The arguments match the format; an argument of `%s` is NULL, a C string, or at least as long as the precision.
pub(super) unsafe fn formatted(format: &[u8], mut arguments: Arguments<'_>) -> Formatted {
    let (mut text, mut rest, mut fault) = (Vec::new(), format, None);
    loop {
        text.extend(run(&mut rest, |c| c != b'%'));
        if rest.len() < 2 {
            if !rest.is_empty() {
                fault = fault.or_else(|| Some("it ends with a single \"%\"".into()));
            }
            text.extend(rest);
            return Formatted { text, fault };
        }
        if let [b'%', b'%', back @ ..] = rest {
            text.push(b'%');
            rest = back;
            continue;
        }
        let (conversion, back) = conversion(rest);
        let shown = String::from_utf8_lossy(conversion.text);
        if !conversion.exists() {
            fault = fault.or_else(|| Some(format!("\"{shown}\" is not a conversion of printf")));
        }
        if conversion.takes_integer() && arguments.is_missing() {
            fault = fault.or_else(|| Some(format!("there is no argument for \"{shown}\"")));
            text.extend(b"(no argument)");
            let _ = arguments.integer();
            rest = back;
            continue;
        }
        // SAFETY: the caller's promise.
        let Some(value) = (unsafe { conversion.write(&mut arguments) }) else {
            text.extend(rest);
            text.extend(b" (the values of this message from \"");
            text.extend(conversion.text);
            text.extend(b"\" on are not shown)");
            return Formatted { text, fault };
        };
        text.extend(value);
        rest = back;
    }
}
