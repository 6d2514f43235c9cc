//! The first character of a file.

use super::*;

#[test]
fn has_the_value_of_the_original() {
    for version in BOTH {
        let fmu = archive("resource", version);
        for method in [Method::default(), exchange()] {
            let recording = run(method, &fmu, &[], 1.0, 1.0);
            assert_eq!(
                (recording.time.clone(), column(&recording, "y")),
                (vec![0.0, 1.0], vec![97.0; 2]),
                "{version:?}"
            );
        }
        assert_eq!(fmpy(&fmu, "stop_time=1, output_interval=1"), [vec![0.0, 1.0], vec![97.0; 2]], "FMPy, {version:?}");
    }
}
