//! The log callback of FMI 2.0, which is variadic in C.
//!
//! A Rust function cannot be variadic. On the 64-bit platforms of FMUs, the caller of a variadic function passes arguments as
//! for any function, and cleans up. So the callback declares as parameters the registers and the stack words in which they
//! arrive; those beyond the arguments of the FMU are undefined, and only those that the format names are read
//! ([`format`](super::format)).

use super::format::{Arguments, Formatted, formatted};
use super::log::Status;
use std::ffi::{CStr, c_char, c_void};

/// A message as passed by the FMU. Only the pointer to the text has been dereferenced.
pub(super) struct Called {
    /// `componentEnvironment`: any pointer that the FMU passed.
    pub(super) environment: *mut c_void,
    /// `instanceName`.
    pub(super) instance: *const c_char,
    /// `status`.
    pub(super) status: Status,
    /// `category`.
    pub(super) category: *const c_char,
    /// The format: NULL or a C string.
    pub(super) format: *const c_char,
    /// The text with its values; `None` for NULL.
    pub(super) text: Option<Formatted>,
}

/// Receives messages.
pub(super) trait Listener {
    /// A message.
    ///
    /// # Safety
    /// The texts in `called` are NULL or C strings.
    unsafe fn hear(called: Called);
}

/// Defines the callback with the parameters that follow the format on this platform: registers for integers, registers for
/// floating-point numbers, words of the stack; before them, unused registers.
macro_rules! logger {
    ([$($unused:ident)*], [$($integer:ident)*], [$($float:ident)*], [$($word:ident)*]) => {
        /// `fmi2CallbackLogger` of a listener.
        #[allow(clippy::too_many_arguments, reason = "the registers and words of a variadic call")]
        pub(super) unsafe extern "C" fn logger<L: Listener>(
            environment: *mut c_void,
            instance: *const c_char,
            status: Status,
            category: *const c_char,
            format: *const c_char,
            $($unused: u64,)* $($integer: u64,)* $($float: f64,)* $($word: u64,)*
        ) {
            $(let _ = $unused;)*
            let (integers, floats, words): ([u64; _], [f64; _], [u64; _]) = ([$($integer),*], [$($float),*], [$($word),*]);
            let callback = (logger::<L> as Logger as *const ()).addr() as u64;
            let arguments = Arguments::new(&integers, &floats, &words, callback);
            // SAFETY: the FMU passes C strings, and the arguments that its format names.
            unsafe {
                let text = (!format.is_null()).then(|| formatted(CStr::from_ptr(format).to_bytes(), arguments));
                L::hear(Called { environment, instance, status, category, format, text });
            }
        }

        /// `fmi2CallbackLogger`, with the parameters of [`logger`].
        pub(super) type Logger = unsafe extern "C" fn(
            *mut c_void,
            *const c_char,
            Status,
            *const c_char,
            *const c_char,
            $(logger!(@ u64 $unused),)* $(logger!(@ u64 $integer),)* $(logger!(@ f64 $float),)* $(logger!(@ u64 $word),)*
        );
    };
    (@ $type:ident $name:ident) => { $type };
}

// System V: six registers for integers, five of them taken, and eight for floating-point numbers, then the stack.
#[cfg(all(target_arch = "x86_64", not(windows)))]
logger!([], [i0], [f0 f1 f2 f3 f4 f5 f6 f7], [w0 w1 w2 w3 w4 w5 w6 w7 w8 w9 w10 w11]);

// Windows: four registers, all taken; every further argument is a word of the stack, a number with its bits.
#[cfg(all(target_arch = "x86_64", windows))]
logger!([], [], [], [w0 w1 w2 w3 w4 w5 w6 w7 w8 w9 w10 w11]);

// AAPCS64: eight registers of each kind, then the stack.
#[cfg(all(not(target_arch = "x86_64"), not(target_vendor = "apple")))]
logger!([], [i0 i1 i2], [f0 f1 f2 f3 f4 f5 f6 f7], [w0 w1 w2 w3 w4 w5 w6 w7 w8 w9 w10 w11]);

