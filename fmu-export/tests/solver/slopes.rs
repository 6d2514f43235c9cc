//! Derivatives through the C interface, for a model with a tangent and for one without.

use super::ball::*;
use super::*;
use fmu_core::draw::Draw;

/// The tests of this file for the exported model, with this [`Exactness`].
macro_rules! derivatives {
    ($exactness:expr) => {
        #[test]
        fn directional_derivatives_are_those_of_set_and_get() {
            solver::slopes::directional_derivatives_are_those_of_set_and_get($exactness);
        }

        #[test]
        fn superposition_and_adjoint() {
            solver::slopes::superposition_and_adjoint($exactness);
        }

        #[test]
        fn columns_without_dependency_are_zero() {
            solver::slopes::columns_without_dependency_are_zero();
        }

        #[test]
        fn knowns_of_other_modes() {
            solver::slopes::knowns_of_other_modes();
        }

        #[test]
        fn output_derivatives() {
            solver::slopes::output_derivatives($exactness);
        }

        #[test]
        fn input_derivatives() {
            solver::slopes::input_derivatives();
        }
    };
}
pub(crate) use derivatives;

/// Their accuracy.
#[derive(Clone, Copy)]
pub struct Exactness {
    /// Against differences of Set and Get at v = 0, where v |v| has a kink in its derivative; 1e-6 elsewhere.
    pub at_standstill: f64,
    /// Superposition and adjoint identity.
    pub linear: f64,
}

