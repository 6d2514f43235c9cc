//! Text inputs, lists and bytes through the C functions: values that arrive, and refusals before anything changes.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

#[path = "../counting/mod.rs"]
mod counting;
#[path = "../common/oracle.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod oracle;
mod random;

use fmi::*;
use fmu_core::{Block, Bytes, Elapsed, Exported, Fault, Info, Items, Model, Row, Step, Table, enumeration, table};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use std::ffi::{CStr, CString};
use std::process::Command;
use std::ptr::{NonNull, null, null_mut};

enumeration! {
    #[derive(Default, Serialize, Deserialize)]
    enum Color("Color", "Of a wire") {
        #[default]
        1 Red "Red";
        5 Blue "Blue";
    }
}

/// Maximum number of bytes of `rx`.
const MOST: usize = 2048;
const JSON: &str = "application/json";

#[derive(Clone, Default, Serialize, Deserialize)]
struct Kinds {
    title: String,
    counts: [i32; 3],
    small: [u8; 2],
    large: [u64; 2],
    tiny: [i8; 2],
    short: [i16; 2],
    half: [u16; 2],
    word: [u32; 2],
    long: [i64; 2],
    flags: [bool; 2],
    colors: [Color; 2],
    singles: [f32; 2],
    names: [String; 2],
    rx: Bytes,
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    counts: [i32; 3],
    tx: Bytes,
}

type V = Row<Block<Kinds>>;

impl Model for Kinds {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Kinds", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::text_input("title", "Text", |m| &mut m.model.title),
        V::list_input("counts", "Integers", 3, &Items(|m| &mut m.model.counts)).at_least(-9.0),
        V::list_input("small", "Bytes", 2, &Items(|m| &mut m.model.small)),
        V::list_input("large", "Of 64 bits", 2, &Items(|m| &mut m.model.large)),
        V::list_input("flags", "Truth values", 2, &Items(|m| &mut m.model.flags)),
        V::list_input("colors", "Colors", 2, &Items(|m| &mut m.model.colors)),
        V::list_input("singles", "Numbers", 2, &Items(|m| &mut m.model.singles)),
        V::list_input("names", "Texts", 2, &Items(|m| &mut m.model.names)),
        V::binary_input("rx", "Frame", JSON, MOST, |m| &mut m.model.rx),
        V::list_output("counts_out", "Integers", 3, &Items(|m| &mut m.out.counts)),
        V::text_output("title_out", "Text", |m| &m.model.title),
        V::binary_output("tx", "Frame", JSON, 3, |m| &mut m.out.tx),
        V::binary_parameter("key", "Frame", JSON, MOST, |m| &mut m.model.rx),
        V::list_input("tiny", "Of 8 bits", 2, &Items(|m| &mut m.model.tiny)),
        V::list_input("short", "Of 16 bits", 2, &Items(|m| &mut m.model.short)),
        V::list_input("half", "Of 16 bits, not negative", 2, &Items(|m| &mut m.model.half)),
        V::list_input("word", "Of 32 bits, not negative", 2, &Items(|m| &mut m.model.word)),
        V::list_input("long", "Of 64 bits, with a sign", 2, &Items(|m| &mut m.model.long)),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, out: &mut Outputs) {
        out.counts = self.counts;
        out.tx.clear();
        out.tx.extend(&self.rx[..self.rx.len().min(4)]);
    }
    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

fmu_export::export!(Kinds);

const TITLE: u32 = 1;
const COUNTS: u32 = 2;
const SMALL: u32 = 5;
const LARGE: u32 = 7;
const FLAGS: u32 = 9;
const COLORS: u32 = 11;
const SINGLES: u32 = 13;
const NAMES: u32 = 15;
const RX: u32 = 17;
const COUNTS_OUT: u32 = 18;
const TITLE_OUT: u32 = 21;
const TX: u32 = 22;
const KEY: u32 = 23;
const TINY: u32 = 24;
const SHORT: u32 = 26;
const HALF: u32 = 28;
const WORD: u32 = 30;
const LONG: u32 = 32;

const OK: c_int = 0;
const ERROR: c_int = 3;

