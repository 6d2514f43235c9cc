//! Settings that a call must not change: the floating-point control of the processor, the locale and the timers of the process.

/// Floating-point control of this thread: rounding, masks of exceptions, flushing to zero; without the flags that every
/// calculation sets. `None` where this is not known.
pub fn float_control() -> Option<u64> {
    #[cfg(target_arch = "x86_64")]
    {
        let (mut sse, mut x87) = (0_u32, 0_u16);
        // SAFETY: both instructions store a control word to the given address, which is ours and large enough.
        unsafe {
            std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut sse, options(nostack, preserves_flags));
            std::arch::asm!("fnstcw [{}]", in(reg) &raw mut x87, options(nostack, preserves_flags));
        }
        Some(u64::from(sse & 0xffc0) << 16 | u64::from(x87))
    }
    #[cfg(target_arch = "aarch64")]
    {
        let word: u64;
        // SAFETY: reads a control register.
        unsafe { std::arch::asm!("mrs {}, fpcr", out(reg) word, options(nomem, nostack, preserves_flags)) };
        Some(word)
    }
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    None
}

/// The locale of this process, from `setlocale`; `None` on systems where the number of LC_ALL is not known.
pub fn locale() -> Option<String> {
    #[cfg(target_os = "linux")]
    {
        use std::ffi::{c_char, c_int};
        unsafe extern "C" {
            fn setlocale(category: c_int, locale: *const c_char) -> *const c_char;
        }
        // SAFETY: without a locale it only reads; 6 is LC_ALL of the C library of Linux; the text is copied at once.
        unsafe { super::callbacks::optional(setlocale(6, std::ptr::null())) }
    }
    #[cfg(not(target_os = "linux"))]
    None
}

/// The interval timers of this process that are armed, as `setitimer` and `alarm` leave them; `None` where this is not known.
pub fn armed_timers() -> Option<Vec<&'static str>> {
    #[cfg(all(target_os = "linux", target_pointer_width = "64"))]
    {
        use std::ffi::{c_int, c_long};
        unsafe extern "C" {
            fn getitimer(which: c_int, value: *mut [c_long; 4]) -> c_int;
        }
        let is_armed = |which: c_int| {
            let mut value = [0; 4];
            // SAFETY: it writes a `struct itimerval`, which has four longs on 64-bit Linux, to a variable of ours.
            let read = unsafe { getitimer(which, &raw mut value) };
            read == 0 && value[2..] != [0, 0]
        };
        let names = [(0, "ITIMER_REAL"), (1, "ITIMER_VIRTUAL"), (2, "ITIMER_PROF")];
        Some(names.into_iter().filter(|(which, _)| is_armed(*which)).map(|(_, name)| name).collect())
    }
    #[cfg(not(all(target_os = "linux", target_pointer_width = "64")))]
    None
}
