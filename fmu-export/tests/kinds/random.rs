//! Random calls, right and wrong, of two instances that share saved states, with texts, lists and bytes, against a state table
//! written down once more by hand from FMI 3.0.2, 2.2.7, 2.3 and 4.2. 2e4 calls; `FMU_CALLS=1000000` for more, `FMU_SEED` for others.

use super::draw::{Choices as _, Draw};
use super::*;
use std::fmt::Write;

const NO: Fmi3Boolean = Fmi3Boolean(0);
/// No variable has it.
const NOBODY: u32 = 99;

/// The expected state of an instance.
#[derive(Clone, Default)]
struct Twin {
    /// Instantiated, initialization (n), Step, terminated, Error.
    state: State,
    time: f64,
    model: Kinds,
    out: Outputs,
    /// Something was set before the initialization ended, and nothing was read since.
    set: bool,
}

#[derive(Clone, Copy, Default, PartialEq, Debug)]
enum State {
    #[default]
    Instantiated,
    Initialization,
    Step,
    Terminated,
    Error,
}
use State::{Initialization, Instantiated, Terminated};

impl Twin {
    fn is(&self, states: &[State]) -> bool {
        states.contains(&self.state)
    }

    fn compute(&mut self) {
        self.model.output(Elapsed::ZERO, &mut self.out);
        self.set = false;
    }

    /// Before the initialization ends, outputs match the values set when they are read.
    fn show(&mut self) {
        if self.set && self.is(&[Instantiated, Initialization]) {
            self.compute();
        }
    }

    /// After an error before the initialization ended, outputs may or may not match the values set.
    fn is_vague(&self) -> bool {
        self.set && self.state == State::Error
    }

    /// Whether variables can be set: inputs, and parameters until the initialization ends.
    fn open(&self, parameter: bool) -> bool {
        self.is(&[Instantiated, Initialization]) || !parameter && self.is(&[State::Step])
    }

    fn changed(&mut self) {
        self.set |= self.is(&[Instantiated, Initialization]);
    }

    /// Bytes of a variable, `None` where there are none to get: the output may be longer than its row allows.
    fn bytes(&self, reference: u32) -> Option<Vec<u8>> {
        match reference {
            RX | KEY => Some(self.model.rx.to_vec()),
            TX => Some(self.out.tx.to_vec()).filter(|tx| tx.len() <= 3),
            _ => None,
        }
    }

    fn texts(&self, reference: u32) -> Option<Vec<String>> {
        match reference {
            TITLE | TITLE_OUT => Some(vec![self.model.title.clone()]),
            NAMES => Some(self.model.names.to_vec()),
            _ => None,
        }
    }
}

fn verdict(fits: bool) -> c_int {
    if fits { OK } else { ERROR }
}

const CALLS: [&str; 13] = [
    "enter",
    "exit",
    "bytes",
    "texts",
    "numbers",
    "get bytes",
    "get texts",
    "step",
    "terminate",
    "reset",
    "save",
    "restore",
    "get bytes",
];

/// A plausible next call of a simulation, or a random one.
fn choose(state: State, draw: &mut Draw) -> &'static str {
    if draw.below(25) == 0 {
        return draw.of(&CALLS);
    }
    let values = ["bytes", "texts", "numbers", "get bytes", "get texts", "bytes", "get bytes"];
    let one = draw.of(&values);
    match state {
        Instantiated => draw.of(&["enter", one, one, "save", "restore"]),
        Initialization => draw.of(&["exit", one, one, "save"]),
        State::Step => draw.of(&["step", one, one, one, "save", "restore"]),
        Terminated | State::Error => draw.of(&["get bytes", "get texts", "reset", "reset", "restore"]),
    }
}

fn instance() -> InstancePointer {
    // The model does not panic: panics here are assertions.
    fmu_export::abi::quiet();
    drop(std::panic::take_hook());
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    let (name, token) = (c"it".as_ptr(), token.as_ptr());
    unsafe { fmi3InstantiateCoSimulation(name, token, null(), NO, NO, NO, NO, null(), 0, null_mut(), None, None) }
}

