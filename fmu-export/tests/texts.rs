//! Texts and resources through the C functions: arguments that the importer may pass, results, and refusals.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

use fmi::*;
use fmu_core::{Block, Elapsed, Exported, Fault, Info, Model, Resource, Row, Step, Table, table};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::ffi::{CStr, CString};
use std::path::Path;
use std::ptr::{null, null_mut};

/// Returns its label, or a text that C cannot represent. The name of its folder selects the action of `load`.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Speaker {
    label: String,
    nul: bool,
    data: Resource<Vec<u8>>,
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    size: u8,
}

const LABEL: u32 = 1;
const NUL: u32 = 2;
const SAID: u32 = 3;
const SIZE: u32 = 4;

type V = Row<Block<Speaker>>;

impl Model for Speaker {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Speaker", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::text_parameter("label", "Text", |m| &mut m.model.label),
        V::boolean_input("nul", "Makes the text one that C cannot have", |m| &mut m.model.nul),
        V::text_output("said", "The text", |m| if m.model.nul { "a\0b" } else { &m.model.label }),
        V::uint8_output("size", "Bytes that were loaded", |m| &mut m.out.size),
    ];

    fn load(&mut self, resources: Option<&Path>) -> Result<(), Fault> {
        match resources.and_then(|folder| folder.file_name()?.to_str()) {
            None => Ok(()),
            Some("none") => Err(Fault::new("no file data.bin")),
            Some("panic") => panic!("the file is empty"),
            Some("change") => {
                self.label = "loaded".into();
                Ok(())
            }
            Some(name) => {
                self.data = Resource::from(name.as_bytes().to_vec());
                Ok(())
            }
        }
    }

    fn initialize(&mut self) {}

    fn output(&self, _: Elapsed, out: &mut Outputs) {
        out.size = u8::try_from(self.data.len()).unwrap_or(u8::MAX);
    }

    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

fmu_export::export!(Speaker);

thread_local! {
    static SAID_TO_THE_LOGGER: RefCell<String> = const { RefCell::new(String::new()) };
}

extern "C" fn log(_: *mut c_void, _: c_int, _: Text, message: Text) {
    let message = unsafe { CStr::from_ptr(message) }.to_str().unwrap().to_owned();
    SAID_TO_THE_LOGGER.set(message);
}

/// An instance of FMI 3.0 in Initialization Mode, or the reason for the mismatch.
fn open(resources: Option<&CStr>) -> Result<InstancePointer, String> {
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    let (no, resources) = (Fmi3Boolean(0), resources.map_or(null(), CStr::as_ptr));
    let name = c"it".as_ptr();
    unsafe {
        let it = fmi3InstantiateCoSimulation(
            name,
            token.as_ptr(),
            resources,
            no,
            no,
            no,
            no,
            null(),
            0,
            null_mut(),
            Some(log),
            None,
        );
        if it.is_null() {
            return Err(SAID_TO_THE_LOGGER.take());
        }
        assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), 0);
        Ok(it)
    }
}

fn said(it: InstancePointer, reference: u32) -> Result<CString, String> {
    let mut text = null();
    match unsafe { fmi3GetString(it, &reference, 1, &mut text, 1) } {
        0 => Ok(unsafe { CStr::from_ptr(text) }.to_owned()),
        _ => Err(SAID_TO_THE_LOGGER.take()),
    }
}

fn size(it: InstancePointer) -> u8 {
    let mut size = 0;
    assert_eq!(unsafe { fmi3GetUInt8(it, &SIZE, 1, &mut size, 1) }, 0);
    size
}

#[test]
fn what_no_text_can_be_is_refused_and_changes_nothing() {
    for (references, texts, why) in [
        (vec![LABEL], vec![null()], "label = NULL is not allowed: a text"),
        (vec![LABEL], vec![c"\xff".as_ptr()], "the new value of label is not UTF-8"),
        (vec![LABEL, SAID], vec![c"new".as_ptr(); 2], "said is an output and cannot be set"),
        (vec![LABEL, LABEL], vec![c"new".as_ptr(), null()], "label = NULL"),
        (vec![LABEL, NUL], vec![c"new".as_ptr(); 2], "nul is a truth value, and this function takes a text"),
        (vec![LABEL], vec![c"new".as_ptr(); 2], "nValues = 2 is not allowed: 1 for these value references"),
        (vec![99], vec![without_a_text()], "value reference 99 does not exist"),
    ] {
        let it = open(None).unwrap();
        unsafe {
            assert_eq!(fmi3SetString(it, &LABEL, 1, &c"old".as_ptr(), 1), 0);
            assert_eq!(fmi3SetString(it, references.as_ptr(), references.len(), texts.as_ptr(), texts.len()), 3);
            let message = SAID_TO_THE_LOGGER.take();
            assert!(message.contains(why), "{message}");
            assert_eq!(said(it, LABEL).unwrap().as_c_str(), c"old");
            fmi3FreeInstance(it);
        }
    }
}

/// An invalid pointer: it is not dereferenced for a variable that is not a text.
fn without_a_text() -> Text {
    std::ptr::without_provenance(8)
}

