//! Random calls of a model with texts, lists and bytes, against FMI 3.0.2, 2.2.7, 2.3 and 4.2, written down once more by hand.

use super::oracle::{Call, Importer, Oracle, State, Statuses, Turn, random_calls, verdict};
use super::*;
use State::{Initialization, Instantiated, Terminated};
use fmu_core::draw::Draw;

const NO: Fmi3Boolean = Fmi3Boolean(0);
/// No variable has it.
const NOBODY: u32 = 99;

/// The expected state of an instance.
#[derive(Clone, Default)]
struct Twin {
    state: State,
    time: f64,
    model: Kinds,
    out: Outputs,
    /// A value was set before the initialization ended, without a read since.
    set: bool,
}

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

    fn step(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let wrong = turn.mostly(&[0.0], &[1.0]);
        let status = step(turn.importer.0, self.time + wrong);
        self.compute();
        self.time += 0.1;
        [status, verdict(self.is(&[State::Step]) && wrong == 0.0)]
    }

    /// Up to three values of bytes in one call: all are set, or none.
    fn set_bytes(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let values: Vec<_> = (0..turn.draw.below(4)).map(|_| some_bytes(turn)).collect();
        let n = turn.count(values.len()).min(values.len());
        let (references, sizes): (Vec<_>, Vec<_>) = values.iter().map(|(of, size, _)| (*of, *size)).unzip();
        turn.note((&references, &sizes, n));
        // A fixed parameter may be set to its present value.
        let fixed = |of: u32| of == KEY && self.is(&[State::Step]);
        let kept = |of, size| fixed(of) && size <= MOST && *self.model.rx == CONTENT[..size];
        let good = |&(of, size, from): &(u32, usize, *const u8)| {
            [RX, KEY].contains(&of)
                && (self.open(of == KEY) || kept(of, size))
                && size <= MOST
                && (size == 0 || !from.is_null())
        };
        let fits = n == values.len() && !self.is(&[Terminated, State::Error]) && values.iter().all(good);
        let written = values.iter().rev().find(|(of, ..)| !fixed(*of)).filter(|_| fits);
        if let Some(&(_, size, _)) = written {
            self.model.rx.clear();
            self.model.rx.extend(&CONTENT[..size]);
            self.changed();
        }
        let (it, count) = (turn.importer.0, references.len());
        let from: Vec<_> = values.iter().map(|(.., from)| *from).collect();
        let status = unsafe { fmi3SetBinary(it, references.as_ptr(), count, sizes.as_ptr(), from.as_ptr(), n) };
        [status, verdict(fits)]
    }

    fn set_texts(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let reference = turn.mostly(&[TITLE, NAMES], &[TITLE_OUT, RX, NOBODY]);
        let right = if reference == NAMES { 2 } else { 1 };
        let n = turn.count(right);
        let good = [c"", c"a", c"\xcf\x88", c"longer than a pointer is wide"];
        let mut text = || {
            let good = turn.draw.of(&good);
            if turn.draw.below(40) == 0 { turn.draw.of(&[None, Some(c"\xff")]) } else { Some(good) }
        };
        let chosen: Vec<_> = (0..n).map(|_| text()).collect();
        turn.note((reference, &chosen));
        let new: Vec<String> =
            chosen.iter().filter_map(|text| Some(text.as_ref()?.to_str().ok()?.to_owned())).collect();
        let fits = n == right && new.len() == n && [TITLE, NAMES].contains(&reference) && self.open(false);
        match &new[..] {
            [title] if fits => self.model.title.clone_from(title),
            [one, other] if fits => self.model.names = [one.clone(), other.clone()],
            _ => {}
        }
        self.changed();
        let values: Vec<_> = chosen.iter().map(|text| text.map_or(null(), CStr::as_ptr)).collect();
        [unsafe { fmi3SetString(turn.importer.0, &reference, 1, values.as_ptr(), n) }, verdict(fits)]
    }

    /// A list of one of the types: rarely an element is out of range, is not an item, or is missing.
    fn set_numbers(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let (wrong, kind) = (turn.rarely(), turn.draw.below(6));
        let right = if kind == 0 { 3 } else { 2 };
        let n = turn.count(right);
        let (a, b) = (u8::try_from(turn.draw.below(256)).unwrap(), turn.draw.below(2) == 1);
        // Every byte, every number of 64 bits and every Boolean is in range.
        let fits = n == right && self.open(false) && (!wrong || [1, 2, 3].contains(&kind));
        let (it, model) = (turn.importer.0, &mut self.model);
        self.set |= [Instantiated, Initialization].contains(&self.state);
        // The last element is wrong: the elements before it keep their values.
        let status = unsafe {
            match kind {
                0 => {
                    let counts = [i32::from(a), -9, if wrong { -10 } else { 5 }, 0];
                    model.counts.copy_from_slice(&counts[..3]);
                    fmi3SetInt32(it, &COUNTS, 1, counts.as_ptr(), n)
                }
                1 => {
                    model.small = [a, 255];
                    fmi3SetUInt8(it, &SMALL, 1, [a, 255, 0].as_ptr(), n)
                }
                2 => {
                    model.large = [u64::from(a), u64::MAX];
                    fmi3SetUInt64(it, &LARGE, 1, [u64::from(a), u64::MAX, 0].as_ptr(), n)
                }
                3 => {
                    model.flags = [b, true];
                    fmi3SetBoolean(it, &FLAGS, 1, [Fmi3Boolean(b.into()), Fmi3Boolean(1), NO].as_ptr(), n)
                }
                4 => {
                    let color = if b { Color::Blue } else { Color::Red };
                    model.colors = [color, Color::Blue];
                    fmi3SetInt64(it, &COLORS, 1, [color as i64, if wrong { 2 } else { 5 }, 1].as_ptr(), n)
                }
                _ => {
                    model.singles = [f32::from(a) / 3.0, -0.5];
                    let last = if wrong { f32::NAN } else { -0.5 };
                    fmi3SetFloat32(it, &SINGLES, 1, [f32::from(a) / 3.0, last, 0.0].as_ptr(), n)
                }
            }
        };
        [status, verdict(fits)]
    }

    /// Bytes of two variables in one call.
    fn get_bytes(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        self.show();
        let last = turn.mostly(&[RX, KEY, TX], &[TITLE, NOBODY]);
        let last = if self.is_vague() && last == TX { RX } else { last };
        let (references, n) = ([RX, last], turn.count(2));
        let expected = references.map(|reference| self.bytes(reference));
        let (mut sizes, mut values) = ([77; 3], [null(); 3]);
        let status = unsafe {
            fmi3GetBinary(turn.importer.0, references.as_ptr(), 2, sizes.as_mut_ptr(), values.as_mut_ptr(), n)
        };
        let fits = n == 2 && expected.iter().all(Option::is_some);
        if fits && status == OK {
            let found = [0, 1].map(|k| Some(unsafe { std::slice::from_raw_parts(values[k], sizes[k]) }.to_vec()));
            assert_eq!(found, expected, "{}", turn.trace);
        }
        assert_eq!((sizes[2], values[2]), (77, null()), "written behind the values{}", turn.trace);
        [status, verdict(fits)]
    }

    fn get_texts(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        self.show();
        let reference = turn.mostly(&[TITLE, TITLE_OUT, NAMES], &[RX, NOBODY]);
        let expected = self.texts(reference);
        let n = turn.count(if reference == NAMES { 2 } else { 1 });
        let (status, found) = texts(turn.importer.0, reference, n);
        let fits = expected.as_ref().is_some_and(|expected| expected.len() == n);
        assert!(status != OK || !fits || Some(found) == expected, "{}", turn.trace);
        [status, verdict(fits)]
    }

    /// A call without arguments in one state, and the state that it leads to.
    fn plain(&mut self, from: State, to: State, status: c_int) -> Statuses {
        let wanted = verdict(self.state == from);
        self.state = to;
        [status, wanted]
    }
}