/// An instance of FMI 3.0 in Initialization Mode.
fn entered() -> InstancePointer {
    let (token, no) = (CString::new(This::TOKEN.as_str()).unwrap(), Fmi3Boolean(0));
    let (name, token) = (c"it".as_ptr(), token.as_ptr());
    unsafe {
        let it = fmi3InstantiateCoSimulation(name, token, null(), no, no, no, no, null(), 0, null_mut(), None, None);
        assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), OK);
        it
    }
}

/// The same in Step Mode.
fn started() -> InstancePointer {
    let it = entered();
    assert_eq!(unsafe { fmi3ExitInitializationMode(it) }, OK);
    it
}

fn step(it: InstancePointer, t: f64) -> c_int {
    let (mut flags, mut last) = ([Fmi3Boolean(0); 3], 0.0);
    let [a, b, c] = &mut flags;
    unsafe { fmi3DoStep(it, t, 0.1, Fmi3Boolean(0), a, b, c, &mut last) }
}

fn set_bytes(it: InstancePointer, reference: u32, bytes: &[u8]) -> c_int {
    unsafe { fmi3SetBinary(it, &reference, 1, &bytes.len(), &bytes.as_ptr(), 1) }
}

fn bytes(it: InstancePointer, reference: u32) -> Result<Vec<u8>, c_int> {
    let (mut size, mut value) = (77, null());
    match unsafe { fmi3GetBinary(it, &reference, 1, &mut size, &mut value, 1) } {
        OK => {
            assert!(!value.is_null(), "not even for no byte");
            Ok(unsafe { std::slice::from_raw_parts(value, size) }.to_vec())
        }
        status => Err(status),
    }
}

fn said(it: InstancePointer, reference: u32) -> CString {
    let mut text = null();
    unsafe {
        assert_eq!(fmi3GetString(it, &reference, 1, &mut text, 1), OK);
        CStr::from_ptr(text).to_owned()
    }
}

#[test]
fn lists_of_every_type_cross_the_interface() {
    macro_rules! crosses {
        ($($get:ident $set:ident $type:ty: $reference:expr, $values:expr;)*) => { unsafe {
            let it = started();
            $(
                let values: &[$type] = &$values;
                let mut back = vec![values[0]; values.len()];
                let n = values.len();
                assert_eq!($set(it, &$reference, 1, values.as_ptr(), n), OK, stringify!($set));
                assert_eq!($get(it, &$reference, 1, back.as_mut_ptr(), n), OK, stringify!($get));
                assert_eq!(back, values, stringify!($get));
                for wrong in [n - 1, n + 1] {
                    assert_eq!($get(it, &$reference, 1, back.as_mut_ptr(), wrong), ERROR, stringify!($get));
                    fmi3Reset(it);
                    assert_eq!(fmi3EnterInitializationMode(it, Fmi3Boolean(0), 0.0, 0.0, Fmi3Boolean(0), 0.0), OK);
                }
                assert_eq!(fmi3ExitInitializationMode(it), OK);
            )*
            fmi3FreeInstance(it);
        } };
    }
    crosses! {
        fmi3GetInt32 fmi3SetInt32 i32: COUNTS, [-9, 0, i32::MAX];
        fmi3GetUInt8 fmi3SetUInt8 u8: SMALL, [0, 255];
        fmi3GetUInt64 fmi3SetUInt64 u64: LARGE, [1, u64::MAX];
        fmi3GetBoolean fmi3SetBoolean Fmi3Boolean: FLAGS, [Fmi3Boolean(1), Fmi3Boolean(0)];
        fmi3GetInt64 fmi3SetInt64 i64: COLORS, [5, 1];
        fmi3GetFloat32 fmi3SetFloat32 f32: SINGLES, [0.1, -3.5];
        fmi3GetInt8 fmi3SetInt8 i8: TINY, [i8::MIN, i8::MAX];
        fmi3GetInt16 fmi3SetInt16 i16: SHORT, [i16::MIN, i16::MAX];
        fmi3GetUInt16 fmi3SetUInt16 u16: HALF, [0, u16::MAX];
        fmi3GetUInt32 fmi3SetUInt32 u32: WORD, [0, u32::MAX];
        fmi3GetInt64 fmi3SetInt64 i64: LONG, [i64::MIN, i64::MAX];
    }
}

