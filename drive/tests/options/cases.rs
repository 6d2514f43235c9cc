//! The options, and the runs that show their effect.

use super::{RATED, SLOW, T_S, U_DEAD, command, drive, imposed, off, run, turning};
use drive::Pair;
use drive::control::commission::{CommissionState, Identified};
use drive::control::commissioning::CommissionMode;
use drive::control::position::PositionSensor;
use drive::control::reference::{max_torque, max_torque_per_ampere};
use drive::control::sensor::MeasuredPhases;
use drive::control::start::StartMode;
use drive::control::tables::ControllerParameters as Par;
use drive::control::trip::Cause;
use drive::estimator::pulsating::Demodulation;
use drive::estimator::tracker::TrackerKind;
use drive::estimator::{Class, Kind};
use drive::math::wrap;
use drive::modulation::PwmUpdate;
use drive::motor::Motor;
use drive_base::overmodulation::ModulationMode;
use std::f64::consts::TAU;

/// Figures of a run that an option changes.
pub(super) type Figures = [f64; 2];

/// An option.
pub(super) struct Case {
    /// Name in the table.
    pub(super) option: &'static str,
    /// A drive in which the option has an effect.
    pub(super) on: fn(Kind) -> Pair,
    /// Turns it on.
    pub(super) ask: fn(&mut Par),
    /// Runs the drive.
    pub(super) figures: fn(Pair) -> Figures,
    /// Whether the figures without and with it are as expected.
    pub(super) acts: fn(Kind, Figures, Figures) -> bool,
}

/// Field weakening, with what some estimators need for it.
fn weaken(p: &mut Par) {
    p.weakening.used = true;
    if p.estimator == Kind::VoltageModel {
        (p.limit.i, p.limit.i_q) = (10.5, 10.5);
    }
    if p.estimator == Kind::VoltageFeedback {
        (p.weakening.k_u, p.weakening.k_t) = (0.9, 0.9);
    }
}

/// Integral in A.s of the error of i_q after a step of the torque, with a wrong resistance in the controller.
fn current_error(mut pair: Pair) -> Figures {
    pair.plant.model.parameters.motor.R_s *= 1.5;
    let mut sum = 0.0;
    run(&mut pair, 0.4, |t, p| {
        p.controller.model.inputs.tau_ref = if t > 0.2 { 7.0 } else { 0.0 };
        sum += T_S * (p.controller.out.i_ref.q - p.controller.out.i.q);
    });
    [sum.abs(), 0.0]
}

/// The references after a request of 10 N.m, and the maximum torque.
fn references(mut pair: Pair) -> Figures {
    pair.controller.model.inputs.tau_ref = 10.0;
    run(&mut pair, 0.1, |_, _| ());
    [pair.controller.out.i_ref.d, pair.controller.out.tau_max]
}

/// Whether a link of 600 V trips, and whether the machine is short-circuited once the link has lost its voltage.
fn over_voltage(mut pair: Pair) -> Figures {
    run(&mut pair, 0.1, |t, p| {
        let u_dc = match t {
            ..0.05 => 540.0,
            ..0.08 => 600.0,
            _ => 5.0,
        };
        p.set_inputs(SLOW, 0.0, u_dc);
    });
    let out = &pair.controller.out;
    [f64::from(u8::from(out.tripped == Cause::OverVoltage)), f64::from(u8::from(out.short_circuit))]
}

/// Whether `commission_start` starts something, and whether the gates switch 10 ms later.
fn commissioned(mut pair: Pair) -> Figures {
    pair.controller.model.inputs.commission_start = true;
    run(&mut pair, 0.01, |_, _| ());
    let out = &pair.controller.out;
    [f64::from(u8::from(out.commission_state != CommissionState::Idle)), f64::from(u8::from(out.enabled))]
}

/// The found resistance in Ohm, and its half-width as a share.
fn found_resistance(mut pair: Pair) -> Figures {
    pair.controller.model.inputs.commission_start = true;
    run(&mut pair, 20.0, |_, _| ());
    let Identified { value, u } = pair.controller.model.commissioning_mut().as_ref().unwrap().shown().R_s;
    [value, u]
}

/// Whether these figures are yes (1) or no (0) as expected.
fn are(figures: Figures, expected: [bool; 2]) -> bool {
    figures.map(|x| x > 0.5) == expected
}