static CONTENT: [u8; MOST] = [7; MOST];

/// Reference, size and pointer. Above the maximum size, nothing is read.
fn some_bytes(turn: &mut Turn<'_, Twin>) -> (u32, usize, *const u8) {
    let nowhere = NonNull::<u8>::dangling().as_ptr().cast_const();
    let reference = turn.mostly(&[RX, RX, RX, KEY], &[TX, TITLE, COUNTS, NOBODY]);
    let (size, value) = match turn.draw.below(40) {
        0 => (turn.draw.of(&[1 << 30, MOST + 1, usize::MAX]), nowhere),
        1 => (1, null()),
        2 => (0, null()),
        _ => {
            let size = turn.draw.of(&[0, 1, 2, 3, 3, 4, 7, MOST]);
            (size, CONTENT[turn.draw.below(1 + MOST - size)..].as_ptr())
        }
    };
    (reference, size, value)
}

fn texts(it: InstancePointer, reference: u32, n: usize) -> (c_int, Vec<String>) {
    let mut values = [null(); 4];
    let status = unsafe { fmi3GetString(it, &reference, 1, values.as_mut_ptr(), n) };
    let text = |value: &Text| unsafe { CStr::from_ptr(*value) }.to_str().unwrap().to_owned();
    (status, if status == OK { values[..n].iter().map(text).collect() } else { Vec::new() })
}

