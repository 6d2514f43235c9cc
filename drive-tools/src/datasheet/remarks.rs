//! What is to be said of a data sheet.

/// Assumptions, and values that may be wrong.
#[derive(Debug, Default)]
pub struct Remarks {
    /// Assumptions about what the data sheet does not say.
    pub notes: Vec<String>,
    /// Values that may be wrong.
    pub doubts: Vec<String>,
}

impl Remarks {
    /// Adds the first of the doubts about the speeds of a table, with the number of the others.
    pub fn doubt_all(&mut self, doubts: Vec<String>) {
        let others = doubts.len().saturating_sub(1);
        self.doubts.extend(doubts.into_iter().next().map(|first| match others {
            0 => first,
            1 => format!("{first}; another speed is odd, too"),
            _ => format!("{first}; {others} other speeds are odd, too"),
        }));
    }
}
