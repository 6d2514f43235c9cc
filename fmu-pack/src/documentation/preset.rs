//! The part of a preset's page that lists its start values.

use super::{escape, start, unit};
use fmu_core::Description;
use fmu_core::description::Variable;
use fmu_core::preset::FILE;
use std::fmt::Write;

/// The documentation of `preset`, a model that starts with the values of `own`: a line before the documentation of the model, and
/// a table after it.
pub fn preset(preset: &Description, own: &Description) -> String {
    let pairs: Vec<(&Variable, &Variable)> =
        preset.variables.iter().zip(&own.variables).filter(|(new, old)| new.start != old.start).collect();
    let name = escape(&own.name);
    let values = if pairs.len() == 1 { "1 start value".into() } else { format!("{} start values", pairs.len()) };
    let mut out = format!(
        "<p><b>A preset of {name}</b>, of which <a href=\"#preset\">{values}</a> differ. Figures and plots in this text are of \
         {name} itself.</p>\n{}\n<h2>Preset</h2>\n<p>The start values of this FMU that differ from those of {name}. \
          They are in its file resources/{FILE}; without it the binary refuses to run. An importer may set other \
           values.</p>\n\
         <table class=\"variables\">\n<tr><th>Name</th><th class=\"number\">Start</th><th>Unit</th>\
         <th class=\"number\">In {name}</th></tr>\n",
        own.documentation.trim()
    );
    for (new, old) in pairs {
        // Writing to a String does not fail.
        let _ = writeln!(
            out,
            "<tr><td class=\"name\">{}</td><td class=\"number\">{}</td><td class=\"unit\">{}</td><td class=\"number\">{}</td></tr>",
            escape(&new.name),
            start(new),
            unit(new),
            start(old)
        );
    }
    out + "</table>"
}