/// An instance, freed when it is dropped.
struct It(InstancePointer);

impl Importer for It {
    fn it(&self) -> InstancePointer {
        self.0
    }
}

impl Drop for It {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.0) }
    }
}

impl Oracle for Twin {
    type Importer = It;
    const CALLS: &'static [Call] = &[
        Call::Enter,
        Call::Exit,
        Call::SetBytes,
        Call::SetTexts,
        Call::Set,
        Call::GetBytes,
        Call::GetTexts,
        Call::Step,
        Call::Terminate,
        Call::Reset,
        Call::Save,
        Call::Restore,
    ];
    const WILD: usize = 25;

    fn open(_: &mut Draw) -> (It, Self) {
        let token = CString::new(This::TOKEN.as_str()).unwrap();
        let (name, token, nobody) = (c"it".as_ptr(), token.as_ptr(), null_mut());
        let it =
            unsafe { fmi3InstantiateCoSimulation(name, token, null(), NO, NO, NO, NO, null(), 0, nobody, None, None) };
        (It(it), Self::default())
    }

    fn state(&mut self) -> &mut State {
        &mut self.state
    }

    fn next(&self) -> &'static [Call] {
        use Call::*;
        match self.state {
            Instantiated => &[Enter, Enter, SetBytes, SetTexts, Set, GetBytes, GetTexts, Save, Restore],
            Initialization => &[Exit, Exit, SetBytes, SetTexts, Set, GetBytes, GetTexts, Save],
            State::Step => {
                &[Step, Step, SetBytes, SetBytes, SetTexts, Set, GetBytes, GetBytes, GetTexts, Save, Restore]
            }
            _ => &[GetBytes, GetTexts, Reset, Reset, Restore],
        }
    }

    fn call(&mut self, call: Call, turn: &mut Turn<'_, Self>) -> Statuses {
        let it = turn.importer.0;
        match call {
            Call::Enter => {
                let status = unsafe { fmi3EnterInitializationMode(it, NO, 0.0, 0.0, NO, 0.0) };
                self.plain(Instantiated, Initialization, status)
            }
            Call::Exit => {
                self.compute();
                self.plain(Initialization, State::Step, unsafe { fmi3ExitInitializationMode(it) })
            }
            Call::Step => self.step(turn),
            Call::Terminate => self.plain(State::Step, Terminated, unsafe { fmi3Terminate(it) }),
            Call::Reset => {
                *self = Self::default();
                [unsafe { fmi3Reset(it) }, OK]
            }
            Call::SetBytes => self.set_bytes(turn),
            Call::SetTexts => self.set_texts(turn),
            Call::Set => self.set_numbers(turn),
            Call::GetBytes => self.get_bytes(turn),
            Call::GetTexts => self.get_texts(turn),
            _ => unreachable!(),
        }
    }

    /// Every value of an instance except the output that may be too long.
    fn look(&mut self, it: &It, trace: &str) {
        let it = it.0;
        self.show();
        assert_eq!(bytes(it, RX), Ok(self.model.rx.to_vec()), "{trace}");
        for reference in [TITLE, TITLE_OUT, NAMES] {
            let expected = self.texts(reference).unwrap();
            let (status, found) = texts(it, reference, expected.len());
            assert_eq!((status, &found), (OK, &expected), "{reference} in {:?} {trace}", self.state);
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
        let model = &self.model;
        assert_eq!((counts, small, large), (model.counts, model.small, model.large), "{trace}");
        assert!(out == self.out.counts || self.is_vague(), "{out:?} {:?} {trace}", self.out.counts);
        assert_eq!(flags.map(|flag| flag.0 != 0), model.flags);
        assert_eq!(colors, model.colors.map(|color| color as i64));
        assert_eq!(singles.map(f32::to_bits), model.singles.map(f32::to_bits));
    }
}

#[test]
fn random_calls_with_texts_lists_and_bytes() {
    random_calls::<Twin>(20_000);
}
