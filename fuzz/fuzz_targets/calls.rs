#![no_main]
#![allow(dead_code, unreachable_pub, clippy::all)]

#[path = "../../fmu-export/tests/common/mod.rs"]
mod common;
#[path = "../../fmu-export/tests/sequences/from_bytes.rs"]
mod from_bytes;
#[path = "../../fmu-export/tests/sequences/operation.rs"]
mod operation;
#[path = "../../fmu-export/tests/sequences/perform.rs"]
mod perform;
#[path = "../../fmu-export/tests/sequences/reference.rs"]
mod reference;
#[path = "../../fmu-export/tests/common/state.rs"]
mod state;
#[path = "../../fmu-export/tests/sequences/world.rs"]
mod world;

use std::sync::Once;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        common::loud();
        from_bytes::quiet();
    });
    if let Err(panic) = std::panic::catch_unwind(|| from_bytes::sequence(bytes)) {
        eprintln!("{:#?}", from_bytes::operations(bytes.get(1..).unwrap_or_default()));
        eprintln!(
            "For fmu-export/tests/sequences/main.rs:\n#[test]\nfn found() {{\n    from_bytes::sequence(&{bytes:?});\n}}"
        );
        std::panic::resume_unwind(panic);
    }
});
