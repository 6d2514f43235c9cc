//! The messages of the FMUs on standard error.

use crate::message;
use fmu_import::{Message, Status, printable, printable_lines};
use fmu_system::cosimulation::with_name;
use std::collections::BTreeSet;

/// Maximum number of different warnings shown without `--logging`.
const SHOWN: usize = 20;

/// Shows messages as they come.
pub(super) struct Log {
    all: bool,
    shown: BTreeSet<String>,
    further: usize,
}

impl Log {
    /// Shows all messages, or each warning once.
    pub(super) fn new(all: bool) -> Self {
        Self { all, shown: BTreeSet::new(), further: 0 }
    }

    /// Shows messages and the instances that logged them.
    pub(super) fn show(&mut self, messages: &[(String, Message)]) {
        for (instance, Message { status, category, text, .. }) in messages {
            let (instance, text) = (printable(instance), printable_lines(text));
            if self.all {
                eprintln!("{instance}: {status} [{}] {text}", printable(category));
            } else if *status == Status::WARNING {
                self.warn(with_name(&instance, text.into_owned()));
            }
        }
    }

    fn warn(&mut self, text: String) {
        if self.shown.contains(&text) {
            return;
        }
        if self.shown.len() == SHOWN {
            self.further += 1;
            return;
        }
        message::warning(&text);
        self.shown.insert(text);
    }

    /// Reports how many warnings were not shown.
    pub(super) fn end(self) {
        if self.further > 0 {
            message::note(&format!("{} further warnings of the FMUs; --logging shows all messages", self.further));
        }
    }
}