#[test]
fn a_text_with_a_nul_byte_is_an_error() {
    let it = open(None).unwrap();
    unsafe {
        assert_eq!(fmi3SetBoolean(it, &NUL, 1, &Fmi3Boolean(1), 1), 0);
        assert_eq!(said(it, SAID).unwrap_err(), "fmi3GetString: said has a NUL byte");
        fmi3FreeInstance(it);
    }
}

#[test]
fn texts_stay_until_the_next_call_of_their_instance() {
    let (it, other) = (open(None).unwrap(), open(None).unwrap());
    let mut texts = [null(); 3];
    unsafe {
        assert_eq!(fmi3SetString(it, &LABEL, 1, &c"mine".as_ptr(), 1), 0);
        assert_eq!(fmi3GetString(it, [LABEL, SAID, LABEL].as_ptr(), 3, texts.as_mut_ptr(), 3), 0);
        assert_eq!(fmi3SetString(other, &LABEL, 1, &c"its own".as_ptr(), 1), 0);
        assert_eq!(said(other, SAID).unwrap().as_c_str(), c"its own");
        assert!(texts.iter().all(|&text| CStr::from_ptr(text) == c"mine"));
        fmi3FreeInstance(it);
        fmi3FreeInstance(other);
    }
}

#[test]
fn the_folder_of_the_resources_arrives() {
    for (resources, expected) in [
        (None, 0),
        (Some(c""), 0),
        (Some(c"/some/where/"), 5),
        (Some(c"file:///some/w%68ere"), 5),
        (Some(c"http://example.org/where"), 0),
    ] {
        let it = open(resources).unwrap();
        assert_eq!(size(it), expected, "{resources:?}");
        unsafe {
            // A reset keeps what was loaded; so does a state that was bytes, in an instance that loaded something else.
            let (mut state, mut bytes) = (null_mut(), vec![0; 4096]);
            assert_eq!(fmi3GetFMUState(it, &mut state), 0);
            let mut length = 0;
            assert_eq!(fmi3SerializedFMUStateSize(it, state, &mut length), 0);
            bytes.truncate(length);
            assert_eq!(fmi3SerializeFMUState(it, state, bytes.as_mut_ptr(), length), 0);
            assert_eq!(fmi3FreeFMUState(it, &mut state), 0);
            let other = open(Some(c"/else")).unwrap();
            let mut read = null_mut();
            assert_eq!(fmi3DeserializeFMUState(other, bytes.as_ptr(), length, &mut read), 0);
            assert_eq!((fmi3SetFMUState(other, read), fmi3FreeFMUState(other, &mut read)), (0, 0));
            assert_eq!(fmi3ExitInitializationMode(other), 0);
            assert_eq!((size(other), fmi3Reset(it), size(it)), (4, 0, expected));
            fmi3FreeInstance(it);
            fmi3FreeInstance(other);
        }
    }
}

#[test]
fn a_load_that_fails_gives_no_instance() {
    let none = open(Some(c"/none")).unwrap_err();
    assert_eq!(none, "fmi3InstantiateCoSimulation: no file data.bin");
    let panicked = open(Some(c"/panic/")).unwrap_err();
    let said = "fmi3InstantiateCoSimulation: a fault in the model's code (panic): the file is empty (";
    assert!(panicked.starts_with(said) && panicked.contains("texts.rs:"), "{panicked}");
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    for (folder, works) in [(c"file:///none", false), (c"file:///panic", false), (c"file:///where", true)] {
        let callbacks = Fmi2Callbacks {
            logger: None,
            allocate_memory: null(),
            free_memory: null(),
            step_finished: null(),
            environment: null_mut(),
        };
        let no = Fmi2Boolean(0);
        let it = unsafe { fmi2Instantiate(c"it".as_ptr(), 1, token.as_ptr(), folder.as_ptr(), &callbacks, no, no) };
        assert_eq!(!it.is_null(), works, "{folder:?}");
        unsafe { fmi2FreeInstance(it) };
    }
}

/// `fmu build` requests the library's description with the folder available.
#[test]
fn a_load_that_changes_the_state_is_not_described() {
    extern "C" fn collect(context: *mut c_void, bytes: *const u8, len: usize) {
        unsafe { (*context.cast::<Vec<u8>>()).extend_from_slice(std::slice::from_raw_parts(bytes, len)) }
    }
    let describe = |folder: &CStr| {
        let mut said: Vec<u8> = Vec::new();
        let status = unsafe { fmu_description(collect, (&raw mut said).cast(), folder.as_ptr(), 0) };
        (status, String::from_utf8(said).unwrap())
    };
    assert_eq!(describe(c"/where").0, 0);
    let change = "load changes what a state saves: store what it reads in a Resource";
    assert_eq!(describe(c"/change"), (1, change.into()));
    assert_eq!(describe(c"/none"), (1, "no file data.bin".into()));
    let (status, panicked) = describe(c"/panic");
    assert!(
        status == 1 && panicked.starts_with("a fault in the model's code (panic): the file is empty ("),
        "{panicked}"
    );
}
