//! One archive for three platforms, run on all of them from one Linux machine on x86_64: Windows through Wine, 64-bit ARM
//! through QEMU. Its requirements are in CONTRIBUTING.md; missing ones are printed, one per line.
#![allow(missing_docs)]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

use fmu::commands::build::{self, Models};
use fmu_check as check;
use fmu_import as importer;
use fmu_import::platform::Platform;
use fmu_pack::target::{ZIG, find};
use model_description::ModelDescription;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const TARGETS: [&str; 3] = ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu", "x86_64-pc-windows-gnu"];
const PLATFORMS: [Platform; 3] = [Platform::X64Linux, Platform::ArmLinux, Platform::X64Windows];
/// Root of the C library for 64-bit ARM.
const ARM: &str = "/usr/aarch64-linux-gnu";

/// Programs that run the binaries.
struct Machines {
    wine: PathBuf,
    qemu: PathBuf,
}

impl Machines {
    fn find() -> Self {
        // Debian keeps it out of the way.
        let debian = Some(PathBuf::from("/usr/lib/wine/wine64")).filter(|path| path.is_file());
        let wine = find("wine64").or(debian).or_else(|| find("wine"));
        let qemu = find("qemu-aarch64-static").or_else(|| find("qemu-aarch64"));
        let library = Path::new(ARM).join("lib/libc.so.6").is_file();
        let mut missing = Vec::new();
        let mut need = |there: bool, what: &str| {
            if !there {
                missing.push(format!("missing: {what}"));
            }
        };
        need(find("cc").is_some(), "cc: apt install gcc");
        need(find("cargo-zigbuild").is_some(), &format!("cargo-zigbuild: {ZIG}"));
        let mingw = "x86_64-w64-mingw32-gcc";
        need(find(mingw).is_some(), &format!("{mingw}: apt install gcc-mingw-w64-x86-64-win32"));
        need(wine.is_some(), "wine64: apt install wine64");
        need(qemu.is_some(), "qemu-aarch64-static: apt install qemu-user-static");
        need(library, &format!("{ARM}/lib/libc.so.6: apt install libc6-arm64-cross libgcc-s1-arm64-cross"));
        assert!(missing.is_empty(), "\n{}\n", missing.join("\n"));
        Self { wine: wine.unwrap_or_default(), qemu: qemu.unwrap_or_default() }
    }

    /// The loader in this folder, compiled for a platform.
    fn loader(platform: Platform, folder: &Path) -> PathBuf {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/platforms/loader.c");
        let loader = folder.join(if platform == Platform::X64Windows { "loader.exe" } else { "loader" });
        let mut compiler = match platform {
            Platform::X64Windows => Command::new("x86_64-w64-mingw32-gcc"),
            Platform::ArmLinux => {
                let mut zig = Command::new("cargo-zigbuild");
                zig.args(["zig", "cc", "--", "-target", "aarch64-linux-gnu.2.17"]);
                zig
            }
            _ => Command::new("cc"),
        };
        compiler.args(["-Wall", "-o"]).arg(&loader).arg(source);
        if platform != Platform::X64Windows {
            compiler.arg("-ldl");
        }
        said(&mut compiler);
        loader
    }

    /// The output of the loader.
    fn run(&self, platform: Platform, loader: &Path, arguments: &[String]) -> String {
        let mut command = match platform {
            Platform::X64Windows => Command::new(&self.wine),
            Platform::ArmLinux => {
                let mut qemu = Command::new(&self.qemu);
                qemu.args(["-L", ARM]);
                qemu
            }
            _ => Command::new(loader),
        };
        if platform != Platform::X64Linux {
            command.arg(loader);
        }
        // A separate Windows prefix, kept for the next run.
        command.env("WINEPREFIX", Path::new(env!("CARGO_TARGET_TMPDIR")).join("wine"));
        command.env("WINEDEBUG", "-all").env("WINEDLLOVERRIDES", "mscoree,mshtml=");
        command.args(arguments).current_dir(loader.parent().unwrap());
        said(&mut command)
    }
}

/// Standard output, with the line ends of Unix, of a command that succeeds without a panic.
fn said(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let [out, error] = [output.stdout, output.stderr].map(|b| String::from_utf8_lossy(&b).replace("\r\n", "\n"));
    assert!(output.status.success(), "{command:?}: {}\n{out}{error}", output.status);
    assert!(!error.contains("panicked"), "{command:?}: {error}");
    out
}

/// Archives of the FMU for the three platforms, FMI 2.0 and FMI 3.0.
fn archives(what: Models, out: &Path) -> Vec<PathBuf> {
    let target = TARGETS.map(String::from).to_vec();
    build::models(&Models { target, out: Some(out.into()), ..what }).unwrap_or_else(|e| panic!("{e:#}"))
}

