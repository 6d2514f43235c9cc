//! A minimal importer for Model Exchange.
#![allow(dead_code, reason = "each test program uses a part")]

use fmu_core::{Block, CompletedSteps, Elapsed, Events, Model};

/// Maximum number of states and of indicators of a model.
const MOST: usize = 8;

/// An importer for Model Exchange, with Runge-Kutta steps of at most `longest` (s) that end at the model's events.
pub(crate) struct Importer<M: Model> {
    pub(crate) block: Block<M>,
    pub(crate) now: Elapsed,
    longest: f64,
    /// Number of integration steps that the importer reports as one completed step; 0: it reports none.
    reported: u32,
    done: u32,
}

impl<M: CompletedSteps + Events + Clone> Importer<M> {
    pub(crate) fn new(model: M, longest: f64, reported: u32) -> Self {
        let mut block = Block { model, ..Block::default() };
        block.initialize();
        let mut importer = Self { block, now: Elapsed::ZERO, longest, reported, done: 0 };
        importer.event(|_| ());
        importer
    }

    /// An event, with inputs that jump.
    pub(crate) fn event(&mut self, set: impl FnOnce(&mut M)) {
        let (model, now) = (&mut self.block.model, self.now);
        model.complete(now).unwrap();
        model.begin(now);
        set(model);
        while model.event(now).unwrap().again {}
        model.complete(now).unwrap();
    }

    /// Integrates over `h` (s), with inputs from `set` at every time (s) and an event at the end if one is due.
    pub(crate) fn run(&mut self, h: f64, set: impl Fn(&mut M, f64)) {
        let end = self.now.plus(h);
        loop {
            let left = end.since(self.now);
            if left <= 1e-9 * h {
                break;
            }
            let next = self.block.model.next(self.now).left(self.now).unwrap_or(left).min(left);
            let steps = (next / self.longest - 1e-9).ceil().max(1.0);
            let crossed = self.until_crossing(next / steps, &set);
            self.done += 1;
            if self.reported > 0 && self.done.is_multiple_of(self.reported) {
                self.block.model.complete(self.now).unwrap();
            }
            if crossed || self.block.model.next(self.now).is_due(self.now) {
                self.event(|_| ());
            }
        }
        self.block.model.observe(self.now, &mut self.block.out);
    }

    /// The signs of the indicators.
    fn signs(&self) -> [bool; MOST] {
        let mut z = [0.0; MOST];
        self.block.model.indicators(self.now, &mut z[..M::INDICATORS.len()]);
        z.map(|z| z > 0.0)
    }

    /// A step of `h` (s), or a shorter one to the first change of an indicator's sign; returns whether one changed.
    fn until_crossing(&mut self, h: f64, set: &impl Fn(&mut M, f64)) -> bool {
        let (start, now, signs) = (self.block.model.clone(), self.now, self.signs());
        self.rk4(h, set);
        if self.signs() == signs {
            return false;
        }
        let (mut before, mut after) = (0.0, h);
        for _ in 0..30 {
            let middle = 0.5 * (before + after);
            (self.block.model, self.now) = (start.clone(), now);
            self.rk4(middle, set);
            *(if self.signs() == signs { &mut before } else { &mut after }) = middle;
        }
        (self.block.model, self.now) = (start, now);
        self.rk4(after, set);
        true
    }

    fn rk4(&mut self, h: f64, set: &impl Fn(&mut M, f64)) {
        let (model, start) = (&mut self.block.model, self.now);
        let x: [f64; MOST] = std::array::from_fn(|i| M::STATES.get(i).map_or(0.0, |state| *state.at(model)));
        let (mut sum, mut k) = ([0.0; MOST], [0.0; MOST]);
        let at = |model: &mut M, share: f64, k: &[f64; MOST]| {
            for (i, state) in M::STATES.iter().enumerate() {
                *state.at(model) = x[i] + share * h * k[i];
            }
            model.settle();
            let now = start.plus(share * h);
            set(model, now.seconds());
            now
        };
        for (share, weight) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
            let now = at(model, share, &k);
            model.derivatives(now, &mut k[..M::STATES.len()]).unwrap();
            sum = std::array::from_fn(|i| sum[i] + weight * k[i]);
        }
        self.now = at(model, 1.0, &sum.map(|k| k / 6.0));
    }
}