// Apple's ARM: variadic arguments are on the stack only, so three registers are unused.
#[cfg(all(not(target_arch = "x86_64"), target_vendor = "apple"))]
logger!([u0 u1 u2], [], [], [w0 w1 w2 w3 w4 w5 w6 w7 w8 w9 w10 w11]);

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::ffi::CString;
    use std::hint::black_box;
    use std::mem::transmute;
    use std::ptr;

    thread_local! {
        static HEARD: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
    }

    struct Ear;

    impl Listener for Ear {
        unsafe fn hear(called: Called) {
            let text = called.text.map_or_else(
                || "NULL".into(),
                |Formatted { text, fault }| {
                    let fault = fault.map(|fault| format!(" ({fault})")).unwrap_or_default();
                    String::from_utf8_lossy(&text).into_owned() + &fault
                },
            );
            HEARD.with_borrow_mut(|all| all.push(text));
        }
    }

    /// The callback as seen from a C program.
    type Variadic = unsafe extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char, ...);

    macro_rules! heard {
        ($format:expr $(, $argument:expr)*) => {{
            let format = CString::new($format).unwrap();
            // SAFETY: a caller of a variadic function passes its arguments where the callback reads them. As in an FMU, the
            // compiler must not see which function the pointer refers to.
            unsafe {
                let logger = transmute::<Logger, Variadic>(black_box(logger::<Ear> as Logger));
                logger(ptr::null_mut(), c"x".as_ptr(), Status::OK, c"".as_ptr(), format.as_ptr() $(, $argument)*);
            }
            HEARD.with_borrow_mut(|all| all.pop()).unwrap()
        }};
    }

    #[test]
    fn values_appear_in_the_text() {
        assert_eq!(heard!("%s", c"hello".as_ptr()), "hello");
        assert_eq!(heard!("100 %% of %d, %u, %i", -3_i32, 7_u32, -1_i32), "100 % of -3, 7, -1");
        assert_eq!(heard!("t=%g h=%.17g", 0.5_f64, 0.1_f64), "t=0.5 h=0.10000000000000001");
        assert_eq!(heard!("%5.1f|%-6s|%+d|%#x", 2.25_f64, c"ab".as_ptr(), 5_i32, 255_i32), "  2.2|ab    |+5|0xff");
        assert_eq!(heard!("%ld %llu %zu %hd", -5_i64, u64::MAX, 3_usize, 70000_i32), format!("-5 {} 3 4464", u64::MAX));
        assert_eq!(heard!("%c%c %*d %.*f", 79_i32, 75_i32, 4_i32, 42_i32, 2_i32, 1.0_f64), "OK   42 1.00");
        assert_eq!(heard!("%.3s", c"abcdef".as_ptr()), "abc");
        assert_eq!(heard!("%s", ptr::null::<c_char>()), "(null)");
    }

    /// Beyond the registers, integers and numbers of both kinds come from the stack in their order.
    #[test]
    fn arguments_of_both_kinds_keep_their_order() {
        let text = heard!(
            "%d %g %d %g %d %g %d %g %g %g %g %g %g %d %g",
            1_i32,
            0.5_f64,
            2_i32,
            1.5_f64,
            3_i32,
            2.5_f64,
            4_i32,
            3.5_f64,
            4.5_f64,
            5.5_f64,
            6.5_f64,
            7.5_f64,
            8.5_f64,
            5_i32,
            9.5_f64
        );
        assert_eq!(text, "1 0.5 2 1.5 3 2.5 4 3.5 4.5 5.5 6.5 7.5 8.5 5 9.5");
    }

    #[test]
    fn what_cannot_be_shown_is_named() {
        let note = " (the values of this message from \"%";
        assert!(heard!("a %Lf b", 1.0_f64).starts_with(&format!("a %Lf b{note}Lf\" on")));
        assert!(heard!("a %n b", ptr::null_mut::<i32>()).contains("%n"), "no value is written through a pointer");
        let unknown = heard!("%d%%%y%d", 1_i32, 2_i32);
        assert!(unknown.starts_with("1%%y%d (the values"), "{unknown}");
        assert!(unknown.ends_with("(\"%y\" is not a conversion of printf)"), "{unknown}");
        assert!(heard!("%99999d", 1_i32).contains("%99999d"));
        let many = "%d ".repeat(40);
        let first = heard!(many, 1_i32, 2_i32, 3_i32);
        assert!(first.starts_with("1 2 3 ") && first.contains("are not shown)"), "{first}");
        assert_eq!(heard!("50 %"), "50 % (it ends with a single \"%\")");
    }

    /// A call through the register of the first argument, as compilers make it, passes the callback's address there.
    #[test]
    fn an_argument_that_is_missing_is_named() {
        let callback = logger::<Ear> as Logger as *const ();
        assert_eq!(heard!("100%s of it", callback), "100(no argument) of it (there is no argument for \"%s\")");
        assert_eq!(heard!("%.1f %d", 1.0_f64, callback), "1.0 (no argument) (there is no argument for \"%d\")");
        assert!(!heard!("%p", callback).contains("no argument"), "a pointer may be shown");
    }
}
