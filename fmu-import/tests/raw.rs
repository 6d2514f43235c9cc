//! No argument of a raw call causes undefined behavior: dangerous ones are refused before they reach the FMU.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use fmu_import::Status;
use fmu_import::raw::{Arguments, Buffer, Handle, Interface, Raw, SavedState, Simple};
use model_description::{BaseType, FmiVersion};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::Command;

/// An FMU in C that ends its process when it receives a foreign pointer.
const SOURCE: &str = r#"
#include <stdint.h>
#include <stdlib.h>
typedef struct { int alive, states; } M;
static int fits(void *p) { if (!p || ((M *)p)->alive != 7) abort(); return 0; }
void *fmi3InstantiateCoSimulation(const char *n, const char *t, const char *r, _Bool v, _Bool l, _Bool e, _Bool y,
                                  const uint32_t *q, size_t c, void *env, void *log, void *update) {
    M *m = calloc(1, sizeof(M));
    m->alive = 7;
    return m;
}
void fmi3FreeInstance(M *m) { if (m) { fits(m); m->alive = 0; } }
int fmi3Reset(M *m) { return fits(m); }
int fmi3GetFMUState(M *m, void **s) { fits(m); if (!*s) { *s = malloc(1); m->states++; } return 0; }
int fmi3FreeFMUState(M *m, void **s) { fits(m); if (*s) { m->states--; *s = 0; } return 0; }
int fmi3SetFMUState(M *m, void *s) { fits(m); return s ? *(volatile char *)s, 0 : 3; }
int fmi3SerializedFMUStateSize(M *m, void *s, size_t *n) { fits(m); *n = SIZE_MAX - 100; return 0; }
int fmi3SerializeFMUState(M *m, void *s, char *b, size_t n) { fits(m); for (size_t i = 0; i < n; i++) b[i] = 1; return 0; }
int fmi3GetString(M *m, const uint32_t *r, size_t n, const char **v, size_t k) { fits(m); v[0] = "text"; return 0; }
int fmi3SetString(M *m, const uint32_t *r, size_t n, const char **v, size_t k) {
    fits(m);
    for (size_t i = 0; i < k; i++) if (v[i] && v[i][0] != 't') return 3;
    return 0;
}
int fmi3SetFloat64(M *m, const uint32_t *r, size_t n, const double *v, size_t k) { return fits(m); }
"#;

struct Library(tempfile::TempDir);

impl Library {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let source = folder.path().join("x.c");
        std::fs::write(&source, SOURCE).unwrap();
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-w", "-o"]).arg(folder.path().join("x.so")).arg(source);
        assert!(cc.status().unwrap().success());
        Self(folder)
    }

    fn open(&self) -> Raw {
        Raw::open(&self.0.path().join("x.so"), FmiVersion::V3).unwrap()
    }
}

fn instance(raw: &Raw) -> Handle {
    let arguments = Arguments {
        name: Some(c"p".into()),
        token: Some(c"g".into()),
        resources: None,
        interface: Interface::CoSimulation,
        logger: false,
        callbacks: false,
        memory: false,
        lasting: true,
        logging: false,
        event_mode: false,
        early_return: false,
        environment: 0,
        intermediate: None,
        locks: false,
    };
    raw.instantiate(&arguments).unwrap().unwrap()
}

/// The message of a refused call.
fn refused<T>(call: impl FnOnce() -> T) -> String {
    let panic = catch_unwind(AssertUnwindSafe(call)).err().expect("the call is refused");
    panic.downcast_ref::<String>().cloned().or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string)).unwrap()
}

#[test]
fn an_instance_that_is_freed_or_foreign_is_refused() {
    let library = Library::new();
    let (raw, other) = (library.open(), library.open());
    let (freed, foreign, alive) = (instance(&raw), instance(&other), instance(&raw));
    raw.free(freed).unwrap();
    assert_eq!(refused(|| raw.free(freed)), "the instance is freed");
    assert_eq!(refused(|| raw.simple(Simple::Reset, freed)), "the instance is freed");
    assert_eq!(refused(|| raw.simple(Simple::Reset, foreign)), "the instance is of another binary");
    assert_eq!(raw.simple(Simple::Reset, alive), Some(Status::OK), "a refusal leaves the model unchanged");
    raw.free(Handle::NULL).unwrap();
}

