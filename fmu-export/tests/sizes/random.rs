//! Random calls, right and wrong, of two instances that share saved states, against a state table written down once more by hand
//! from FMI 3.0.2, 2.3, 3.2 and 4.2, which runs the model natively. 2e4 calls; `FMU_CALLS=1000000` for more, `FMU_SEED` for others.

use super::draw::{Choices as _, Draw};
use super::*;
use std::fmt::Write;

const DISCARD: c_int = 2;

/// The expected state of an instance.
#[derive(Clone)]
struct Twin {
    exchange: bool,
    /// Instantiated, Configuration, initialization (n), Step, Event (v), Continuous-Time (x), Reconfiguration, terminated, Error.
    state: char,
    block: Block<Chain>,
    time: f64,
    elapsed: Elapsed,
    /// Something was set before the initialization, and nothing was read since.
    set: bool,
    /// The initialization is over.
    begun: bool,
}

impl Twin {
    fn new(exchange: bool) -> Self {
        let (mut block, elapsed) = (Block::default(), Elapsed::ZERO);
        block.initialize();
        Self { exchange, state: 'i', block, time: 0.0, elapsed, set: false, begun: false }
    }

    fn is(&self, states: &str) -> bool {
        states.contains(self.state)
    }

    /// Before the initialization ends, values match those set; in Model Exchange, outputs match the states.
    fn show(&mut self) {
        if self.is("in") && self.set {
            self.block.initialize();
            self.set = false;
        }
        if self.exchange && self.begun {
            self.block.model.output(self.elapsed, &mut self.block.out);
        }
    }

    fn number(&self) -> usize {
        self.block.model.x.len()
    }

    fn states(&self) -> Vec<f64> {
        [&self.block.model.x[..], &[self.block.model.z]].concat()
    }

    fn derivatives(&self) -> Vec<f64> {
        let mut dx = vec![0.0; self.number() + 1];
        self.block.model.derivatives(self.elapsed, &mut dx).unwrap();
        dx
    }

    fn values(&self, reference: u32) -> Vec<f64> {
        let (model, n) = (&self.block.model, self.number());
        match reference {
            GAINS => model.gains.clone(),
            X => model.x.clone(),
            Z => vec![model.z],
            Y => self.block.out.y.clone(),
            VALUES => model.map.values.clone(),
            DER_X => self.derivatives()[..n].to_vec(),
            _ => self.derivatives()[n..].to_vec(),
        }
    }

    /// Arrays get their sizes.
    fn resize(&mut self) -> c_int {
        let mut next = self.block.clone();
        if next.model.resize().is_err() {
            return ERROR;
        }
        if self.begun {
            next.model.output(self.elapsed, &mut next.out);
        } else {
            next.initialize();
        }
        self.block = next;
        OK
    }

    fn set_sizes(&mut self, references: &[u32], sizes: &[u64]) -> c_int {
        let before = self.block.clone();
        for (reference, size) in references.iter().zip(sizes) {
            let model = &mut self.block.model;
            let (place, range, tunable) = match *reference {
                N => (&mut model.n, 0..=5, true),
                K => (&mut model.k, 0..=4, false),
                ROWS => (&mut model.map.rows, 1..=200, false),
                // Not a size.
                _ => (&mut model.n, 7..=7, true),
            };
            let open = "ic".contains(self.state) || self.state == 'r' && tunable;
            if !open || !range.contains(size) {
                self.block = before;
                return ERROR;
            }
            *place = *size;
        }
        if self.state == 'i' && !references.is_empty() && self.resize() == ERROR {
            self.block = before;
            return ERROR;
        }
        self.set |= self.is("i") && !references.is_empty();
        OK
    }
}

const CALLS: [&str; 21] = [
    "enter",
    "exit",
    "configure",
    "configured",
    "sizes",
    "gains",
    "marks",
    "map",
    "get",
    "step",
    "event",
    "update",
    "leave",
    "set_states",
    "states",
    "derivatives",
    "nominals",
    "count",
    "terminate",
    "save",
    "restore",
];

