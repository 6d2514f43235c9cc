//! Messages on standard error, which name each thing once, with a colored first word on a terminal. `NO_COLOR` disables the color, `CLICOLOR_FORCE` enables
//! it for files and pipes too.

use clap::builder::Styles;
use clap::builder::styling::{AnsiColor, Style};
use fmu_import::once;

/// Colors of the help.
pub const HELP: Styles = Styles::styled()
    .header(AnsiColor::Green.on_default().bold())
    .usage(AnsiColor::Green.on_default().bold())
    .literal(AnsiColor::Cyan.on_default().bold())
    .placeholder(AnsiColor::Cyan.on_default());

/// The reason why the command ends.
pub fn error(text: &str) {
    say(AnsiColor::Red, "error", text);
}

/// Something that may invalidate a result.
pub fn warning(text: &str) {
    say(AnsiColor::Yellow, "warning", text);
}

/// Useful information.
pub fn note(text: &str) {
    say(AnsiColor::Cyan, "note", text);
}

fn say(color: AnsiColor, word: &str, text: &str) {
    let style: Style = color.on_default().bold();
    #[cfg(feature = "full")]
    anstream::eprintln!("{style}{word}:{style:#} {}", once(text));
    #[cfg(not(feature = "full"))]
    {
        let _ = style;
        eprintln!("{word}: {}", once(text));
    }
}