/// Mean angle error in degrees, and estimate, after a load step of 7 N.m.
fn after_load(mut pair: Pair) -> Figures {
    let (mut sum, mut n) = (0.0, 0.0);
    run(&mut pair, 1.0, |t, p| {
        p.plant.model.inputs.tau_load = if t > 0.3 { 7.0 } else { 0.0 };
        if t > 0.3 {
            (sum, n) = (sum + off(p), n + 1.0);
        }
    });
    [sum / n, pair.controller.out.theta_est]
}

/// Mean torque in N.m under a request of 3 N.m, and its component at the electrical frequency.
fn ripple(mut pair: Pair) -> Figures {
    let w = 3.0 * pair.plant.model.parameters.initial.speed;
    let (mut mean, mut sine, mut cosine, mut n) = (0.0, 0.0, 0.0, 0.0);
    pair.controller.model.inputs.tau_ref = 3.0;
    run(&mut pair, 0.3 + 2.0 * TAU / w, |t, p| {
        if t > 0.3 {
            let tau = p.plant.out.tau_e;
            (mean, sine, cosine, n) = (mean + tau, sine + tau * (w * t).sin(), cosine + tau * (w * t).cos(), n + 1.0);
        }
    });
    [mean / n, 2.0 * sine.hypot(cosine) / n]
}

/// i_d reference in A after 0.4 s of a start from an unknown angle, and the angle error in degrees at the end.
fn start(mut pair: Pair) -> Figures {
    pair.plant.model.parameters.initial.theta_e = 3.2;
    let mut i_d = 0.0;
    run(&mut pair, 3.0, |t, p| {
        p.controller.model.inputs.speed_ref = if t > 1.0 { 0.3 * RATED } else { 0.0 };
        if t < 0.4 {
            i_d = p.controller.out.i_ref.d;
        }
    });
    [i_d, off(&pair)]
}

/// R^ in Ohm at rest, and i_q (A) there, under a load of 2 N.m.
fn at_rest(mut pair: Pair) -> Figures {
    run(&mut pair, 4.0, |t, p| p.plant.model.inputs.tau_load = 2.0 * t.min(1.0));
    [pair.controller.out.R_s_est, pair.controller.out.i.q]
}

fn slow(kind: Kind) -> Pair {
    imposed(drive(kind), SLOW)
}

fn loaded(kind: Kind) -> Pair {
    turning(drive(kind), 2.0 * SLOW)
}

fn with_dead_time(mut pair: Pair) -> Pair {
    pair.plant.model.parameters.inverter.dead_time = 2e-6;
    pair
}

