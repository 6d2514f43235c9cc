//! Choices of calls, the same for the same seed.

#![allow(dead_code, reason = "each test program uses a part")]

pub use fmu_core::draw::Draw;

pub trait Choices {
    /// True once in twenty draws.
    fn rarely(&mut self) -> bool;

    /// A number of values, rarely one more or less.
    fn count(&mut self, right: usize) -> usize;

    /// One of a list.
    fn of_mut<'a, T>(&mut self, list: &'a mut [T]) -> &'a mut T;
}

impl Choices for Draw {
    fn rarely(&mut self) -> bool {
        self.below(20) == 0
    }

    fn count(&mut self, right: usize) -> usize {
        if self.rarely() { self.of(&[right + 1, right.saturating_sub(1)]) } else { right }
    }

    fn of_mut<'a, T>(&mut self, list: &'a mut [T]) -> &'a mut T {
        let place = self.below(list.len());
        &mut list[place]
    }
}
