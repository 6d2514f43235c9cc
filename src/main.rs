//! The command `fmu`.

#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    fmu::cli::main()
}