/// Two instances, their expected states, and saved states.
struct World {
    its: [InstancePointer; 2],
    twins: [Twin; 2],
    saved: [(*mut c_void, Option<Twin>); 3],
    trace: String,
}

impl World {
    fn new() -> Self {
        let saved = std::array::from_fn(|_| (null_mut(), None));
        Self { its: [instance(), instance()], twins: Default::default(), saved, trace: String::new() }
    }

    /// One call; whether it succeeds.
    fn call(&mut self, draw: &mut Draw) -> bool {
        let who = draw.below(2);
        let (it, before) = (self.its[who], self.twins[who].clone());
        let name = choose(before.state, draw);
        let _ = write!(self.trace, "\n{who} {:?} {name}", before.state);
        let twin = &mut self.twins[who];
        let (wanted, status) = match name {
            "enter" => {
                twin.state = Initialization;
                (verdict(before.state == Instantiated), unsafe {
                    fmi3EnterInitializationMode(it, NO, 0.0, 0.0, NO, 0.0)
                })
            }
            "exit" => {
                twin.compute();
                twin.state = State::Step;
                (verdict(before.state == Initialization), unsafe { fmi3ExitInitializationMode(it) })
            }
            "step" => {
                let wrong = draw.rarely();
                let status = step(it, twin.time + if wrong { 1.0 } else { 0.0 });
                twin.compute();
                twin.time += 0.1;
                (verdict(before.state == State::Step && !wrong), status)
            }
            "terminate" => {
                twin.state = Terminated;
                (verdict(before.state == State::Step), unsafe { fmi3Terminate(it) })
            }
            "reset" => {
                *twin = Twin::default();
                (OK, unsafe { fmi3Reset(it) })
            }
            "bytes" => set_some_bytes(it, twin, draw, &mut self.trace),
            "texts" => set_some_texts(it, twin, draw, &mut self.trace),
            "numbers" => set_numbers(it, twin, draw),
            "get bytes" => get_some_bytes(it, twin, draw, &self.trace),
            "get texts" => get_some_texts(it, twin, draw, &self.trace),
            "save" => {
                let (state, of) = draw.of_mut(&mut self.saved);
                let status = unsafe { fmi3GetFMUState(it, state) };
                if status == OK {
                    *of = Some(twin.clone());
                }
                (verdict(before.state != State::Error), status)
            }
            _ => {
                let through = draw.below(2) == 0;
                restore(it, twin, draw.of_mut(&mut self.saved), through)
            }
        };
        if wanted == ERROR {
            self.twins[who] = Twin { state: State::Error, ..before };
        }
        assert_eq!(status, wanted, "{}", self.trace);
        if wanted == ERROR || draw.below(4) == 0 {
            self.look(0);
            self.look(1);
        }
        status == OK
    }

