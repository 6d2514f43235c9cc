//! Counts of a model at points of the solution, restored when an importer goes back in time.

use crate::Elapsed;
use serde::{Deserialize, Serialize};

/// Number of points after the last event that are kept. The stages and retries of one solver step need fewer.
const NEWEST: u8 = 8;

/// Events in the life of the counts of a model with [`CompletedSteps`](crate::CompletedSteps).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Account {
    /// Counts at an event: the importer goes back no further.
    Event(Elapsed),
    /// Counts at a completed step.
    Step(Elapsed),
    /// A step is completed at this time again: counts from this time on are discarded and counted anew.
    Again(Elapsed),
    /// The importer goes back to this time: counts after it are discarded.
    Back(Elapsed),
}

/// Copies of the counts `C`: at the last event and at the newest points after it.
///
/// ```
/// use fmu_core::{Account, Elapsed, Kept};
///
/// let (mut kept, at) = (Kept::default(), |t| Elapsed::ZERO.plus(t));
/// let mut area = 1.0;
/// kept.follow(Account::Event(at(0.0)), &mut area);
/// for (t, sum) in [(1.0, 3.0), (2.0, 7.0)] {
///     area = sum;
///     kept.follow(Account::Step(at(t)), &mut area);
/// }
/// kept.follow(Account::Back(at(1.5)), &mut area);
/// assert_eq!(area, 3.0);
/// kept.follow(Account::Back(at(0.5)), &mut area);
/// assert_eq!(area, 1.0);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Kept<C> {
    event: C,
    /// A ring of points; the oldest is at `first`.
    newest: [(Elapsed, C); NEWEST as usize],
    first: u8,
    count: u8,
}

impl<C: Clone> Kept<C> {
    /// Stores a copy of the `counts`, or restores the counts of the newest point not later than a given time. If no stored
    /// point is early enough, the counts at the event are restored.
    pub fn follow(&mut self, account: Account, counts: &mut C) {
        match account {
            Account::Event(_) => {
                self.event.clone_from(counts);
                self.count = 0;
            }
            Account::Step(now) => {
                // Stored bytes may contain any numbers.
                if self.count >= NEWEST {
                    (self.first, self.count) = ((self.first % NEWEST + 1) % NEWEST, NEWEST - 1);
                }
                let place = self.place(self.count);
                self.count += 1;
                self.newest[place] = (now, counts.clone());
            }
            Account::Back(time) | Account::Again(time) => {
                let again = matches!(account, Account::Again(_));
                let falls = |left: f64| left < 0.0 || again && left <= 0.0;
                while self.last().is_some_and(|(point, _)| falls(time.since(*point))) {
                    self.count -= 1;
                }
                counts.clone_from(self.last().map_or(&self.event, |(_, counts)| counts));
            }
        }
    }

    fn last(&self) -> Option<&(Elapsed, C)> {
        self.count.checked_sub(1).map(|i| &self.newest[self.place(i)])
    }

    fn place(&self, i: u8) -> usize {
        (usize::from(self.first) + usize::from(i)) % usize::from(NEWEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;

    fn at(t: u32) -> Elapsed {
        Elapsed::ZERO.plus(f64::from(t))
    }

    #[test]
    fn the_counts_are_those_of_the_newest_point_until_then() {
        // A list that is searched, instead of a ring.
        let (mut kept, mut event, mut list) = (Kept::default(), (0, 0), Vec::<(u32, u32)>::new());
        let (mut now, mut draw, mut far) = (0, Draw(7), 0);
        for i in 1..100_000 {
            let n = u32::try_from(draw.below(1 << 16)).unwrap();
            match n % 8 {
                0 => {
                    now = event.0 + n / 8 % (now - event.0 + 1);
                    list.retain(|(time, _)| *time <= now);
                    far += u32::from(list.is_empty());
                    let mut counts = 0;
                    kept.follow(Account::Back(at(now)), &mut counts);
                    assert_eq!(counts, list.last().unwrap_or(&event).1);
                }
                1 if n % 5 == 0 => {
                    (event, list) = ((now, i), Vec::new());
                    kept.follow(Account::Event(at(now)), &mut i.clone());
                }
                _ => {
                    now += n / 8 % 3;
                    if list.last().is_some_and(|(time, _)| *time == now) {
                        list.pop();
                        let mut counts = 0;
                        kept.follow(Account::Again(at(now)), &mut counts);
                        assert_eq!(counts, list.last().unwrap_or(&event).1);
                    }
                    list.push((now, i));
                    list = list.split_off(list.len().saturating_sub(NEWEST.into()));
                    kept.follow(Account::Step(at(now)), &mut i.clone());
                }
            }
        }
        assert!(far > 100, "it hardly ever goes back to the event");
    }
}