/// A plausible next call of a simulation, or a random one.
fn choose(twin: &Twin, draw: &mut Draw) -> &'static str {
    if draw.below(15) == 0 {
        return draw.of(&CALLS);
    }
    match twin.state {
        'i' => draw.of(&["configure", "sizes", "gains", "map", "get", "enter", "save", "restore", "marks"]),
        'c' => draw.of(&["sizes", "sizes", "get", "configured", "save"]),
        'n' => draw.of(&["gains", "map", "get", "exit", "marks", "save"]),
        's' => draw.of(&["step", "step", "get", "gains", "configure", "save", "restore"]),
        'v' => draw.of(&["configure", "update", "leave", "gains", "get", "count", "restore"]),
        'x' => draw.of(&["set_states", "states", "derivatives", "get", "event", "nominals", "count", "save"]),
        'r' => draw.of(&["sizes", "configured", "get", "configured", "save", "restore"]),
        _ => draw.of(&["get", "reset", "reset", "restore", "reset"]),
    }
}

/// Two instances, their expected states, and saved states.
struct World {
    its: [It; 2],
    twins: [Twin; 2],
    saved: [(*mut c_void, Option<Twin>); 3],
    trace: String,
}

impl World {
    fn new(draw: &mut Draw) -> Self {
        let kinds = [draw.rarely() || draw.below(2) == 0, draw.below(2) == 0];
        let saved = std::array::from_fn(|_| (null_mut(), None));
        Self { its: kinds.map(It::new), twins: kinds.map(Twin::new), saved, trace: String::new() }
    }