pub(super) const CASES: &[Case] = &[
    Case {
        option: "current.active_resistance",
        on: slow,
        ask: |p| p.current.active_resistance = true,
        figures: current_error,
        // The error over w_c, regardless of the resistance; without it, 1.5 times as much from the wrong one.
        acts: |_, [without, _], [with, _]| {
            let expected = 7.0 / Motor::IPMSM_2_2_KW.torque_constant() / (TAU * 200.0);
            (with / expected - 1.0).abs() < 0.1 && without > 1.4 * expected
        },
    },
    Case {
        option: "current.integral",
        on: slow,
        ask: |p| p.current.integral = 1.0,
        figures: current_error,
        acts: |_, [without, _], [with, _]| with < 0.6 * without,
    },
    Case {
        option: "current.reference_feed_forward",
        on: slow,
        // The command of the sample of the request.
        figures: |mut pair| {
            run(&mut pair, 0.1, |t, p| p.controller.model.inputs.tau_ref = if t > 0.09985 { 5.0 } else { 0.0 });
            [command(&pair).alpha(), command(&pair).beta()]
        },
        ask: |p| p.current.reference_feed_forward = !p.current.reference_feed_forward,
        // |R + j w L_q| times the change of i_q.
        acts: |_, without, with| {
            let change = (with[0] - without[0]).hypot(with[1] - without[1]);
            let expected = 3.6_f64.hypot(3.0 * SLOW * 51e-3) * 5.0 / Motor::IPMSM_2_2_KW.torque_constant();
            (change / expected - 1.0).abs() < 0.2
        },
    },
    Case {
        option: "current.mtpa",
        on: slow,
        ask: |p| p.current.mtpa = true,
        figures: references,
        acts: |kind, [i_d, least], [by_mtpa, most]| {
            let par = drive(kind).controller.model.parameters;
            let expected = max_torque_per_ampere(&par.motor, 10.0).d();
            let tau = |mtpa| max_torque(&par.motor, &par.limit, mtpa);
            i_d.abs() < 1e-4
                && (by_mtpa / expected - 1.0).abs() < 1e-3
                && (least / tau(false) - 1.0).abs() < 1e-5
                && (most / tau(true) - 1.0).abs() < 1e-5
        },
    },
    Case {
        option: "speed_loop.torque_mode",
        on: |kind| {
            let mut pair = slow(kind);
            pair.controller.model.parameters.speed_loop.torque_mode = false;
            pair
        },
        ask: |p| p.speed_loop.torque_mode = true,
        figures: ripple,
        acts: |_, [by_speed, _], [by_torque, _]| by_speed.abs() < 1.0 && (by_torque - 3.0).abs() < 0.15,
    },
    Case {
        option: "speed_loop.ramp",
        on: |kind| turning(drive(kind), SLOW),
        ask: |p| p.speed_loop.ramp = 50.0,
        figures: |mut pair| {
            pair.controller.model.inputs.speed_ref = 2.0 * SLOW;
            run(&mut pair, 0.05, |_, _| ());
            [pair.plant.out.speed - SLOW, 0.0]
        },
        acts: |_, [at_once, _], [ramped, _]| at_once > 5.0 && ramped < 3.0 && ramped > 0.3,
    },
    Case {
        option: "weakening.use",
        on: |kind| imposed(drive(kind), RATED),
        ask: weaken,
        figures: |mut pair| {
            pair.controller.model.inputs.tau_ref = 24.0;
            run(&mut pair, 0.3, |_, _| ());
            [pair.controller.out.i_ref.d, pair.controller.out.tau_max]
        },
        acts: |_, [i_d, most], [weakened, less]| i_d.abs() < 1e-4 && weakened < -1.0 && less < most,
    },
    // A share of 0.9 of six-step is below u_dc/sqrt(3): VoltageFeedback has no more.
    Case {
        option: "modulation.mode",
        on: |kind| {
            let mut pair = imposed(drive(kind), RATED);
            if kind.class() != Class::Injection {
                weaken(&mut pair.controller.model.parameters);
            }
            pair
        },
        ask: |p| p.modulation.mode = ModulationMode::SixStep,
        figures: |mut pair| {
            pair.controller.model.inputs.tau_ref = 24.0;
            run(&mut pair, 0.3, |_, _| ());
            [pair.controller.out.tau_max, 0.0]
        },
        acts: |_, [linear, _], [six_step, _]| six_step > 1.03 * linear,
    },
    Case {
        option: "compensation.u_dead",
        on: |kind| with_dead_time(slow(kind)),
        ask: |p| p.compensation.u_dead = U_DEAD,
        // The PI controller has to supply the voltage that the legs lose.
        figures: |mut pair| {
            let (mut sum, mut n) = (0.0, 0.0);
            pair.controller.model.inputs.tau_ref = 5.0;
            run(&mut pair, 0.6, |t, p| {
                if t > 0.3 {
                    (sum, n) = (sum + p.controller.out.u_share, n + 1.0);
                }
            });
            [sum / n, 0.0]
        },
        acts: |_, [without, _], [with, _]| with < without - 0.02,
    },
    Case {
        option: "compensation.observe",
        on: |kind| {
            let mut pair = with_dead_time(slow(kind));
            pair.controller.model.parameters.compensation.u_dead = U_DEAD;
            pair
        },
        ask: |p| p.compensation.observe = true,
        // The voltage that estimators and lock_lost use as the machine's voltage.
        figures: |mut pair| {
            let (mut sum, mut n) = (0.0, 0.0);
            pair.controller.model.inputs.tau_ref = 0.2;
            run(&mut pair, 0.6, |t, p| {
                if t > 0.3 {
                    (sum, n) = (sum + p.controller.out.lock_lost, n + 1.0);
                }
            });
            [sum / n, 0.0]
        },
        // A carrier that crosses zero within a sample causes an error.
        acts: |kind, [without, _], [with, _]| {
            with < without || kind.class().injects() && with < 0.2 && (with - without).abs() > 0.0
        },
    },
    Case {
        option: "compensation.calibrate",
        on: |kind| {
            let mut pair = slow(kind);
            pair.controller.model.parameters.sensor.offset.a = 0.3;
            pair.controller.model.parameters.theta_est = wrap(3.0 * SLOW * 0.05);
            pair
        },
        ask: |p| p.compensation.calibrate = true,
        figures: |mut pair| {
            let w = 3.0 * SLOW;
            let (mut sine, mut cosine, mut n) = (0.0, 0.0, 0.0);
            (pair.controller.model.inputs.enable, pair.controller.model.inputs.tau_ref) = (false, 3.0);
            run(&mut pair, 0.5 + 2.0 * TAU / w, |t, p| {
                p.controller.model.inputs.enable = t > 0.05 - 0.5 * T_S;
                if t > 0.5 {
                    let tau = p.plant.out.tau_e;
                    (sine, cosine, n) = (sine + tau * (w * t).sin(), cosine + tau * (w * t).cos(), n + 1.0);
                }
            });
            [sine.hypot(cosine) / n, 0.0]
        },
        acts: |_, [without, _], [with, _]| without > 0.1 && with < 0.2 * without,
    },
    Case {
        option: "timing.delay",
        on: |kind| turning(drive(kind), SLOW),
        ask: |p| p.delay = 2,
        figures: |mut pair| {
            run(&mut pair, T_S, |_, _| ());
            [command(&pair).alpha(), command(&pair).beta()]
        },
        // The first command, at least the EMF, is rotated by another w T_s.
        acts: |_, without, with| {
            let change = (with[0] - without[0]).hypot(with[1] - without[1]);
            change > 0.9 * (3.0 * SLOW).powi(2) * T_S * 0.545
        },
    },
    Case {
        option: "limit.i",
        on: slow,
        ask: |p| p.limit.i = 6.0,
        figures: |pair| [references(pair)[1], 0.0],
        acts: |_, _, [tau_max, _]| (tau_max / (6.0 * Motor::IPMSM_2_2_KW.torque_constant()) - 1.0).abs() < 1e-5,
    },
    Case {
        option: "limit.tau",
        on: slow,
        ask: |p| p.limit.tau = 2.0,
        figures: |pair| [references(pair)[1], 0.0],
        acts: |_, _, [tau_max, _]| (tau_max - 2.0).abs() < 1e-9,
    },
    Case {
        option: "limit.i_dc_use",
        on: slow,
        ask: |p| (p.dc.used, p.dc.max) = (true, 0.3),
        figures: |pair| [0.0, references(pair)[1]],
        // The maximum torque takes 162 W, at a speed of 15.7 rad/s.
        acts: |_, _, [_, tau_max]| tau_max * SLOW < 162.0 && tau_max > 3.0,
    },
    Case {
        option: "trip.use",
        on: slow,
        ask: |p| (p.trip.used, p.trip.i, p.trip.u_dc) = (true, 15.1, 560.0),
        figures: over_voltage,
        acts: |_, without, with| are(without, [false, false]) && are(with, [true, false]),
    },
    Case {
        option: "trip.asc",
        on: |kind| {
            let mut pair = slow(kind);
            (pair.controller.model.parameters.trip.used, pair.controller.model.parameters.trip.u_dc) = (true, 560.0);
            pair.controller.model.parameters.trip.i = 15.1;
            pair
        },
        ask: |p| p.trip.asc = true,
        figures: over_voltage,
        // On a link discharged by a short circuit, any speed is above the diode speed.
        acts: |_, without, with| are(without, [true, false]) && are(with, [true, true]),
    },
    Case {
        option: "sensor.fallback",
        on: slow,
        ask: |p| p.fallback = Kind::RotatingInjection,
        figures: |mut pair| {
            run(&mut pair, 0.2, |t, p| p.controller.model.inputs.sensor_valid = t < 0.1);
            [f64::from(u8::from(pair.controller.out.sensor_lost)), off(&pair)]
        },
        acts: |kind, [without, _], [with, off]| {
            let sensor = kind == Kind::Sensored;
            without < 0.5 && (with > 0.5) == sensor && (!sensor || off > 1e-9 && off < 5.0)
        },
    },
    Case {
        option: "start.mode",
        on: drive,
        ask: |p| p.start.mode = StartMode::CurrentFrequency,
        figures: start,
        acts: |_, _, [i_d, error]| (i_d - 8.0).abs() < 1e-9 && error < 15.0,
    },
    Case {
        option: "start.mode",
        on: |kind| {
            let mut pair = drive(kind);
            let saturation = &mut pair.plant.model.parameters.saturation;
            (saturation.s_2, saturation.s_3) = (40.0, 40.0);
            pair.controller.model.parameters.s_2 = 40.0;
            pair
        },
        ask: |p| p.start.mode = StartMode::Injection,
        // From the wrong pole, the speed loop drives the rotor away from rest.
        figures: |mut pair| {
            let mut fastest = 0.0_f64;
            pair.plant.model.parameters.initial.theta_e = 3.2;
            run(&mut pair, 1.0, |_, p| fastest = fastest.max(p.plant.out.speed.abs()));
            [fastest, off(&pair)]
        },
        acts: |_, [runaway, _], [rest, error]| runaway > 5.0 && rest < 5.0 && error < 1.0,
    },
    Case {
        option: "start.catch",
        on: |kind| {
            let mut pair = turning(drive(kind), SLOW);
            pair.controller.model.parameters.speed_est = 0.0;
            pair
        },
        ask: |p| p.start.catch = true,
        // The gates are off until the rotor has been sought; then the drive runs at its angle.
        figures: |mut pair| {
            let mut gates = 1.0_f64;
            run(&mut pair, 0.2, |t, p| gates = if t < 2.5 * T_S && !p.controller.out.enabled { 0.0 } else { gates });
            [gates, off(&pair)]
        },
        // A sensor gives the rotor at once.
        acts: |kind, [on, _], [gates, error]| on > 0.5 && (gates < 0.5 || kind == Kind::Sensored) && error < 10.0,
    },
    Case {
        option: "tracker.kind",
        on: |kind| {
            let mut pair = turning(drive(kind), 0.5 * SLOW);
            pair.controller.model.parameters.speed_loop.torque_mode = true;
            pair
        },
        ask: |p| p.estimators.tracker.kind = TrackerKind::MechanicalObserver,
        // The angle error while the drive accelerates: a PLL lags.
        figures: |mut pair| {
            let (mut sum, mut n) = (0.0, 0.0);
            pair.controller.model.inputs.tau_ref = 1.5;
            run(&mut pair, 0.25, |t, p| {
                if t > 0.15 {
                    (sum, n) = (sum + wrap(p.plant.out.theta_e - p.controller.out.theta_est).to_degrees(), n + 1.0);
                }
            });
            [sum / n, 0.0]
        },
        acts: |_, [pll, _], [observer, _]| observer.abs() < 0.6 * pll.abs(),
    },
    Case {
        option: "adaptation.resistance",
        on: |kind| {
            let mut pair = drive(kind);
            pair.controller.model.parameters.motor.R_s *= 0.9;
            pair
        },
        ask: |p| p.estimators.adaptation.resistance = true,
        figures: at_rest,
        // A sensor needs no resistance, and the controller reports that the option has no effect.
        acts: |kind, [fixed, _], [adapted, _]| {
            kind == Kind::Sensored || (fixed / 3.24 - 1.0).abs() < 1e-9 && (adapted / 3.6 - 1.0).abs() < 0.03
        },
    },
    Case {
        option: "adaptation.k_a",
        on: |kind| {
            let mut pair = drive(kind);
            pair.controller.model.parameters.estimators.adaptation.resistance = kind == Kind::Rasmussen;
            pair
        },
        ask: |p| p.estimators.adaptation.k_a = 0.05,
        figures: at_rest,
        acts: |_, [_, without], [_, with]| with.abs() < 0.7 * without.abs(),
    },
    Case {
        option: "adaptation.tracking",
        on: |kind| {
            let mut pair = turning(drive(kind), 0.02 * RATED);
            pair.controller.model.parameters.estimators.adaptation.resistance = kind == Kind::Rasmussen;
            pair
        },
        ask: |p| p.estimators.adaptation.tracking = 0.15,
        figures: |mut pair| {
            run(&mut pair, 4.0, |t, p| p.plant.model.inputs.tau_load = 7.0 * t.min(1.0));
            [pair.controller.out.R_s_est, off(&pair)]
        },
        acts: |_, [held, _], [tracked, _]| (held / (0.8 * 3.6) - 1.0).abs() < 1e-9 && tracked > 0.9 * 3.6,
    },
    Case {
        option: "flux_observer.magnet",
        on: |kind| {
            let mut pair = turning(drive(kind), 0.5 * RATED);
            pair.controller.model.parameters.motor.psi_M *= 1.1;
            pair
        },
        ask: |p| p.estimators.flux_observer.magnet = 5.0,
        figures: |mut pair| {
            run(&mut pair, 2.0, |t, p| p.plant.model.inputs.tau_load = 7.0 * t.min(1.0));
            [off(&pair), 0.0]
        },
        acts: |_, [without, _], [with, _]| with < 0.2 * without,
    },
    Case {
        option: "emf.hold_reversal",
        on: |kind| turning(drive(kind), SLOW),
        ask: |p| p.estimators.emf.hold_reversal = true,
        figures: |mut pair| {
            let mut passing = 0.0;
            run(&mut pair, 2.0, |t, p| {
                p.controller.model.inputs.speed_ref = SLOW * (1.0 - 4.0 * (t - 0.2)).clamp(-1.0, 1.0);
                if t < 0.5 {
                    passing = p.controller.out.theta_est;
                }
            });
            [off(&pair), passing]
        },
        acts: |_, [_, without], [error, with]| error < 15.0 && (with - without).abs() > 1e-6,
    },
    Case {
        option: "emf.frame_term",
        on: |kind| turning(drive(kind), 1.5 * SLOW),
        ask: |p| p.estimators.emf.frame_term = false,
        figures: |mut pair| {
            let (mut most, mut fast) = (0.0_f64, 0.0_f64);
            run(&mut pair, 3.0, |t, p| {
                p.plant.model.inputs.tau_load = 14.0 * (t - 0.3).clamp(0.0, 1.0);
                if t > 2.0 {
                    (most, fast) = (most.max(off(p)), fast.max((p.plant.out.speed - 1.5 * SLOW).abs()));
                }
            });
            [most, fast]
        },
        // Without the term, a drive whose tracker follows the EMF alone is lost under rated load.
        acts: |kind, [with, _], [without, _]| {
            let tracks = !matches!(kind, Kind::VoltageModel | Kind::CurrentModel | Kind::Hybrid);
            with < 15.0 && if tracks { without > 30.0 } else { without > 1.02 * with }
        },
    },
    Case {
        option: "matsui.integral",
        on: |kind| {
            let mut pair = loaded(kind);
            pair.controller.model.parameters.motor.psi_M *= 0.97;
            pair
        },
        ask: |p| p.estimators.matsui.integral = false,
        figures: after_load,
        acts: |_, [with, _], [without, _]| without > 1.1 * with,
    },
    Case {
        option: "pulsating.demodulation",
        on: loaded,
        ask: |p| p.estimators.pulsating.demodulation = Demodulation::MeasurementAxes,
        figures: after_load,
        acts: |_, [_, one], [error, other]| error < 15.0 && (one - other).abs() > 1e-9,
    },
    Case {
        option: "gradient.clamped",
        on: loaded,
        ask: |p| p.estimators.gradient.clamped = true,
        figures: after_load,
        acts: |_, [_, one], [error, other]| error < 15.0 && (one - other).abs() > 1e-9,
    },
    Case {
        option: "commission.mode",
        on: drive,
        ask: |p| p.commission.mode = CommissionMode::Standstill,
        figures: commissioned,
        acts: |_, without, with| are(without, [false, true]) && are(with, [true, false]),
    },
    Case {
        option: "commission.update",
        on: |kind| {
            let mut pair = drive(kind);
            pair.controller.model.parameters.commission.mode = CommissionMode::Standstill;
            pair
        },
        ask: |p| p.commission.update = PwmUpdate::Double,
        figures: found_resistance,
        acts: |_, [R, single], [same, double]| R > 0.0 && (R - same).abs() < 1e-12 && double > single,
    },
    Case {
        option: "limit.tau_use",
        on: |kind| {
            let mut pair = slow(kind);
            (pair.controller.model.inputs.modes.tau_max, pair.controller.model.inputs.modes.tau_min) = (2.0, -1.0);
            pair
        },
        ask: |p| p.modes.tau_used = true,
        figures: |pair| [0.0, references(pair)[1]],
        acts: |_, [_, most], [_, limited]| most > 10.0 && (limited - 2.0).abs() < 1e-9,
    },
    Case {
        option: "limit.speed_use",
        on: |kind| {
            let mut pair = slow(kind);
            pair.controller.model.parameters.modes.speed.max = 0.5 * SLOW;
            pair
        },
        ask: |p| p.modes.speed.used = true,
        // Above its bound, the drive brakes.
        figures: |mut pair| {
            pair.controller.model.inputs.tau_ref = 3.0;
            run(&mut pair, 0.3, |_, _| ());
            [pair.controller.out.i_ref.q, 0.0]
        },
        acts: |_, [without, _], [with, _]| without > 1.0 && with < -1.0,
    },
    Case {
        option: "brake.hold",
        on: |kind| {
            let mut pair = slow(kind);
            pair.controller.model.inputs.modes.brake = true;
            let par = &mut pair.controller.model.parameters;
            (par.modes.brake.hold, par.speed_loop.bandwidth) = (false, TAU);
            pair
        },
        ask: |p| p.modes.brake.hold = true,
        // On a shaft that keeps turning, its integral part grows.
        figures: |mut pair| {
            let mut early = 0.0;
            run(&mut pair, 0.3, |t, p| {
                if t < 0.1 {
                    early = p.controller.out.i_ref.q;
                }
            });
            [early, pair.controller.out.i_ref.q]
        },
        acts: |_, [early, late], [_, held]| early < -0.3 && (late / early - 1.0).abs() < 0.05 && held < 1.2 * late,
    },
    Case {
        option: "sensor.phases",
        on: |kind| {
            let mut pair = slow(kind);
            pair.controller.model.parameters.sensor.offset.c = 0.3;
            pair
        },
        ask: |p| p.sensor.phases = MeasuredPhases::Two,
        // The ripple of the torque that an offset makes.
        figures: |mut pair| {
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            run(&mut pair, 0.5, |t, p| {
                if t > 0.25 {
                    (low, high) = (low.min(p.plant.out.tau_e), high.max(p.plant.out.tau_e));
                }
            });
            [high - low, 0.0]
        },
        acts: |_, [three, _], [two, _]| two < 0.8 * three,
    },
    Case {
        option: "sensor.position",
        on: |kind| {
            let mut pair = slow(kind);
            pair.controller.model.parameters.position.counts = 64;
            pair
        },
        ask: |p| p.position.kind = PositionSensor::Encoder,
        // The greatest error of the angle in a count of 17 degrees.
        figures: |mut pair| {
            let mut most = 0.0_f64;
            run(&mut pair, 0.3, |t, p| most = if t > 0.2 { most.max(off(p)) } else { most });
            [most, 0.0]
        },
        acts: |kind, [without, _], [with, _]| {
            let changed = (with - without).abs() > 1e-9;
            changed == (kind == Kind::Sensored) && (!changed || without < 1.0 && (4.0..20.0).contains(&with))
        },
    },
    Case {
        option: "sensor.resume",
        on: |kind| {
            let mut pair = slow(kind);
            pair.controller.model.parameters.fallback = Kind::RotatingInjection;
            pair
        },
        ask: |p| p.resume = true,
        figures: |mut pair| {
            run(&mut pair, 0.2, |t, p| p.controller.model.inputs.sensor_valid = !(0.05..0.1).contains(&t));
            [f64::from(u8::from(pair.controller.out.sensor_lost)), 0.0]
        },
        acts: |kind, without, with| are(without, [kind == Kind::Sensored, false]) && are(with, [false, false]),
    },
    Case {
        option: "zero_speed.by_need",
        on: |kind| {
            let mut pair = drive(kind);
            pair.controller.model.parameters.estimators.adaptation.resistance = kind == Kind::Rasmussen;
            pair
        },
        ask: |p| p.zero_speed.by_need = true,
        figures: |mut pair| {
            run(&mut pair, 3.0, |_, _| ());
            [pair.controller.out.i_ref.d, 0.0]
        },
        acts: |_, [i_0, _], [least, _]| (i_0 - 5.0).abs() < 1e-6 && (least - 0.35 * 5.0).abs() < 1e-6,
    },
    Case {
        option: "zero_speed.release",
        on: |kind| {
            let mut pair = drive(kind);
            pair.controller.model.parameters.speed_loop.torque_mode = true;
            pair
        },
        ask: |p| p.zero_speed.release = true,
        figures: |mut pair| {
            run(&mut pair, 0.05, |_, _| ());
            let out = &pair.controller.out;
            [out.i_ref.d.hypot(out.i_ref.q), out.tau_max]
        },
        acts: |kind, [held, most], [free, same]| {
            let i_0 = if kind.class() == Class::FluxObserver { 5.0 } else { 0.0 };
            (held - i_0).abs() < 0.1 && free < 1e-9 && (most - same).abs() < 1e-12
        },
    },
];
