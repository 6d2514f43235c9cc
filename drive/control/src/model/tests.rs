use super::*;

/// The mean reading of the sensors without current is subtracted from later readings, provided that no current flows in a
/// short circuit.
#[test]
fn a_calibrated_sensor_has_no_offset() {
    for asc in [false, true] {
        let mut controller = SensorlessController::default();
        let par = &mut controller.parameters;
        par.compensation.calibrate = true;
        par.sensor.offset = Phases { a: 0.3, b: -0.2, c: 0.05 };
        controller.derive();
        controller.initialize();
        (controller.inputs.enable, controller.inputs.asc) = (false, asc);
        (0..500).for_each(|_| controller.compute());
        controller.inputs.i = Phases { a: 2.0, b: -3.0, c: 1.0 };
        let Phases { a, b, c } = controller.currents();
        let expected = if asc { [2.3, -3.2, 1.05] } else { [2.0, -3.0, 1.0] };
        for (i, expected) in [a, b, c].into_iter().zip(expected) {
            assert!((i - expected).abs() < 1e-12, "{i} A, not {expected} A, asc {asc}");
        }
    }
}
