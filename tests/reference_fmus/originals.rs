//! The originals in C and the rewrites, in one importer.

use super::*;

/// Runs two FMUs in FMPy and compares the bits of all outputs of the first one; prints the number of rows.
const COMPARED: &str = "import sys, fmpy\n\
    one, other = (eval('fmpy.simulate_fmu(file, ' + sys.argv[3] + ')', {'fmpy': fmpy, 'file': f}) for f in sys.argv[1:3])\n\
    assert len(one) == len(other), (len(one), len(other))\n\
    for name in one.dtype.names:\n    assert one[name].tobytes() == other[name].tobytes(), name\n\
    print(len(one))\n";

const EULER: &str = "fmi_type='ModelExchange', solver='Euler'";
const CVODE: &str = "fmi_type='ModelExchange', solver='CVode'";
const STIFF: &str =
    "fmi_type='ModelExchange', start_time=1e-5, stop_time=40, output_interval=0.4, relative_tolerance=1e-8";

#[test]
#[ignore = "needs the originals as FOLDER/fmi2/*.fmu and FOLDER/fmi3/*.fmu, and takes half a minute: \
            FMU_ORIGINALS=FOLDER cargo test --test reference_fmus originals -- --ignored --nocapture"]
fn they_have_the_same_bits_as_the_originals() {
    let folder = PathBuf::from(std::env::var_os("FMU_ORIGINALS").expect("FMU_ORIGINALS names a folder"));
    let mut rows = 0;
    for package in
        ["bouncing-ball", "dahlquist", "feedthrough", "resource", "roberts", "stair", "state-space", "van-der-pol"]
    {
        let runs: &[&str] = if package == "roberts" { &[STIFF] } else { &["fmi_type='CoSimulation'", EULER, CVODE] };
        for rewrite in packed(package) {
            let original = folder.join(rewrite.strip_prefix(archives()).unwrap());
            if !original.exists() {
                println!("{} is not there", original.display());
                continue;
            }
            for run in runs {
                let said = script(COMPARED, &[&original, &rewrite, Path::new(run)]);
                println!("{package}, {}: {run}: {} rows", original.display(), said.trim());
                rows += said.trim().parse::<usize>().unwrap();
            }
        }
    }
    assert!(rows > 5000, "{rows} rows");
}