/// One element out of range or not an item: all values are unchanged.
#[test]
fn a_list_is_set_as_a_whole_or_not_at_all() {
    let it = started();
    unsafe {
        assert_eq!(fmi3SetInt32(it, &COUNTS, 1, [1, 2, 3].as_ptr(), 3), OK);
        assert_eq!(fmi3SetInt32(it, &COUNTS, 1, [7, 7, -10].as_ptr(), 3), ERROR);
        let mut counts = [0; 3];
        assert_eq!(fmi3GetInt32(it, &COUNTS, 1, counts.as_mut_ptr(), 3), OK, "readable after an error");
        assert_eq!(counts, [1, 2, 3]);
        fmi3FreeInstance(it);
        let it = started();
        assert_eq!(fmi3SetInt64(it, &COLORS, 1, [5, 2].as_ptr(), 2), ERROR);
        fmi3FreeInstance(it);
        let it = started();
        assert_eq!(fmi3SetInt32(it, &COUNTS, 1, [4, 5, 6].as_ptr(), 3), OK);
        let mut out = [9; 3];
        assert_eq!(fmi3GetInt32(it, &COUNTS_OUT, 1, out.as_mut_ptr(), 3), OK);
        assert_eq!(out, [0; 3], "an output follows with the step");
        assert_eq!(step(it, 0.0), OK);
        assert_eq!(fmi3GetInt32(it, &COUNTS_OUT, 1, out.as_mut_ptr(), 3), OK);
        assert_eq!(out, [4, 5, 6]);
        fmi3FreeInstance(it);
    }
}

#[test]
fn texts_are_inputs_and_lists() {
    let it = started();
    unsafe {
        assert_eq!(fmi3SetString(it, &TITLE, 1, &c"new".as_ptr(), 1), OK);
        assert_eq!(said(it, TITLE_OUT).as_c_str(), c"new", "in Step Mode");
        let names = [c"one".as_ptr(), c"\xcf\x88".as_ptr()];
        assert_eq!(fmi3SetString(it, &NAMES, 1, names.as_ptr(), 2), OK);
        let mut back = [null(); 2];
        assert_eq!(fmi3GetString(it, &NAMES, 1, back.as_mut_ptr(), 2), OK);
        assert_eq!(back.map(|text| CStr::from_ptr(text)), [c"one", c"\xcf\x88"]);
        assert_eq!(step(it, 0.0), OK);
        fmi3FreeInstance(it);
        // One is NULL, not UTF-8, or too long: the first keeps its value.
        let (most, longer) = (CString::new(vec![b'a'; 1 << 20]).unwrap(), CString::new(vec![b'a'; 2 << 20]).unwrap());
        for wrong in [null(), c"\xff".as_ptr(), longer.as_ptr()] {
            let it = started();
            assert_eq!(fmi3SetString(it, &NAMES, 1, [c"kept?".as_ptr(), wrong].as_ptr(), 2), ERROR);
            assert_eq!(fmi3GetString(it, &NAMES, 1, back.as_mut_ptr(), 2), OK);
            assert_eq!(back.map(|text| CStr::from_ptr(text)), [c"", c""]);
            fmi3FreeInstance(it);
        }
        let it = started();
        assert_eq!(fmi3SetString(it, &TITLE, 1, &most.as_ptr(), 1), OK);
        fmi3FreeInstance(it);
    }
}

