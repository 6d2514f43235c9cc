//! The command `fmu` as Cargo runs it: `cargo fmu ...`.

#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    fmu::cli::main()
}