    /// Every value of an instance except the output that may be too long.
    fn look(&mut self, who: usize) {
        let (it, twin) = (self.its[who], &mut self.twins[who]);
        twin.show();
        assert_eq!(bytes(it, RX), Ok(twin.model.rx.to_vec()), "{}", self.trace);
        for reference in [TITLE, TITLE_OUT, NAMES] {
            let expected = twin.texts(reference).unwrap();
            let (status, found) = texts(it, reference, expected.len());
            assert_eq!((status, &found), (OK, &expected), "{who}: {reference} in {:?} {}", twin.state, self.trace);
        }
        let (mut counts, mut out, mut small, mut large) = ([0; 3], [0; 3], [0; 2], [0; 2]);
        let (mut flags, mut colors, mut singles) = ([NO; 2], [0; 2], [0.0; 2]);
        unsafe {
            assert_eq!(fmi3GetInt32(it, &COUNTS, 1, counts.as_mut_ptr(), 3), OK);
            assert_eq!(fmi3GetInt32(it, &COUNTS_OUT, 1, out.as_mut_ptr(), 3), OK);
            assert_eq!(fmi3GetUInt8(it, &SMALL, 1, small.as_mut_ptr(), 2), OK);
            assert_eq!(fmi3GetUInt64(it, &LARGE, 1, large.as_mut_ptr(), 2), OK);
            assert_eq!(fmi3GetBoolean(it, &FLAGS, 1, flags.as_mut_ptr(), 2), OK);
            assert_eq!(fmi3GetInt64(it, &COLORS, 1, colors.as_mut_ptr(), 2), OK);
            assert_eq!(fmi3GetFloat32(it, &SINGLES, 1, singles.as_mut_ptr(), 2), OK);
        }
        let model = &twin.model;
        assert_eq!((counts, small, large), (model.counts, model.small, model.large), "{}", self.trace);
        assert!(out == twin.out.counts || twin.is_vague(), "{out:?} {:?} {}", twin.out.counts, self.trace);
        assert_eq!(flags.map(|flag| flag.0 != 0), model.flags);
        assert_eq!(colors, model.colors.map(|color| color as i64));
        assert_eq!(singles.map(f32::to_bits), model.singles.map(f32::to_bits));
    }
}

impl Drop for World {
    fn drop(&mut self) {
        for (state, _) in &mut self.saved {
            unsafe { fmi3FreeFMUState(self.its[0], state) };
        }
        self.its.iter().for_each(|it| unsafe { fmi3FreeInstance(*it) });
    }
}