/// In FMI 2.0, an element is a variable.
#[test]
fn fmi_2_has_the_elements() {
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    unsafe {
        let it = fmi2Instantiate(c"it".as_ptr(), 1, token.as_ptr(), null(), null(), Fmi2Boolean(0), Fmi2Boolean(0));
        assert_eq!(fmi2SetupExperiment(it, Fmi2Boolean(0), 0.0, 0.0, Fmi2Boolean(0), 0.0), OK);
        assert_eq!(fmi2EnterInitializationMode(it), OK);
        let elements = [COUNTS + 2, COLORS + 1, SMALL];
        assert_eq!(
            fmi2SetInteger(it, elements.as_ptr(), 3, [Fmi2Integer(42), Fmi2Integer(5), Fmi2Integer(7)].as_ptr()),
            OK
        );
        let mut back = [Fmi2Integer(0); 3];
        assert_eq!(fmi2GetInteger(it, elements.as_ptr(), 3, back.as_mut_ptr()), OK);
        assert_eq!(back, [Fmi2Integer(42), Fmi2Integer(5), Fmi2Integer(7)]);
        assert_eq!(fmi2SetString(it, &(NAMES + 1), 1, &c"second".as_ptr()), OK);
        let mut text = null();
        assert_eq!(fmi2GetString(it, &(NAMES + 1), 1, &mut text), OK);
        assert_eq!(CStr::from_ptr(text), c"second");
        fmi2FreeInstance(it);
    }
}

#[test]
fn bytes_are_copied() {
    let it = started();
    let mut frame = [1, 2, 3];
    assert_eq!((set_bytes(it, RX, &frame), bytes(it, TX)), (OK, Ok(vec![])));
    frame.fill(9);
    assert_eq!((step(it, 0.0), bytes(it, TX), bytes(it, RX)), (OK, Ok(vec![1, 2, 3]), Ok(vec![1, 2, 3])));
    unsafe {
        assert_eq!(fmi3SetBinary(it, &RX, 1, &0, &null(), 1), OK, "no byte needs no pointer");
        assert_eq!((step(it, 0.1), bytes(it, TX)), (OK, Ok(vec![])));
        fmi3FreeInstance(it);
    }
    // Four bytes at the output, whose row allows three: a fault of the model that stays invisible to importers.
    let it = started();
    assert_eq!((set_bytes(it, RX, &[0; 4]), step(it, 0.0), bytes(it, TX)), (OK, OK, Err(ERROR)));
    unsafe { fmi3FreeInstance(it) };
}

