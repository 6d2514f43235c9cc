//! Joins the fragments of HTML and SVG that make the page of a model, at compile time.
//!
//! Each page is complete: the page of a composite model contains the fragments of its parts, which are stored in their crates.

/// Joins texts at compile time.
///
/// ```
/// const PART: &str = "<p>part</p>";
/// const PAGE: &str = drive_base::joined!("<h1>whole</h1>", PART);
/// assert_eq!(PAGE, "<h1>whole</h1><p>part</p>");
/// ```
#[macro_export]
macro_rules! joined {
    ($($text:expr),* $(,)?) => {{
        const TEXTS: &[&str] = &[$($text),*];
        const BYTES: [u8; $crate::documentation::length(TEXTS)] = $crate::documentation::join(TEXTS);
        match ::std::str::from_utf8(&BYTES) {
            Ok(text) => text,
            Err(_) => panic!("texts in UTF-8 stay UTF-8 when joined"),
        }
    }};
}

/// Bytes of all `texts` together.
pub const fn length(texts: &[&str]) -> usize {
    let (mut sum, mut k) = (0, 0);
    while k < texts.len() {
        sum += texts[k].len();
        k += 1;
    }
    sum
}

/// The bytes of `texts`, one after the other; `N` is their [`length`].
pub const fn join<const N: usize>(texts: &[&str]) -> [u8; N] {
    let mut all = [0; N];
    let (mut rest, mut k) = (all.as_mut_slice(), 0);
    while k < texts.len() {
        let (one, others) = rest.split_at_mut(texts[k].len());
        one.copy_from_slice(texts[k].as_bytes());
        rest = others;
        k += 1;
    }
    all
}