/// Up to three values of bytes in one call: all are set, or none.
fn set_some_bytes(it: InstancePointer, twin: &mut Twin, draw: &mut Draw, trace: &mut String) -> (c_int, c_int) {
    static CONTENT: [u8; MOST] = [7; MOST];
    let nowhere = NonNull::<u8>::dangling().as_ptr().cast_const();
    let (mut references, mut sizes, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let mut fits = !twin.is(&[Terminated, State::Error]);
    for _ in 0..draw.below(4) {
        let reference = if draw.rarely() { draw.of(&[TX, TITLE, COUNTS, NOBODY]) } else { draw.of(&[RX, RX, RX, KEY]) };
        // Beyond the maximum size, nothing is read.
        let (size, value) = match draw.below(40) {
            0 => (draw.of(&[1 << 30, MOST + 1, usize::MAX]), nowhere),
            1 => (1, null()),
            2 => (0, null()),
            _ => {
                let size = draw.of(&[0, 1, 2, 3, 3, 4, 7, MOST]);
                (size, CONTENT[draw.below(1 + MOST - size)..].as_ptr())
            }
        };
        // A fixed parameter may be set to its present value.
        let kept = reference == KEY && twin.is(&[State::Step]) && size <= MOST && *twin.model.rx == CONTENT[..size];
        fits &= [RX, KEY].contains(&reference) && (twin.open(reference == KEY) || kept);
        fits &= size <= MOST && (size == 0 || !value.is_null());
        references.push(reference);
        sizes.push(size);
        values.push(value);
    }
    let n = draw.count(values.len()).min(values.len());
    let _ = write!(trace, " {references:?} {sizes:?} {n}");
    fits &= n == values.len();
    let written = |i: &usize| !(references[*i] == KEY && twin.is(&[State::Step]));
    if let Some(size) = (0..sizes.len()).rev().find(written).map(|i| sizes[i]).filter(|_| fits) {
        twin.model.rx.clear();
        twin.model.rx.extend(&CONTENT[..size]);
        twin.changed();
    }
    let status =
        unsafe { fmi3SetBinary(it, references.as_ptr(), references.len(), sizes.as_ptr(), values.as_ptr(), n) };
    (verdict(fits), status)
}

fn set_some_texts(it: InstancePointer, twin: &mut Twin, draw: &mut Draw, trace: &mut String) -> (c_int, c_int) {
    let reference = if draw.rarely() { draw.of(&[TITLE_OUT, RX, NOBODY]) } else { draw.of(&[TITLE, NAMES]) };
    let right = if reference == NAMES { 2 } else { 1 };
    let n = draw.count(right);
    let good = [c"", c"a", c"\xcf\x88", c"longer than a pointer is wide"];
    let mut fits = n == right && [TITLE, NAMES].contains(&reference) && twin.open(false);
    let mut chosen = Vec::new();
    for _ in 0..n {
        let wrong = draw.below(40) == 0;
        fits &= !wrong;
        chosen.push(if wrong { draw.of(&[None, Some(c"\xff")]) } else { Some(draw.of(&good)) });
    }
    let _ = write!(trace, " {reference} {chosen:?}");
    if fits {
        let text = |k: usize| chosen[k].unwrap().to_str().unwrap().to_owned();
        if reference == NAMES {
            twin.model.names = [text(0), text(1)];
        } else {
            twin.model.title = text(0);
        }
        twin.changed();
    }
    let values: Vec<_> = chosen.iter().map(|text| text.map_or(null(), CStr::as_ptr)).collect();
    (verdict(fits), unsafe { fmi3SetString(it, &reference, 1, values.as_ptr(), n) })
}

/// A list of one of the types: rarely an element is out of range, is not an item, or is missing.
fn set_numbers(it: InstancePointer, twin: &mut Twin, draw: &mut Draw) -> (c_int, c_int) {
    let (wrong, kind) = (draw.rarely(), draw.below(6));
    let n = draw.count(if kind == 0 { 3 } else { 2 });
    let mut fits = n == (if kind == 0 { 3 } else { 2 }) && twin.open(false);
    let (a, b) = (u8::try_from(draw.below(256)).unwrap(), draw.below(2));
    // The last element is the wrong one: those before it keep their values.
    let model = &mut twin.model;
    let status = unsafe {
        match kind {
            0 => {
                let counts = [i32::from(a), -9, if wrong { -10 } else { 5 }, 0];
                fits &= !wrong;
                if fits {
                    model.counts.copy_from_slice(&counts[..3]);
                }
                fmi3SetInt32(it, &COUNTS, 1, counts.as_ptr(), n)
            }
            1 => {
                if fits {
                    model.small = [a, 255];
                }
                fmi3SetUInt8(it, &SMALL, 1, [a, 255, 0].as_ptr(), n)
            }
            2 => {
                if fits {
                    model.large = [u64::from(a), u64::MAX];
                }
                fmi3SetUInt64(it, &LARGE, 1, [u64::from(a), u64::MAX, 0].as_ptr(), n)
            }
            3 => {
                if fits {
                    model.flags = [b == 1, true];
                }
                fmi3SetBoolean(it, &FLAGS, 1, [Fmi3Boolean(u8::from(b == 1)), Fmi3Boolean(1), NO].as_ptr(), n)
            }
            4 => {
                let color = if b == 1 { Color::Blue } else { Color::Red };
                fits &= !wrong;
                if fits {
                    model.colors = [color, Color::Blue];
                }
                fmi3SetInt64(it, &COLORS, 1, [color as i64, if wrong { 2 } else { 5 }, 1].as_ptr(), n)
            }
            _ => {
                fits &= !wrong;
                if fits {
                    model.singles = [f32::from(a) / 3.0, -0.5];
                }
                let last = if wrong { f32::NAN } else { -0.5 };
                fmi3SetFloat32(it, &SINGLES, 1, [f32::from(a) / 3.0, last, 0.0].as_ptr(), n)
            }
        }
    };
    if fits {
        twin.changed();
    }
    (verdict(fits), status)
}

/// Bytes of two variables in one call.
fn get_some_bytes(it: InstancePointer, twin: &mut Twin, draw: &mut Draw, trace: &str) -> (c_int, c_int) {
    twin.show();
    let last = if draw.rarely() { draw.of(&[TITLE, NOBODY]) } else { draw.of(&[RX, KEY, TX]) };
    let last = if twin.is_vague() && last == TX { RX } else { last };
    let (references, n) = ([RX, last], draw.count(2));
    let expected = references.map(|reference| twin.bytes(reference));
    let (mut sizes, mut values) = ([77; 3], [null(); 3]);
    let status = unsafe { fmi3GetBinary(it, references.as_ptr(), 2, sizes.as_mut_ptr(), values.as_mut_ptr(), n) };
    let fits = n == 2 && expected.iter().all(Option::is_some);
    if fits && status == OK {
        let found = [0, 1].map(|k| Some(unsafe { std::slice::from_raw_parts(values[k], sizes[k]) }.to_vec()));
        assert_eq!(found, expected, "{trace}");
    }
    assert_eq!((sizes[2], values[2]), (77, null()), "written behind the values{trace}");
    (verdict(fits), status)
}

fn texts(it: InstancePointer, reference: u32, n: usize) -> (c_int, Vec<String>) {
    let mut values = [null(); 4];
    let status = unsafe { fmi3GetString(it, &reference, 1, values.as_mut_ptr(), n) };
    let text = |value: &Text| unsafe { CStr::from_ptr(*value) }.to_str().unwrap().to_owned();
    (status, if status == OK { values[..n].iter().map(text).collect() } else { Vec::new() })
}

fn get_some_texts(it: InstancePointer, twin: &mut Twin, draw: &mut Draw, trace: &str) -> (c_int, c_int) {
    twin.show();
    let reference = if draw.rarely() { draw.of(&[RX, NOBODY]) } else { draw.of(&[TITLE, TITLE_OUT, NAMES]) };
    let expected = twin.texts(reference);
    let n = draw.count(if reference == NAMES { 2 } else { 1 });
    let (status, found) = texts(it, reference, n);
    let fits = expected.as_ref().is_some_and(|expected| expected.len() == n);
    assert!(status != OK || !fits || Some(found) == expected, "{trace}");
    (verdict(fits), status)
}

/// A state of one of the instances, as it was saved or through bytes.
fn restore(
    it: InstancePointer,
    twin: &mut Twin,
    saved: &mut (*mut c_void, Option<Twin>),
    through: bool,
) -> (c_int, c_int) {
    let (mut state, of) = (saved.0, &saved.1);
    let stored = through && of.is_some() && twin.state != State::Error;
    unsafe {
        if stored {
            let mut size = 0;
            assert_eq!(fmi3SerializedFMUStateSize(it, saved.0, &mut size), OK);
            let mut bytes = vec![0; size];
            assert_eq!(fmi3SerializeFMUState(it, saved.0, bytes.as_mut_ptr(), size), OK);
            state = null_mut();
            assert_eq!(fmi3DeserializeFMUState(it, bytes.as_ptr(), size, &mut state), OK);
        }
        let status = fmi3SetFMUState(it, state);
        if let Some(of) = of {
            twin.clone_from(of);
        }
        if stored {
            assert_eq!(fmi3FreeFMUState(it, &mut state), OK);
        }
        (verdict(of.is_some()), status)
    }
}

#[test]
fn random_calls_with_texts_lists_and_bytes() {
    let asked = |name: &str, otherwise| std::env::var(name).map_or(otherwise, |text| text.parse().unwrap());
    let (calls, mut draw) = (asked("FMU_CALLS", 20_000), Draw(asked("FMU_SEED", 1)));
    let (mut done, mut good) = (0, 0);
    while done < calls {
        let mut world = World::new();
        for _ in 0..200 {
            good += u64::from(world.call(&mut draw));
            done += 1;
        }
    }
    println!("{good} of {done} calls succeed");
    assert!(2 * good > done && good < done);
}
