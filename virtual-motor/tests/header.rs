//! The header in C and C++, its declarations against the Rust functions, and the example in C. Needs `cc` and `c++`.
#![allow(missing_docs)]

use std::fmt::Write as _;
use std::mem::{offset_of, size_of};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use virtual_motor::ErrorCode;
use virtual_motor::pool::{MOST, MotorId};
use virtual_motor::sensing::{AdcCounts, AdcSetup, EncoderCount, EncoderSetup, TerminalVoltages};
use virtual_motor::sensing::{LINK, LOW_SIDE, PHASES};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn compile(compiler: &str, arguments: &[&str], source: &Path) -> Output {
    let strict = ["-Wall", "-Wextra", "-pedantic", "-Werror", "-I"];
    let mut command = Command::new(compiler);
    command.args(strict).arg(root().join("include")).args(arguments).arg(source);
    command.output().unwrap_or_else(|e| panic!("{compiler}: {e}"))
}

#[track_caller]
fn compiles(compiler: &str, arguments: &[&str], source: &Path) {
    let output = compile(compiler, arguments, source);
    assert!(output.status.success(), "{compiler}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Type in C of a type in Rust, with `{}` in place of the name.
fn in_c(rust: &str) -> &'static str {
    match rust {
        "i32" => "int32_t {}",
        "u32" => "uint32_t {}",
        "f64" => "double {}",
        "usize" => "size_t {}",
        "MotorId" => "vm_motor {}",
        "*const c_char" => "const char *{}",
        "*mut c_char" => "char *{}",
        "*mut u32" => "uint32_t *{}",
        "*mut f64" => "double *{}",
        "*const [f64; 3]" => "const double {}[3]",
        "*mut MotorId" => "vm_motor *{}",
        "*mut AdcCounts" => "vm_adc_counts *{}",
        "*mut EncoderCount" => "vm_encoder_count *{}",
        "*mut TerminalVoltages" => "vm_terminal_voltages *{}",
        "*mut AdcSetup" => "vm_adc_setup *{}",
        "*const AdcSetup" => "const vm_adc_setup *{}",
        "*mut EncoderSetup" => "vm_encoder_setup *{}",
        "*const EncoderSetup" => "const vm_encoder_setup *{}",
        other => panic!("no type of C for {other}"),
    }
}

/// The exported functions: name and declaration in C.
fn exports() -> Vec<(String, String)> {
    let source = std::fs::read_to_string(root().join("src/abi/mod.rs")).unwrap();
    let functions = source.split("extern \"C\" fn ").skip(1).map(|rest| {
        let (name, rest) = rest.split_once('(').unwrap();
        let (arguments, rest) = rest.split_once(") -> ").unwrap();
        let result = rest.split_once(" {").unwrap().0;
        let one = |argument: &str| {
            let (name, of) = argument.trim().split_once(": ")?;
            Some(in_c(of).replace("{}", name))
        };
        let arguments: Vec<String> = arguments.split(',').filter_map(one).collect();
        let declared = in_c(result).replace("{}", name);
        (name.to_owned(), format!("{declared}({});", arguments.join(", ")))
    });
    let functions: Vec<_> = functions.collect();
    assert_eq!(functions.len(), source.matches("#[unsafe(no_mangle)]").count());
    functions
}

/// The header without comments.
fn header() -> String {
    let text = std::fs::read_to_string(root().join("include/virtual_motor.h")).unwrap();
    let parts: Vec<&str> = text.split("/*").collect();
    parts.iter().enumerate().map(|(k, part)| if k == 0 { part } else { part.split_once("*/").unwrap().1 }).collect()
}

#[test]
fn the_header_is_clean_in_c_and_in_cpp() {
    let source = scratch("only.c");
    std::fs::write(&source, "#include \"virtual_motor.h\"\n#include \"virtual_motor.h\"\nint unused;\n").unwrap();
    compiles("cc", &["-std=c99", "-fsyntax-only"], &source);
    compiles("cc", &["-std=c11", "-fsyntax-only"], &source);
    compiles("c++", &["-std=c++11", "-x", "c++", "-fsyntax-only"], &source);
}

/// A second declaration of a function, written from its Rust signature, compiles only if it is the same.
#[test]
fn the_declarations_are_those_of_the_rust_functions() {
    let exports = exports();
    assert!(exports.len() > 20, "{exports:?}");
    let declared = exports.iter().map(|(_, declaration)| declaration.as_str()).collect::<Vec<_>>().join("\n") + "\n";
    let source = scratch("declared.c");
    std::fs::write(&source, format!("#include \"virtual_motor.h\"\n{declared}")).unwrap();
    compiles("cc", &["-std=c99", "-fsyntax-only"], &source);
    // A wrong one does not.
    let wrong = declared.replace("double t, uint32_t gates", "float t, uint32_t gates");
    assert_ne!(wrong, declared);
    std::fs::write(&source, format!("#include \"virtual_motor.h\"\n{wrong}")).unwrap();
    assert!(!compile("cc", &["-std=c99", "-fsyntax-only"], &source).status.success());
    // Every function that the header declares is exported, and the other way round.
    let header = header();
    let mut in_header: Vec<&str> = header
        .match_indices('(')
        .filter_map(|(at, _)| header[..at].rsplit(|c: char| !c.is_alphanumeric() && c != '_').next())
        .filter(|name| name.starts_with("vm_"))
        .collect();
    let mut exported: Vec<&str> = exports.iter().map(|(name, _)| name.as_str()).collect();
    in_header.sort_unstable();
    exported.sort_unstable();
    assert_eq!(in_header, exported);
}

/// `NullPointer` as `VM_NULL_POINTER`.
fn constant(code: ErrorCode) -> String {
    let name = format!("{code:?}");
    let letter = |c: char| if c.is_uppercase() { format!("_{c}") } else { c.to_uppercase().to_string() };
    format!("VM{}", name.chars().map(letter).collect::<String>())
}

#[test]
fn structs_and_constants_are_those_of_rust() {
    let mut text = String::from("#include \"virtual_motor.h\"\n");
    let mut is = |what: &str, value: usize| {
        writeln!(text, "_Static_assert({what} == {value}, \"{what}\");").unwrap();
    };
    macro_rules! layout {
        ($($of:ty, $c:literal: $($field:ident),*;)*) => { $(
            is(concat!("sizeof(", $c, ")"), size_of::<$of>());
            $(is(concat!("offsetof(", $c, ", ", stringify!($field), ")"), offset_of!($of, $field));)*
        )* };
    }
    layout! {
        MotorId, "vm_motor": index, generation;
        AdcSetup, "vm_adc_setup": current_gain, current_offset, voltage_gain, voltage_offset, bits, sensors;
        AdcCounts, "vm_adc_counts": i, u_dc;
        EncoderSetup, "vm_encoder_setup": offset, counts;
        EncoderCount, "vm_encoder_count": count, turns, bits;
        TerminalVoltages, "vm_terminal_voltages": u, counts, upper, lower;
    }
    for (name, value) in [("VM_PHASES", PHASES), ("VM_LOW_SIDE", LOW_SIDE), ("VM_LINK", LINK)] {
        is(name, value as usize);
    }
    is("VM_MOTORS", MOST);
    is("VM_OK", 0);
    for &code in ErrorCode::ALL {
        is(&constant(code), usize::try_from(code as i32).unwrap());
    }
    for (bit, name) in ["A_UPPER", "A_LOWER", "B_UPPER", "B_LOWER", "C_UPPER", "C_LOWER"].iter().enumerate() {
        is(&format!("VM_GATE_{name}"), 1 << bit);
    }
    let source = scratch("layout.c");
    std::fs::write(&source, &text).unwrap();
    compiles("cc", &["-std=c11", "-fsyntax-only"], &source);
    let header = header();
    let codes = header.split_once("VM_OK").unwrap().1.split_once('}').unwrap().0;
    assert_eq!(codes.matches("VM_").count(), ErrorCode::ALL.len(), "{codes}");
}

/// The library in C beside this test's program.
fn library() -> PathBuf {
    let program = std::env::current_exe().unwrap();
    let library = program.with_file_name("libvirtual_motor.a");
    assert!(library.is_file(), "{}", library.display());
    library
}

/// Compiles these sources with the library and runs the program, in the folder of the workspace; returns what it prints.
fn run(name: &str, sources: &[&Path]) -> String {
    let (program, library) = (scratch(name), library());
    // The library follows the sources that need it.
    let mut command = Command::new("cc");
    command.args(["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]);
    command.arg("-I").arg(root().join("include")).arg("-I").arg(root().join("tests"));
    command.args(sources).arg(library).args(["-lm", "-lpthread", "-ldl", "-o"]).arg(&program);
    let compiled = command.output().unwrap();
    assert!(compiled.status.success(), "{name}: {}", String::from_utf8_lossy(&compiled.stderr));
    let run = Command::new(program).current_dir(root().join("..")).output().unwrap();
    let text = String::from_utf8(run.stdout).unwrap();
    assert!(run.status.success(), "{name}: {text}{}", String::from_utf8_lossy(&run.stderr));
    text
}

/// The programs of the documentation, by the names in their first lines.
#[test]
fn the_programs_of_the_page_run() {
    let page = std::fs::read_to_string(root().join("../docs/virtual-motor.md")).unwrap();
    let mut names = Vec::new();
    for block in page.split("```c\n").skip(1) {
        let code = block.split_once("```").unwrap().0;
        let name = code.strip_prefix("/* ").unwrap().split_once(" */").unwrap().0;
        std::fs::write(scratch(name), code).unwrap();
        names.push(name);
    }
    assert_eq!(names, ["spin.c", "host.c"]);
    let text = run("spin", &[&scratch("spin.c")]);
    let lines: Vec<Vec<u32>> = text.lines().map(|line| line.split(' ').map(|x| x.parse().unwrap()).collect()).collect();
    // No current and the angle 0 at first; then 3.25 V over 2 Ohm in phase b, 182 counts per A.
    assert_eq!((lines.len(), &lines[0][..]), (5, &[2048, 2048, 0][..]));
    assert!(lines[4][1].abs_diff(2048 + 296) < 12 && lines[4][2] > 100, "{text}");
    assert_eq!(run("host", &[&scratch("host.c"), &root().join("tests/firmware.c")]), "");
}

#[test]
fn the_foc_loop_reaches_its_speed() {
    let text = run("foc", &[&root().join("examples/foc.c")]);
    let after = |what: &str| -> f64 {
        let rest = text.split_once(what).unwrap_or_else(|| panic!("{what}: {text}")).1.trim_start();
        rest.split(' ').next().unwrap().parse().unwrap()
    };
    let (lowest, mean) = (after("lowest speed under load"), after("mean of the last 0.1 s"));
    assert!((mean - 1000.0).abs() < 1.0, "{text}");
    assert!((900.0..930.0).contains(&lowest), "the load brakes the shaft: {text}");
    // 1 N.m, 2e-4 N.m.s/rad and 0.03 N.m of friction over 0.675 N.m/A.
    let last = text.rsplit_once("i_q = ").unwrap().1;
    let i_q: f64 = last.split(' ').next().unwrap().parse().unwrap();
    assert!((i_q - 1.556).abs() < 0.08, "{text}");
}