    /// Status, and the expected status.
    #[expect(clippy::too_many_lines, reason = "a row for each call")]
    fn call(&mut self, draw: &mut Draw) -> [c_int; 2] {
        let who = draw.below(2);
        let (it, twin) = (&self.its[who], &mut self.twins[who]);
        let name = choose(twin, draw);
        let _ = write!(self.trace, "\n{who} {} {name}", twin.state);
        let before = twin.clone();
        // Only in Model Exchange, and in these states.
        let admits = |twin: &Twin, states: &str| twin.exchange && twin.is(states);
        let verdict = |fits: bool| if fits { OK } else { ERROR };
        let mut wanted = OK;
        let status = match name {
            "enter" => unsafe {
                wanted = verdict(twin.is("i"));
                twin.state = 'n';
                fmi3EnterInitializationMode(it.0, NO, 0.0, 0.0, NO, 0.0)
            },
            "exit" => unsafe {
                wanted = verdict(twin.is("n"));
                if wanted == OK {
                    twin.block.initialize();
                    (twin.set, twin.begun) = (false, true);
                    twin.state = if twin.exchange { 'v' } else { 's' };
                }
                fmi3ExitInitializationMode(it.0)
            },
            "configure" => {
                wanted = verdict(twin.is(if twin.exchange { "iv" } else { "is" }));
                if wanted == OK {
                    twin.show();
                    twin.state = if twin.is("i") { 'c' } else { 'r' };
                }
                it.enter()
            }
            "configured" => {
                wanted = if twin.is("cr") { twin.resize() } else { ERROR };
                let next = if twin.is("c") {
                    'i'
                } else if twin.exchange {
                    'v'
                } else {
                    's'
                };
                twin.state = next;
                it.exit()
            }
            "sizes" => {
                let references = [N, K, ROWS, if draw.rarely() { GAINS } else { N }];
                let first = draw.below(3);
                let references = &references[first..][..=draw.below(2)];
                let sizes: Vec<u64> = references.iter().map(|_| draw.of(&[0, 1, 2, 3, 4, 5, 3, 2])).collect();
                let _ = write!(self.trace, " {references:?} {sizes:?}");
                let may = twin.is("icr");
                wanted = if may { twin.set_sizes(references, &sizes) } else { ERROR };
                it.set_sizes(references, &sizes)
            }
            "gains" | "map" => {
                let reference = if name == "map" { VALUES } else { GAINS };
                let n = draw.count(twin.values(reference).len());
                let values: Vec<f64> =
                    (0..n).map(|_| if draw.below(60) == 0 { f64::NAN } else { draw.of(&[1.0, -2.0, 0.5]) }).collect();
                let _ = write!(self.trace, " {n}");
                let open = twin.is(if name == "map" { "in" } else { "insv" });
                let fits = n == twin.values(reference).len() && values.iter().all(|x| x.is_finite());
                // A fixed parameter, and in Continuous-Time Mode a tunable one, may be set to its present value.
                let kept = twin.is("svx") && n > 0 && values == twin.values(reference);
                wanted = verdict(
                    (open || kept) && fits || n == 0 && twin.values(reference).is_empty() && twin.is("icnsvxr"),
                );
                if wanted == OK {
                    let model = &mut twin.block.model;
                    let place = if name == "map" { &mut model.map.values } else { &mut model.gains };
                    place.clone_from(&values);
                    twin.set |= twin.is("in");
                }
                it.set(reference, &values)
            }
            "marks" => {
                let n = draw.count(twin.block.model.marks.len());
                let marks: Vec<i32> = (1..).take(n).collect();
                let fits = n == twin.block.model.marks.len();
                let kept = n > 0 && marks == twin.block.model.marks;
                wanted = verdict(fits && (twin.is("in") || kept && twin.is("svx") || n == 0 && twin.is("csvxr")));
                if wanted == OK {
                    twin.block.model.marks.clone_from(&marks);
                    twin.set |= twin.is("in");
                }
                unsafe { fmi3SetInt32(it.0, &MARKS, 1, marks.as_ptr(), n) }
            }
            "get" => {
                let reference = draw.of(&[GAINS, X, Z, Y, VALUES, DER_X, DER_Z]);
                twin.show();
                let expected = twin.values(reference);
                let n = draw.count(expected.len());
                let _ = write!(self.trace, " {reference} {n}");
                let known = !(twin.is("cr") && [DER_X, DER_Z].contains(&reference));
                // Without values, there is nothing to get.
                wanted = verdict(n == expected.len() && (known || n == 0));
                let (status, values) = it.get(reference, n);
                assert!(status != OK || wanted != OK || bits(&values) == bits(&expected), "{}", self.trace);
                status
            }
            "step" => {
                let (wrong, h) = (draw.rarely(), draw.of(&[0.01, 0.1]));
                wanted = verdict(twin.is("s") && !wrong);
                let t = twin.time;
                if wanted == OK {
                    twin.block.model.advance(&Step { start: twin.elapsed, h }).unwrap();
                    (twin.elapsed, twin.time) = (twin.elapsed.plus(h), t + h);
                    twin.block.model.output(twin.elapsed, &mut twin.block.out);
                }
                it.step(if wrong { t + 1.0 } else { t }, h)
            }
            "event" => {
                wanted = verdict(admits(twin, "xv"));
                twin.state = 'v';
                unsafe { fmi3EnterEventMode(it.0) }
            }
            "update" => {
                wanted = verdict(admits(twin, "v"));
                let (mut flags, mut next) = ([NO; 5], 0.0);
                let [a, b, c, d, e] = &mut flags;
                unsafe { fmi3UpdateDiscreteStates(it.0, a, b, c, d, e, &mut next) }
            }
            "leave" => {
                wanted = verdict(admits(twin, "v"));
                twin.state = 'x';
                unsafe { fmi3EnterContinuousTimeMode(it.0) }
            }
            "set_states" => {
                let n = draw.count(twin.number() + 1);
                let x: Vec<f64> = (0..n).map(|_| draw.of(&[0.0, 1.0, -3.0, 0.1, 7.0, -2e3])).collect();
                let wild = x.iter().take(twin.number()).any(|x| *x < -1e3);
                wanted = match (admits(twin, "xv") && n == twin.number() + 1, wild) {
                    (false, _) => ERROR,
                    (true, true) => DISCARD,
                    (true, false) => OK,
                };
                if wanted == OK {
                    let (z, array) = x.split_last().unwrap();
                    twin.block.model.x.copy_from_slice(array);
                    twin.block.model.z = *z;
                }
                unsafe { fmi3SetContinuousStates(it.0, x.as_ptr(), n) }
            }
            "states" | "derivatives" | "nominals" => {
                if name != "nominals" {
                    twin.show();
                }
                let expected = match name {
                    "states" => twin.states(),
                    "derivatives" => twin.derivatives(),
                    _ => [vec![2.0; twin.number()], vec![3.0]].concat(),
                };
                let n = draw.count(expected.len());
                wanted = verdict(admits(twin, "nvxt") && n == expected.len());
                let mut values = vec![-7.0; n + 1];
                let out = values.as_mut_ptr();
                let status = unsafe {
                    match name {
                        "states" => fmi3GetContinuousStates(it.0, out, n),
                        "derivatives" => fmi3GetContinuousStateDerivatives(it.0, out, n),
                        _ => fmi3GetNominalsOfContinuousStates(it.0, out, n),
                    }
                };
                assert_eq!(values.pop(), Some(-7.0), "{}", self.trace);
                assert!(status != OK || wanted != OK || bits(&values) == bits(&expected), "{}", self.trace);
                status
            }
            "count" => {
                wanted = verdict(admits(twin, "invxt"));
                let mut n = 0;
                let status = unsafe { fmi3GetNumberOfContinuousStates(it.0, &mut n) };
                assert!(status != OK || n == twin.number() + 1, "{}", self.trace);
                status
            }
            "terminate" => {
                wanted = verdict(twin.is("svxr"));
                twin.state = 't';
                unsafe { fmi3Terminate(it.0) }
            }
            "reset" => {
                *twin = Twin::new(twin.exchange);
                unsafe { fmi3Reset(it.0) }
            }
            "save" => {
                wanted = verdict(!twin.is("e"));
                let (state, of) = draw.of_mut(&mut self.saved);
                let status = unsafe { fmi3GetFMUState(it.0, state) };
                if status == OK {
                    if twin.begun {
                        twin.show();
                    }
                    *of = Some(twin.clone());
                }
                status
            }
            _ => {
                let (state, of) = draw.of_mut(&mut self.saved);
                let mut state = *state;
                let fits = of.as_ref().is_some_and(|of| of.exchange == twin.exchange);
                wanted = verdict(fits);
                let stored = draw.below(2) == 0 && of.is_some();
                if stored {
                    state = it.through_bytes(state);
                    self.trace.push_str(" bytes");
                }
                if fits {
                    twin.clone_from(of.as_ref().unwrap());
                }
                let status = unsafe { fmi3SetFMUState(it.0, state) };
                if stored {
                    assert_eq!(unsafe { fmi3FreeFMUState(it.0, &mut state) }, OK);
                }
                status
            }
        };
        if wanted == ERROR {
            *twin = Twin { state: 'e', ..before };
        }
        assert_eq!(status, wanted, "{}", self.trace);
        if wanted == ERROR || draw.below(4) == 0 {
            self.look(who);
        }
        [status, wanted]
    }