/// Runs the binaries of one archive; returns what each printed.
fn everywhere(archive: &Path, dir: &Path, arguments: impl Fn(&ModelDescription) -> Vec<String>) -> [String; 3] {
    let machines = Machines::find();
    let (md, files) = importer::contents(archive).unwrap();
    let standard = md.version.to_string()[..1].to_owned();
    PLATFORMS.map(|platform| {
        let folder = dir.join(format!("{standard}-{platform}"));
        fs::create_dir_all(&folder).unwrap();
        let library = format!("{}.{}", md.model_name, platform.extension());
        let name = format!("binaries/{}/{library}", platform.folders(md.version)[0]);
        let bytes = files.get(&name).unwrap_or_else(|| panic!("{} has no {name}", archive.display()));
        fs::write(folder.join(&library), bytes).unwrap();
        let loader = Machines::loader(platform, &folder);
        let first = [format!("./{library}"), standard.clone(), md.token.clone()];
        machines.run(platform, &loader, &[&first[..], &arguments(&md)].concat())
    })
}

fn reference(md: &ModelDescription, name: &str) -> String {
    let variable = md.variables.iter().find(|v| v.name == name);
    variable.unwrap_or_else(|| panic!("no {name}")).value_reference.to_string()
}

/// Every rule about archive and binaries is met for each platform.
fn checked(archive: &Path) {
    let program = Some(PathBuf::from(env!("CARGO_BIN_EXE_fmu")));
    let options = check::Options { only: vec!["archive".into(), "binary".into()], program, ..Default::default() };
    let report = check::run(archive, &options).unwrap();
    assert_eq!(report.violated().count(), 0, "{}", report.text(false));
}

#[test]
#[ignore = "needs Wine, mingw, QEMU and zig: see CONTRIBUTING.md"]
fn the_drive_has_the_same_states_on_three_platforms() {
    let _ = Machines::find();
    let dir = tempfile::tempdir().unwrap();
    let drive = Models { fmus: vec!["PmsmDrive".into()], ..Models::default() };
    let mut all = Vec::new();
    for archive in archives(drive, dir.path()) {
        let size = fs::metadata(&archive).unwrap().len();
        println!("{}: {size} bytes", archive.strip_prefix(dir.path()).unwrap().display());
        checked(&archive);
        all.extend(everywhere(&archive, dir.path(), |md| {
            let names = ["speed_ref", "tau_load", "speed", "theta_e", "i_d", "i_q", "speed_est", "theta_est", "u_a"];
            ["run".to_owned()].into_iter().chain(names.map(|name| reference(md, name))).collect()
        }));
    }
    let [first, rest @ ..] = &all[..] else { panic!("no archive") };
    let last = first.rsplit("t = ").next().unwrap();
    println!("x86_64-linux at t = {last}");
    // The hash of the state is of a state that moves, and the drive follows its reference.
    let states: Vec<&str> = first.lines().filter(|line| line.contains("state of")).collect();
    assert!(states.len() == 10 && states.windows(2).all(|w| w[0] != w[1]), "{first}");
    let speed: f64 = last.lines().nth(1).and_then(|l| l.split_whitespace().nth(1)).unwrap().parse().unwrap();
    assert!((speed - 104.72).abs() < 0.5, "{speed} rad/s");
    for (other, what) in
        rest.iter().zip(["aarch64, FMI 2", "Windows, FMI 2", "x86_64, FMI 3", "aarch64, FMI 3", "Windows, FMI 3"])
    {
        assert_eq!(other, first, "{what}");
        println!("{what}: the same {} lines", other.lines().count());
    }
    assert!(all.iter().all(|one| one == first) && all.len() == 6);
}

#[test]
#[ignore = "needs Wine, mingw, QEMU and zig: see CONTRIBUTING.md"]
fn an_error_and_a_panic_are_a_status_on_three_platforms() {
    let _ = Machines::find();
    let dir = tempfile::tempdir().unwrap();
    for archive in archives(Models { package: vec!["faulty-fmu".into()], ..Models::default() }, dir.path()) {
        let answers = everywhere(&archive, dir.path(), |md| {
            // The values of mode: see fmu-export/tests/common/model.rs.
            ["fault", &reference(md, "mode"), "2", "4"].map(String::from).to_vec()
        });
        println!("{}", answers[0]);
        for answer in &answers {
            assert_eq!(answer, &answers[0]);
            let printed: Vec<&str> = answer.lines().filter(|line| !line.starts_with("  ")).collect();
            let mode = |value, status| {
                let first = format!("mode {value}: DoStep returned {status}");
                [first, "again: DoStep returned 3".into(), "after Reset: DoStep returned 0".into()]
            };
            assert_eq!(printed, [&mode(2, 3)[..], &mode(4, 3), &["end".into()]].concat());
        }
    }
}
