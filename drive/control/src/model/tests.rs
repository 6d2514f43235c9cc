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

/// One shunt is read under the voltage that the estimators take as applied since the last sample: an offset shows its largest phase.
#[test]
fn one_shunt_is_read_under_the_applied_voltage() {
    for delay in 0..3 {
        let mut controller = SensorlessController::default();
        let par = &mut controller.parameters;
        (par.delay, par.sensor.phases, par.sensor.offset.a) = (delay, MeasuredPhases::One, 0.1);
        controller.inputs.u_dc = 300.0;
        controller.state.shown.enabled = true;
        for (command, angle) in controller.state.commands.iter_mut().zip([0.1, 2.2, 4.3_f64]) {
            command.u = drive_base::frame::AlphaBeta::new(90.0 * angle.cos(), 90.0 * angle.sin());
        }
        controller.read_shunt();
        let largest = |Phases { a, b, c }: Phases| {
            let i = [a, b, c];
            (0..3).max_by(|&x, &y| i[x].total_cmp(&i[y]))
        };
        let (seen, applied) = (controller.shunt.currents(), Phases::from_stator(controller.measure().u));
        assert!((seen.a.max(seen.b).max(seen.c) - 0.1).abs() < 1e-12, "{seen:?}");
        assert_eq!(
            (largest(seen), largest(seen)),
            (largest(applied), usize::try_from(delay).ok()),
            "{seen:?} {applied:?}"
        );
    }
}
