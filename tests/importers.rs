//! The packed pair in importers other than FMPy: Ecos, libcosim, an fmucontainer, and on demand fmi-sim and rust-fmi.
//! Each runs a start-up and a load step, and is compared with the native run of the same exchange order.
#![allow(missing_docs)]

mod common;

use common::importers;
use common::python::{pytest, scratch};
use std::{fs, process};

#[test]
fn ecos_libcosim_and_fmucontainer() {
    let file = scratch().join(format!("importers-{}.json", process::id()));
    fs::write(&file, importers::references().to_string()).expect("a file below the target folder");
    let files = ["test_ecos.py", "test_libcosim.py", "test_fmucontainer.py"];
    pytest("importers", "importers", &files, &[("FMU_REFERENCE", &file)]);
}
