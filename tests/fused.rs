//! No FMU has a fused multiply-add, which rounds once where others round twice: its disassembly shows none.
//!
//! `fma` of the compiler's library is allowed: it is one such instruction where the processor has it, and gives the same bits by other
//! instructions where it does not.
#![allow(missing_docs)]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

mod common;

use fmu_import::contents;
use std::process::Command;

/// The instructions that multiply and add, each after the one before it and with the one behind it. A disassembly pads with `int3`
/// and `nop` between functions.
fn fused(instructions: &[&str]) -> Vec<String> {
    let fused = |name: &str| ["vfmadd", "vfmsub", "vfnmadd", "vfnmsub"].iter().any(|start| name.starts_with(start));
    let alone =
        |three: &[&str]| (three[0].starts_with("int3") || three[0].starts_with("nop")) && three[2].starts_with("ret");
    instructions.windows(3).filter(|three| fused(three[1]) && !alone(three)).map(|three| three.join("; ")).collect()
}

#[test]
fn no_fmu_multiplies_and_adds_in_one() {
    if Command::new("objdump").arg("--version").output().is_err() {
        println!("skipped: there is no objdump (apt install binutils)");
        return;
    }
    let mut binaries = 0;
    for standard in ["fmi2", "fmi3"] {
        for entry in std::fs::read_dir(common::archives().join(standard)).unwrap() {
            let archive = entry.unwrap().path();
            let (_, files) = contents(&archive).unwrap();
            let linux =
                |name: &&String| name.starts_with("binaries/linux64/") || name.starts_with("binaries/x86_64-linux/");
            let name = files.keys().find(linux).unwrap();
            let binary = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(&binary, &files[name]).unwrap();
            let output =
                Command::new("objdump").args(["-d", "--no-show-raw-insn"]).arg(binary.path()).output().unwrap();
            let text = String::from_utf8_lossy(&output.stdout);
            let instructions: Vec<&str> =
                text.lines().filter_map(|line| line.split_once(":\t")).map(|(_, x)| x).collect();
            assert!(instructions.len() > 100_000, "{}: {} instructions", archive.display(), instructions.len());
            let found = fused(&instructions);
            assert!(found.is_empty(), "{}: {found:#?}", archive.display());
            binaries += 1;
        }
    }
    assert!(binaries > 10, "{binaries} binaries");
}

#[test]
fn it_would_be_found() {
    let alone = ["int3", "vfmadd213sd %xmm2,%xmm1,%xmm0", "ret", "int3"];
    assert!(fused(&alone).is_empty());
    for inside in ["vfmadd213sd %xmm2,%xmm1,%xmm0", "vfnmsub231pd %ymm2,%ymm1,%ymm0"] {
        assert_eq!(fused(&["mulsd %xmm1,%xmm0", inside, "ret"]).len(), 1);
    }
}
