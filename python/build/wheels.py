"""Writes the wheels of `fmurun` for all platforms that can be built here, and the source distribution.

    python python/build/wheels.py --archives DIR --out DIR

DIR of the archives has fmi2/ and fmi3/ of `fmu build`; every wheel has these archives, so build them with a binary for each platform
(`fmu build --release-dir` does both). This needs maturin and ziglang (pip install maturin==1.16.0 ziglang==0.17.1), Rust's standard library
for each target, and mingw for Windows. If something is missing, a message says so and that wheel is omitted. Prints only the
paths of the files.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import fmurun_build

# Name of the wheel's platform, target of maturin, targets of Rust, options.
ZIG = ["--zig", "--compatibility", "manylinux_2_17"]
WHEELS = [
    ("Linux x86_64", "x86_64-unknown-linux-gnu", ["x86_64-unknown-linux-gnu"], ZIG),
    ("Linux aarch64", "aarch64-unknown-linux-gnu", ["aarch64-unknown-linux-gnu"], ZIG),
    ("Windows x86_64", "x86_64-pc-windows-gnu", ["x86_64-pc-windows-gnu"], []),
    ("macOS universal2", "universal2-apple-darwin", ["x86_64-apple-darwin", "aarch64-apple-darwin"], ["--zig"]),
]


def missing(targets):
    """The targets without a standard library of Rust."""
    ask = lambda target: subprocess.run(["rustc", "--print", "target-libdir", "--target", target], capture_output=True, text=True).stdout
    return [target for target in targets if not any(Path(ask(target).strip() or "/nothing").glob("libstd-*"))]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--archives", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    os.environ["FMURUN_ARCHIVES"] = str(args.archives.resolve())
    package, out = Path(__file__).resolve().parents[1], args.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    fmurun_build._drives()
    before, failed = set(out.iterdir()), []
    for name, target, targets, options in WHEELS:
        lacks = missing(targets)
        if lacks:
            print(f"left out: the wheel for {name}: no standard library for {', '.join(lacks)}: rustup target add {' '.join(lacks)}",
                  file=sys.stderr)  # fmt: skip
            continue
        command = [sys.executable, "-m", "maturin", "build", "--quiet", "--release", "--locked", "--target", target, *options, "--out", out]
        if subprocess.run(command, cwd=package, check=False, stdout=sys.stderr).returncode:
            failed.append(name)
    if subprocess.run([sys.executable, "-m", "maturin", "sdist", "--out", out], cwd=package, check=False, stdout=sys.stderr).returncode:
        failed.append("the source distribution")
    for path in sorted(set(out.iterdir()) - before):
        print(path)
    if failed:
        sys.exit(f"not built: {', '.join(failed)}")


if __name__ == "__main__":
    main()
