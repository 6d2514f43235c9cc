//! Refusals while compiling. A panic is then an error of the compiler, whose text names the row, the state or the model.

/// A compile-time check of a row. The error is reported at the caller, which is the row, with the variable's name.
#[track_caller]
pub(crate) const fn demand(fits: bool, name: &str, why: &str) {
    if !fits {
        fail(&[name, ": ", why]);
    }
}

/// An error of the compiler with this text.
#[track_caller]
pub(crate) const fn fail(parts: &[&str]) -> ! {
    // A panic while compiling takes one text.
    let (mut text, mut len, mut part) = ([0_u8; 512], 0, 0);
    while part < parts.len() {
        let (bytes, mut i) = (parts[part].as_bytes(), 0);
        while i < bytes.len() && len < text.len() {
            text[len] = bytes[i];
            (i, len) = (i + 1, len + 1);
        }
        part += 1;
    }
    match std::str::from_utf8(text.split_at(len).0) {
        Ok(text) => panic!("{}", text),
        Err(_) => panic!("{}", parts[parts.len() - 1]),
    }
}

/// A number in decimal.
#[expect(clippy::cast_possible_truncation, reason = "a digit")]
pub(crate) const fn digits(mut number: usize, text: &mut [u8; 20]) -> &str {
    let mut first = text.len();
    while first == text.len() || number > 0 {
        first -= 1;
        text[first] = b'0' + (number % 10) as u8;
        number /= 10;
    }
    match std::str::from_utf8(text.split_at(first).1) {
        Ok(text) => text,
        Err(_) => "",
    }
}

/// Whether a text begins with another.
pub(crate) const fn starts_with(text: &str, start: &str) -> bool {
    let (text, start, mut i) = (text.as_bytes(), start.as_bytes(), 0);
    while i < start.len() {
        if i >= text.len() || text[i] != start[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// Whether two texts are equal.
pub(crate) const fn same_text(a: &str, b: &str) -> bool {
    a.len() == b.len() && starts_with(a, b)
}