#[test]
fn a_state_that_is_freed_or_foreign_is_refused() {
    let library = Library::new();
    let (raw, other) = (library.open(), library.open());
    let (one, two, foreign) = (instance(&raw), instance(&raw), instance(&other));
    let state = |raw: &Raw, instance| {
        let mut state = SavedState::NULL;
        assert_eq!(raw.get_state(instance, Some(&mut state)), Some(Status::OK));
        state
    };
    let (mut saved, orphan) = (state(&raw, one), state(&raw, two));
    let copy = saved;
    assert_eq!(raw.set_state(two, saved), Some(Status::OK), "of another instance of the same binary");
    assert_eq!(raw.free_state(one, Some(&mut saved)), Some(Status::OK));
    assert_eq!(saved, SavedState::NULL);
    let ended = "the state was freed, individually or with its instance";
    assert_eq!(refused(|| raw.set_state(one, copy)), ended);
    assert_eq!(refused(|| raw.free_state(one, Some(&mut copy.clone()))), ended);
    raw.free(two).unwrap();
    assert_eq!(refused(|| raw.set_state(one, orphan)), ended);
    let abroad = state(&other, foreign);
    assert_eq!(refused(|| raw.set_state(one, abroad)), "the state is of another binary");
    assert_eq!(raw.set_state(one, SavedState::NULL), Some(Status::ERROR));
}

#[test]
fn a_pointer_is_not_made_from_a_number() {
    let library = Library::new();
    let raw = library.open();
    let p = instance(&raw);
    let text = |bits: &[u64]| Buffer::of(BaseType::String, FmiVersion::V3, bits);
    assert_eq!(refused(|| text(&[0xdead])), "a pointer cannot be made from a number");
    let set = |buffer: &mut Buffer, n| raw.set(p, BaseType::String, Some(&[1]), 1, Some(buffer), n);
    assert_eq!(set(&mut text(&[0]), 1), Some(Status::OK), "NULL, which the checker passes on purpose");
    assert_eq!(refused(|| set(&mut text(&[0]), 2)), "a pointer that is not ours");
    let mut got = Buffer::room(BaseType::String, FmiVersion::V3, 1);
    assert_eq!(raw.get(p, BaseType::String, Some(&[1]), 1, Some(&mut got), 1), Some(Status::OK));
    assert_eq!(refused(|| set(&mut got, 1)), "a pointer that is not ours");
    let mut number = Buffer::of(BaseType::UInt64, FmiVersion::V3, &[0]);
    assert_eq!(refused(|| set(&mut number, 1)), "the buffer is not of the type String");
    let mut float = Buffer::of(BaseType::Float64, FmiVersion::V3, &[0xdead]);
    assert_eq!(raw.set(p, BaseType::Float64, Some(&[1]), 1, Some(&mut float), 1), Some(Status::OK));
    assert!(refused(|| raw.set(p, BaseType::Binary, Some(&[1]), 1, None, 1)).contains("takes other arguments"));
    assert_eq!(raw.set_strings(p, &[1], &[Some(c"text")]), Some(Status::OK));
    assert_eq!(refused(|| raw.set_strings(p, &[1, 2], &[None])), "there are fewer texts than references");
}

#[test]
fn a_size_that_no_memory_has_is_refused() {
    let library = Library::new();
    let raw = library.open();
    let (p, mut state) = (instance(&raw), SavedState::NULL);
    raw.get_state(p, Some(&mut state)).unwrap();
    let (status, size) = raw.state_size(p, state).unwrap();
    assert_eq!((status, size), (Status::OK, usize::MAX - 100));
    for size in [usize::MAX, size, isize::MAX as usize, (1 << 30) + 1] {
        let error = raw.serialize(p, state, size).unwrap_err();
        assert!(error.contains(&format!("the FMU state has {size} bytes, more than 1073741824")), "{error}");
    }
    assert_eq!(raw.serialize(p, state, 3), Ok(Some((Status::OK, vec![1; 3], true))));
}

/// Calls from several threads follow one another: an instance that one thread frees is refused in the others.
#[test]
fn threads_cannot_free_twice() {
    let library = Library::new();
    let raw = library.open();
    for _ in 0..200 {
        let p = instance(&raw);
        let freed = std::thread::scope(|scope| {
            let free = || catch_unwind(AssertUnwindSafe(|| raw.free(p))).is_ok();
            let workers = [(); 3].map(|()| scope.spawn(free));
            workers.into_iter().filter_map(|w| w.join().ok()).filter(|freed| *freed).count()
        });
        assert_eq!(freed, 1);
    }
}