/// The log of `FMU_CALL_LOG` has the values of every type, as other tests pass them in a process of their own.
#[test]
fn a_call_log_shows_every_type() {
    let folder = std::env::temp_dir().join(format!("fmu-call-log-kinds-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let tests = ["lists_of_every_type_cross_the_interface", "texts_are_inputs_and_lists", "bytes_are_copied"];
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.arg("--exact").args(tests).args(["fmi_2_has_the_elements"]).env("FMU_CALL_LOG", &folder);
    assert!(command.output().unwrap().status.success());
    let files = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let log: String = files.map(|file| std::fs::read_to_string(file).unwrap()).collect();
    std::fs::remove_dir_all(&folder).unwrap();
    for call in [
        "fmi3SetInt8(vr=[24], n=1, values=[-128, 127], m=2) -> OK",
        "fmi3SetUInt8(vr=[5], n=1, values=[0, 255], m=2) -> OK",
        "fmi3SetInt16(vr=[26], n=1, values=[-32768, 32767], m=2) -> OK",
        "fmi3SetUInt16(vr=[28], n=1, values=[0, 65535], m=2) -> OK",
        "fmi3SetInt32(vr=[2], n=1, values=[-9, 0, 2147483647], m=3) -> OK",
        "fmi3SetUInt32(vr=[30], n=1, values=[0, 4294967295], m=2) -> OK",
        "fmi3SetInt64(vr=[32], n=1, values=[-9223372036854775808, 9223372036854775807], m=2) -> OK",
        "fmi3SetUInt64(vr=[7], n=1, values=[1, 18446744073709551615], m=2) -> OK",
        "fmi3SetFloat32(vr=[13], n=1, values=[0.1, -3.5], m=2) -> OK",
        "fmi3SetBoolean(vr=[9], n=1, values=[1, 0], m=2) -> OK",
        "fmi3SetString(vr=[15], n=1, values=[\"one\", \"\u{3c8}\"], m=2) -> OK",
        "fmi3SetString(vr=[15], n=1, values=[\"kept?\", NULL], m=2) -> Error",
        "fmi3GetBinary(vr=[17], n=1, sizes=?1, values=?1, m=1) -> OK sizes=[3] values=[0x010203]",
        "fmi3SetBinary(vr=[17], n=1, sizes=[0], values=[NULL], m=1) -> OK",
        "fmi2GetString(vr=[16], n=1, values=?1) -> OK values=[\"second\"]",
    ] {
        assert!(log.contains(call), "{call} is not in\n{log:.4000}");
    }
}

/// Sizes are checked before pointers: a page is neither read nor copied, and all values stay.
#[test]
fn what_is_too_large_is_refused_at_once() {
    let nowhere = NonNull::<u8>::dangling().as_ptr().cast_const();
    for (size, pointer) in [(1 << 30, nowhere), (MOST + 1, nowhere), (usize::MAX, nowhere), (1, null())] {
        let it = started();
        assert_eq!(set_bytes(it, RX, b"kept"), OK);
        counting::largest();
        // A valid value before it: all or nothing is set.
        let (references, sizes) = ([RX, RX], [2, size]);
        let status =
            unsafe { fmi3SetBinary(it, references.as_ptr(), 2, sizes.as_ptr(), [b"no".as_ptr(), pointer].as_ptr(), 2) };
        let largest = counting::largest();
        assert_eq!((status, bytes(it, RX)), (ERROR, Ok(b"kept".to_vec())), "{size}");
        assert!(largest < 1000, "{size}: {largest} bytes for a message");
        unsafe { fmi3FreeInstance(it) };
    }
    let calls: [fn(InstancePointer) -> c_int; 8] = [
        |it| unsafe { fmi3SetBinary(it, null(), 1, &1, &b"a".as_ptr(), 1) },
        |it| unsafe { fmi3SetBinary(it, &RX, 1, null(), &b"a".as_ptr(), 1) },
        |it| unsafe { fmi3SetBinary(it, &RX, 1, &1, null(), 1) },
        |it| unsafe { fmi3GetBinary(it, &RX, 1, null_mut(), &mut null(), 1) },
        |it| unsafe { fmi3GetBinary(it, &RX, 1, &mut 0, null_mut(), 1) },
        |it| unsafe { fmi3GetBinary(it, &TITLE, 1, &mut 0, &mut null(), 1) },
        |it| unsafe { fmi3SetBinary(it, &KEY, 1, &1, &b"a".as_ptr(), 1) },
        |it| unsafe { fmi3SetBinary(it, &TX, 1, &1, &b"a".as_ptr(), 1) },
    ];
    for (k, call) in calls.into_iter().enumerate() {
        let it = started();
        assert_eq!(call(it), ERROR, "{k}");
        unsafe { fmi3FreeInstance(it) };
    }
}

/// Memory for the maximum size is reserved from the start on, after a reset, and in a restored state.
#[test]
fn setting_bytes_does_not_allocate() {
    let _neighbor = counting::neighbor();
    let sets = |it: InstancePointer| {
        let frame = [7; MOST];
        let before = counting::calls();
        for n in [0, 1, MOST, 7, MOST, 3] {
            assert_eq!(set_bytes(it, RX, &frame[..n]), OK);
        }
        assert_eq!(step(it, 0.0), OK);
        assert_eq!(counting::calls() - before, 0);
    };
    let it = started();
    unsafe {
        let (mut state, mut size) = (null_mut(), 0);
        assert_eq!(fmi3GetFMUState(it, &mut state), OK);
        assert_eq!(fmi3SerializedFMUStateSize(it, state, &mut size), OK);
        let mut saved = vec![0; size];
        assert_eq!(fmi3SerializeFMUState(it, state, saved.as_mut_ptr(), size), OK);
        sets(it);
        assert_eq!(fmi3Reset(it), OK);
        assert_eq!(fmi3EnterInitializationMode(it, Fmi3Boolean(0), 0.0, 0.0, Fmi3Boolean(0), 0.0), OK);
        assert_eq!(fmi3ExitInitializationMode(it), OK);
        sets(it);
        assert_eq!(
            (fmi3FreeFMUState(it, &mut state), fmi3DeserializeFMUState(it, saved.as_ptr(), size, &mut state)),
            (OK, OK)
        );
        assert_eq!(fmi3SetFMUState(it, state), OK);
        sets(it);
        assert_eq!(fmi3FreeFMUState(it, &mut state), OK);
        fmi3FreeInstance(it);
    }
}
