//! Checks that a page of the documentation shows the result of a run.
#![allow(dead_code)]

/// The file at `path` with the text `page` contains `text`; otherwise the message contains both texts and the remedy.
pub(crate) fn shows(path: &str, page: &str, text: &str) {
    assert!(page.contains(text), "{}", differs(path, page, text));
}

/// The message of a test if the page does not contain `text`.
pub(crate) fn differs(path: &str, page: &str, text: &str) -> String {
    // The line that begins like the text, or shares the longest beginning with it.
    let common = |line: &str| line.chars().zip(text.chars()).take_while(|(a, b)| a == b).count();
    let line = page.lines().map(str::trim_start).max_by_key(|line| common(line)).unwrap_or_default();
    let old = if common(line) >= 8 { format!("The page has\n{line}\n") } else { String::new() };
    format!(
        "{path} does not have what a run gives now:\n{text}\n{old}If you meant to change the drive, write the new text into the page. If \
         not, a number has moved: look for the change that moved it."
    )
}