    /// Every size and every value.
    fn look(&mut self, who: usize) {
        let (it, twin) = (&self.its[who], &mut self.twins[who]);
        twin.show();
        let model = &twin.block.model;
        assert_eq!([it.size(N), it.size(K), it.size(ROWS)], [model.n, model.k, model.map.rows], "{}", self.trace);
        for reference in [GAINS, X, Z, Y, VALUES] {
            let expected = twin.values(reference);
            let values = it.values(reference, expected.len());
            assert_eq!(bits(&values), bits(&expected), "{who}: {reference} in {} {}", twin.state, self.trace);
        }
    }
}

impl Drop for World {
    fn drop(&mut self) {
        for (state, _) in &mut self.saved {
            unsafe { fmi3FreeFMUState(self.its[0].0, state) };
        }
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn random_calls_with_sizes() {
    let asked = |name: &str, otherwise| std::env::var(name).map_or(otherwise, |text| text.parse().unwrap());
    let (calls, mut draw) = (asked("FMU_CALLS", 20_000), Draw(asked("FMU_SEED", 1)));
    let (mut done, mut good) = (0, 0);
    while done < calls {
        let mut world = World::new(&mut draw);
        for _ in 0..200 {
            let [status, _] = world.call(&mut draw);
            good += u64::from(status == OK);
            done += 1;
        }
    }
    println!("{good} of {done} calls succeed");
    assert!(2 * good > done && good < done);
}