/// The fault, and the call.
type Wrong = (&'static str, fn(&Fmu) -> c_int);

const KNOWNS: [u32; 3] = [U, H, V];
const UNKNOWNS: [u32; 6] = [DER_H, DER_V, H, E, A, V_MEAN];

/// In Continuous-Time Mode at 100 points: including standstill and a ball lying on the ground.
fn points(kind: Kind, mut at: impl FnMut(&Fmu, [f64; 3], &mut Draw)) {
    let mut draw = Draw(7);
    for i in 0..100 {
        let fmu = Fmu::running(kind, 0.0);
        if i % 10 == 3 {
            // A slow fall onto the ground ends at rest.
            assert_eq!((fmu.set_states(&[0.0, -0.01]), fmu.event()), (OK, OK));
            fmu.settle();
            assert_eq!((fmu.leave(), fmu.indicators()), (OK, [1.0]));
        }
        let v = if i % 10 == 5 { 0.0 } else { draw.around(20.0) };
        let x = [draw.around(50.0), 50.0 + draw.around(49.0), v];
        assert_eq!((fmu.set_time(0.1), fmu.set(&KNOWNS, &x)), (OK, OK));
        at(&fmu, x, &mut draw);
    }
}

fn get(fmu: &Fmu) -> [f64; 6] {
    let mut values = [0.0; 6];
    assert_eq!(fmu.try_get(&UNKNOWNS, &mut values), OK);
    values
}

fn along(fmu: &Fmu, seed: &[f64]) -> [f64; 6] {
    let mut out = [f64::NAN; 6];
    assert_eq!(fmu.directional(&UNKNOWNS, &KNOWNS, seed, &mut out), OK, "{:?}", fmu.messages());
    out
}

pub fn directional_derivatives_are_those_of_set_and_get(exactness: Exactness) {
    for kind in ME {
        points(kind, |fmu, x, draw| {
            let before = fmu.bytes();
            for i in 0..5 {
                let seed: [f64; 3] =
                    std::array::from_fn(|k| if i < 3 { f64::from(u8::from(i == k)) } else { draw.around(1.0) });
                let exact = along(fmu, &seed);
                let side = |eps: f64| {
                    let moved: [f64; 3] = std::array::from_fn(|k| x[k] + eps * seed[k]);
                    assert_eq!(fmu.set(&KNOWNS, &moved), OK);
                    get(fmu)
                };
                let (up, down) = (side(1e-6), side(-1e-6));
                assert_eq!(fmu.set(&KNOWNS, &x), OK);
                let relative = if x[2] == 0.0 { exactness.at_standstill } else { 1e-6 };
                for (k, (exact, (up, down))) in exact.into_iter().zip(up.into_iter().zip(down)).enumerate() {
                    let difference = (up - down) / 2e-6;
                    let rounding = 4.0 * f64::EPSILON * up.abs() / 1e-6;
                    let error = (exact - difference).abs();
                    let place = format!("{kind:?} {} at {x:?} along {seed:?}", UNKNOWNS[k]);
                    assert!(error <= relative * difference.abs().max(1.0) + rounding, "{place}: {exact} {difference}");
                }
            }
            assert!(fmu.bytes() == before, "a derivative changed the state");
        });
    }
}

pub fn superposition_and_adjoint(exactness: Exactness) {
    points(Kind::Me3, |fmu, _, draw| {
        let before = fmu.bytes();
        let mut vector = || -> [f64; 3] { std::array::from_fn(|_| draw.around(1.0)) };
        let (a, b) = (vector(), vector());
        let (ja, jb) = (along(fmu, &a), along(fmu, &b));
        let sum = along(fmu, &[2.0 * a[0] - b[0], 2.0 * a[1] - b[1], 2.0 * a[2] - b[2]]);
        let scale = |x: &[f64; 6]| x.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
        for k in 0..6 {
            let error = (sum[k] - (2.0 * ja[k] - jb[k])).abs();
            assert!(error <= exactness.linear * scale(&sum), "{error}");
        }
        // However long the direction is.
        for factor in [1e-9, 1e9] {
            let scaled = along(fmu, &a.map(|x| factor * x));
            for (long, short) in scaled.into_iter().zip(ja) {
                assert!((long / factor - short).abs() <= exactness.linear * scale(&ja), "{factor}: {long} {short}");
            }
        }
        let w: [f64; 6] = std::array::from_fn(|_| draw.around(1.0));
        let mut back = [f64::NAN; 3];
        assert_eq!(fmu.adjoint(&UNKNOWNS, &KNOWNS, &w, &mut back), OK);
        let left: f64 = w.iter().zip(ja).map(|(w, y)| w * y).sum();
        let right: f64 = back.iter().zip(a).map(|(x, v)| x * v).sum();
        assert!((left - right).abs() <= exactness.linear * scale(&ja), "{left} {right}");
        assert!(fmu.bytes() == before, "a derivative changed the state");
    });
}

/// An unlisted dependency does not exist.
pub fn columns_without_dependency_are_zero() {
    for kind in ME {
        points(kind, |fmu, _, _| {
            for (known, unknowns) in [(U, &[DER_H, H, E, V_MEAN][..]), (H, &[DER_H, V_MEAN]), (V, &[H])] {
                let mut out = [f64::NAN; 4];
                let out = &mut out[..unknowns.len()];
                assert_eq!(fmu.directional(unknowns, &[known], &[3.0], out), OK);
                assert!(out.iter().all(|x| *x == 0.0), "{known}: {out:?}");
            }
            // No direction at all.
            assert_eq!(along(fmu, &[0.0; 3]), [0.0; 6]);
        });
    }
}

/// Discrete reals in Event Mode; parameters and start values in Initialization Mode; tunable ones in FMI 3.0.
pub fn knowns_of_other_modes() {
    let near = |a: f64, b: f64| (a - b).abs() < 1e-7 * (1.0 + b.abs());
    for kind in ME {
        let fmu = Fmu::running(kind, 0.0);
        assert_eq!((fmu.set_states(&[30.0, -4.0]), fmu.event()), (OK, OK));
        fmu.settle();
        let mut out = [f64::NAN; 3];
        assert_eq!(fmu.directional(&[A, HELD, H], &[K, V], &[1.0, 2.0], &mut out), OK);
        let rho = (1.0 - 30.0 / 44_330.0_f64).powf(4.255);
        assert!(near(out[0], 0.1 - 2.0 * 8.0 * 0.05 * rho) && out[1] == 0.0 && out[2] == 0.0, "{out:?}");
        assert_eq!(fmu.directional(&[HELD], &[U], &[1.0], &mut out[..1]), OK);
        assert_eq!(out[0], 0.0, "the held value does not change within this event");

        let fmu = Fmu::entered(kind, 0.0);
        assert_eq!(fmu.get(H), 1.0);
        let bytes = fmu.bytes();
        let (unknowns, knowns) = ([H, V, C_M, DER_V, HELD], [H_START, C, M, U]);
        let mut out = [f64::NAN; 5];
        assert_eq!(fmu.directional(&unknowns, &knowns, &[1.0, 0.2, 0.0, 3.0], &mut out), OK, "{:?}", fmu.messages());
        for (got, wanted) in out.into_iter().zip([1.0, 0.0, 0.1, 3.0, 3.0]) {
            assert!(near(got, wanted), "{out:?}");
        }
        assert!(fmu.bytes() == bytes);
        assert_eq!(fmu.directional(&[H], &[H], &[1.0], &mut out[..1]), ERROR, "a state cannot be set here");

        let fmu = Fmu::running(kind, 0.0);
        assert_eq!(fmu.set_states(&[30.0, -4.0]), OK);
        let status = fmu.directional(&[DER_V], &[C], &[1.0], &mut out[..1]);
        if kind.version() == 2 {
            assert_eq!(status, ERROR);
        } else {
            assert!(status == OK && near(out[0], 8.0 * rho), "{}", out[0]);
        }
    }
}

/// Co-Simulation: derivatives at a communication point, and derivatives of outputs with respect to time.
pub fn output_derivatives(exactness: Exactness) {
    for kind in CS {
        let fmu = Fmu::running(kind, 0.5);
        assert_eq!((fmu.set(&[U], &[3.0]), fmu.step(0.5, 0.1).0, fmu.step(0.6, 0.1).0), (OK, OK, OK));
        let (bytes, [h, v, a]) = (fmu.bytes(), [H, V, A].map(|vr| fmu.get(vr)));
        let mut out = [f64::NAN; 4];
        assert_eq!(fmu.output_derivatives(&[E, A, H, V_MEAN], &[1; 4], &mut out), OK, "{:?}", fmu.messages());
        let rho = |h: f64| (1.0 - h / 44_330.0).powf(4.255);
        let slope = 4.255 / 44_330.0 * (1.0 - h / 44_330.0).powf(3.255);
        // d/dt of m v^2 / 2 + m g h + map[2] sin t, t after the start; of u - g - c/m v |v| rho; of h; of v.
        let wanted = [
            2.0 * v * a + 2.0 * 9.81 * v + 0.01 * 0.2_f64.cos(),
            -0.05 * (2.0 * v.abs() * a * rho(h) - v * v.abs() * slope * v),
            v,
            a,
        ];
        for (got, wanted) in out.into_iter().zip(wanted) {
            assert!((got - wanted).abs() < exactness.linear * 1e3 * (1.0 + wanted.abs()), "{out:?} {wanted}");
        }
        let mut one = [f64::NAN];
        assert_eq!(fmu.directional(&[DER_V], &[V], &[1.0], &mut one), OK);
        assert!((one[0] + 0.1 * v.abs() * rho(h)).abs() < 1e-7);
        assert!(fmu.bytes() == bytes, "a derivative changed the state");
        let wrong: [Wrong; 4] = [
            ("order = 2", |f| f.output_derivatives(&[E], &[2], &mut [0.0])),
            ("order = 0", |f| f.output_derivatives(&[E], &[0], &mut [0.0])),
            ("held is not a continuous output", |f| f.output_derivatives(&[HELD], &[1], &mut [0.0])),
            ("u is not a continuous output", |f| f.output_derivatives(&[U], &[1], &mut [0.0])),
        ];
        for (what, call) in wrong {
            let fmu = Fmu::running(kind, 0.0);
            assert_eq!(call(&fmu), ERROR);
            let error = fmu.error();
            assert!(error.contains(what), "{what}: {error}");
        }
    }
}

/// A ball that falls from high above, without events; a step of `h` from 0 to 0.8 s with u = 5 t.
fn ramped(h: f64, by_derivative: bool) -> Fmu {
    let fmu = Fmu::entered(Kind::Cs2, 0.0);
    assert_eq!((fmu.set(&[H_START, PERIOD, C], &[50.0, 100.0, 1.0]), fmu.exit()), (OK, OK));
    let n = (0.8 / h).round();
    let mut k = 0.0;
    while k < n {
        let t = k * h;
        if by_derivative {
            assert_eq!((fmu.set(&[U], &[5.0 * t]), fmu.input_derivatives(&[U], &[1], &[5.0])), (OK, OK));
        } else {
            assert_eq!(fmu.set(&[U], &[5.0 * (t + 0.5 * h)]), OK);
        }
        assert_eq!(fmu.step(t, h).0, OK);
        k += 1.0;
    }
    fmu
}

pub fn input_derivatives() {
    let reference = ramped(0.8 / 8192.0, false);
    let error = |h: f64| {
        let fmu = ramped(h, true);
        [H, V].map(|vr| (fmu.get(vr) - reference.get(vr)).abs())
    };
    let (coarse, fine) = (error(0.4), error(0.2));
    for (coarse, fine) in coarse.into_iter().zip(fine) {
        assert!(coarse < 1e-4 && (3.5..4.5).contains(&(coarse / fine)), "second order: {coarse} {fine}");
    }
    let fmu = ramped(0.4, true);
    let v = fmu.get(V);
    assert_eq!(fmu.get(U), 2.0, "the input is as it was set");
    // They applied to one step; a mean over the step covers the whole step.
    let again = ramped(0.4, true);
    let h = again.get(H);
    assert_eq!((fmu.step(0.8, 0.4).0, again.input_derivatives(&[U], &[1], &[0.0])), (OK, OK));
    assert_eq!(again.step(0.8, 0.4).0, OK);
    assert!((fmu.get(V) - again.get(V)).abs() < 1e-9 && (fmu.get(V) - v).abs() > 0.1);
    for fmu in [fmu, again] {
        assert!((fmu.get(V_MEAN) - (fmu.get(H) - h) / 0.4).abs() < 1e-8, "{}", fmu.get(V_MEAN));
    }
    // They are part of the state.
    let fmu = ramped(0.4, true);
    assert_eq!(fmu.input_derivatives(&[U], &[1], &[7.0]), OK);
    let (other, bytes) = (Fmu::new(Kind::Cs2), fmu.bytes());
    let mut state = null_mut();
    assert_eq!(
        (other.deserialize(&bytes, &mut state), other.restore(state), other.free_state(&mut state)),
        (OK, OK, OK)
    );
    assert_eq!((fmu.step(0.8, 0.4).0, other.step(0.8, 0.4).0), (OK, OK));
    assert!(fmu.bytes() == other.bytes());
    let wrong: [Wrong; 6] = [
        ("k is not a continuous real input", |f| f.input_derivatives(&[U, K], &[1, 1], &[1.0, 1.0])),
        ("h is not a continuous real input", |f| f.input_derivatives(&[H], &[1], &[1.0])),
        ("value reference 99 is not a continuous real input", |f| f.input_derivatives(&[99], &[1], &[1.0])),
        ("order = 2", |f| f.input_derivatives(&[U], &[2], &[1.0])),
        ("the derivative of u = NaN", |f| f.input_derivatives(&[U], &[1], &[f64::NAN])),
        ("u + 1000 t", |f| {
            assert_eq!(f.input_derivatives(&[U], &[1], &[1000.0]), OK);
            f.step(0.0, 1.0).0
        }),
    ];
    for (what, call) in wrong {
        let fmu = Fmu::running(Kind::Cs2, 0.0);
        let values = || [U, H, V, E].map(|vr| fmu.get(vr).to_bits());
        let before = values();
        assert_eq!(call(&fmu), ERROR);
        let error = fmu.error();
        assert!(error.contains(what), "{what}: {error}");
        assert_eq!(values(), before, "{what}");
    }
}
