//! The current loop: PI in the estimated rotor frame, decoupled, limited to the hexagon, with back-calculation.
//!
//! u_d = K_p e_d + I_d - w^ L_q i_q, u_q = K_p e_q + I_q + w^ (L_d i_d + psi_M), with one PI controller per axis, K_p =
//! w_c L and K_i = w_c R^. With active resistance, K_i = w_c^2 L and the term -(w_c L - R^) i is added. The voltage cut
//! off by the hexagon drives the integrators back: I += T_s K_i (e + (u_limited - u) / K_p).
//!
//! The structure follows Rasmussen 2006, Fig. 2; the paper gives no gains. These gains cancel the pole of the axis, so
//! the loop is first-order with bandwidth w_c (internal model control); active resistance and back-calculation are
//! common practice in the field. u in V, i in A, w_c and w^ in rad/s (electrical).

use drive_base::frame::{Axis, DqHat, Estimated};
use drive_base::motor::Motor;
use fmu_core::unit::{ONE, RAD_PER_S};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters of the current loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurrentLoop {
    /// Bandwidth w_c in rad/s, > 0.
    pub bandwidth: f64,
    /// Integral gain w_c^2 L and active resistance w_c L - R instead of K_i = w_c R.
    pub active_resistance: bool,
    /// Integral gain in units of w_c^2 L, >= 0; 0: determined by `active_resistance`.
    pub integral: f64,
    /// Decouples with the references, including R, instead of with the measured currents.
    pub reference_feed_forward: bool,
    /// Maximum torque per ampere instead of i_d = 0 wherever the low-speed law is not active.
    pub mtpa: bool,
}

impl Default for CurrentLoop {
    fn default() -> Self {
        Self {
            bandwidth: 2.0 * std::f64::consts::PI * 250.0,
            active_resistance: false,
            integral: 0.0,
            reference_feed_forward: false,
            mtpa: false,
        }
    }
}

/// Gains of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct AxisGains {
    k_p: f64,
    k_i: f64,
    active_resistance: f64,
}

impl AxisGains {
    fn new(par: &CurrentLoop, L: f64, R: f64) -> Self {
        let w_c = par.bandwidth;
        let (k_i, active_resistance) =
            if par.active_resistance { (w_c * w_c * L, w_c * L - R) } else { (w_c * R, 0.0) };
        let k_i = if par.integral > 0.0 { par.integral * w_c * w_c * L } else { k_i };
        Self { k_p: w_c * L, k_i, active_resistance }
    }
}

/// Gains of both axes, from bandwidth and machine estimates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CurrentGains {
    d: AxisGains,
    q: AxisGains,
    reference_feed_forward: bool,
    /// Feed-forward gain of the references in Ohm.
    R: f64,
}

impl CurrentGains {
    /// Gains for the machine estimates `motor`.
    pub fn new(par: &CurrentLoop, motor: &Motor) -> Self {
        Self {
            d: AxisGains::new(par, motor.L_d, motor.R_s),
            q: AxisGains::new(par, motor.L_q, motor.R_s),
            reference_feed_forward: par.reference_feed_forward,
            R: if par.reference_feed_forward { motor.R_s } else { 0.0 },
        }
    }

    /// Maximum share by which the resistance of the winding may be below the estimate R^ before the loop oscillates. With active
    /// resistance, the loop subtracts R^ i and is stable for R^ - R < 2 w_c L; otherwise there is no such limit.
    pub fn tolerates(par: &CurrentLoop, motor: &Motor) -> f64 {
        if par.active_resistance { 2.0 * par.bandwidth * motor.L_d.min(motor.L_q) / motor.R_s } else { f64::INFINITY }
    }

    /// Proportional gains of both axes in V/A.
    pub fn proportional(&self) -> [f64; 2] {
        [self.d.k_p, self.q.k_p]
    }
}

/// Share by which the resistance of a cold winding can be below the estimate, 20 % at -30 degC, with a margin for the estimate itself.
pub const COLD: f64 = 0.3;

/// Maximum product of the gain that acts on an error and T_s / L with the lower inductance, in a frame off the rotor: with one sample
/// of delay, `i[k+2] = i[k+1] - g i[k]` is undamped at g = 1.
pub const OFF_ROTOR: f64 = 0.5;

impl CurrentGains {
    /// Gains for a frame at any angle from the rotor, as in a start. There the gains of the axes, G = diag(g_d, g_q), act on the
    /// inductances L of the rotor's axes, turned: the loop has the gains of T_s L^-1 G, which are real and at most
    /// T_s max(g_d, g_q) / min(L_d, L_q), because both are symmetric and positive. The inductance of an axis counts as far as that
    /// is [`OFF_ROTOR`] at most.
    pub fn off_rotor(par: &CurrentLoop, motor: &Motor, T_s: f64) -> Self {
        let gain = OFF_ROTOR * motor.L_d.min(motor.L_q) / T_s;
        let most = if par.active_resistance { 0.5 * (gain + motor.R_s) } else { gain } / par.bandwidth;
        // A bandwidth that is too high for the lower inductance stays.
        let most = most.max(motor.L_d.min(motor.L_q));
        let motor = Motor { L_d: motor.L_d.min(most), L_q: motor.L_q.min(most), ..motor.clone() };
        Self::new(par, &motor)
    }
}

/// State: the integral part in V.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CurrentController {
    integral: DqHat,
}

impl CurrentController {
    /// Voltage command (V) for the current error at the electrical speed `w` (rad/s), before limiting.
    #[expect(clippy::inline_always, reason = "the compiler would call it")]
    #[inline(always)]
    pub fn command(&self, gains: &CurrentGains, motor: &Motor, i_ref: DqHat, i: DqHat, w: f64) -> DqHat {
        let error = i_ref - i;
        let forward = if gains.reference_feed_forward { i_ref } else { i };
        let resistive = if gains.reference_feed_forward { i_ref * gains.R } else { DqHat::ZERO };
        DqHat::new(
            gains.d.k_p * error.d() + self.integral.d()
                - gains.d.active_resistance * i.d()
                - w * motor.L_q * forward.q()
                + resistive.d(),
            gains.q.k_p * error.q() + self.integral.q() - gains.q.active_resistance * i.q()
                + w * (motor.L_d * forward.d() + motor.psi_M)
                + resistive.q(),
        )
    }

    /// Changes from the gains `old` to `new` without a step in the command at reference `i_ref` and current `i` (A).
    pub fn retune(&mut self, old: &CurrentGains, new: &CurrentGains, i_ref: DqHat, i: DqHat) {
        let error = i_ref - i;
        let direct = |gains: &CurrentGains| {
            DqHat::new(
                gains.d.k_p * error.d() - gains.d.active_resistance * i.d(),
                gains.q.k_p * error.q() - gains.q.active_resistance * i.q(),
            ) + i_ref * gains.R
        };
        self.integral += direct(old) - direct(new);
    }

    /// Changes from gains `old` at the current `i` (A) to gains `new` at the same current in a frame `angle` (rad) behind, with unchanged
    /// voltage; the errors are 0.
    pub fn taken_over(self, old: &CurrentGains, i: DqHat, new: &CurrentGains, angle: f64) -> Self {
        if old == new {
            return self.in_frame_behind(angle);
        }
        let (mut controller, by) = (self, Axis::<Estimated>::at(angle));
        let none = CurrentGains::default();
        controller.retune(old, &none, i, i);
        let mut controller = controller.in_frame_behind(angle);
        let turned = by.to_stator(i);
        let turned = DqHat::new(turned.alpha(), turned.beta());
        controller.retune(&none, new, turned, turned);
        controller
    }

    /// The controller in a frame `angle` (rad) behind its previous frame: the voltage is unchanged.
    pub fn in_frame_behind(self, angle: f64) -> Self {
        let by = Axis::<Estimated>::at(angle);
        let turned = by.to_stator(self.integral);
        Self { integral: DqHat::new(turned.alpha(), turned.beta()) }
    }

    /// PI output for `error` (A) without decoupling and active resistance, in V.
    #[inline]
    pub fn output(&self, gains: &CurrentGains, error: DqHat) -> DqHat {
        self.integral + DqHat::new(gains.d.k_p * error.d(), gains.q.k_p * error.q())
    }

    /// Integrates one sample of `T_s` (s); `limitation` (V) is the voltage minus the requested one, if that was limited.
    #[inline]
    pub fn integrate(&mut self, gains: &CurrentGains, error: DqHat, limitation: Option<DqHat>, T_s: f64) {
        let CurrentGains { d, q, .. } = gains;
        let error = limitation.map_or(error, |u| error + DqHat::new(u.d() / d.k_p, u.q() / q.k_p));
        self.integral += DqHat::new(T_s * d.k_i * error.d(), T_s * q.k_i * error.q());
    }
}

type P = Row<CurrentLoop>;

/// Variables of the current loop; their owner supplies the prefix `current.`.
pub const CURRENT_LOOP: &Table<CurrentLoop> = table![
    P::parameter(
        "bandwidth",
        &RAD_PER_S,
        "Bandwidth of the current loop, at most 2 pi 0.06 / T_s with timing.delay = 1",
        |p| &mut p.bandwidth,
    )
    .above(0.0)
    .tunable(),
    P::boolean_parameter(
        "active_resistance",
        "false: Kp = wc L, Ki = wc R; true: Ki = wc^2 L with active resistance wc L - R",
        |p| &mut p.active_resistance,
    ),
    P::parameter("integral", &ONE, "Integral gain Ki in units of wc^2 L; 0: as active_resistance says", |p| {
        &mut p.integral
    })
    .at_least(0.0)
    .tunable(),
    P::boolean_parameter(
        "reference_feed_forward",
        "Decoupling from the current references, with R, as in Kim & Sul (31); false: from the measured currents",
        |p| &mut p.reference_feed_forward,
    ),
    P::boolean_parameter(
        "mtpa",
        "Maximum torque per ampere; false: i_d = 0. With Rasmussen and FluxObserver, as far as zero_speed is not active",
        |p| &mut p.mtpa,
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Time constant of the closed loop on an R-L circuit, sampled so fast that the delay is negligible.
    fn time_constant(active_resistance: bool) -> f64 {
        let motor = Motor::default();
        let gains = CurrentGains::new(&CurrentLoop { active_resistance, ..CurrentLoop::default() }, &motor);
        let (mut controller, mut i, h) = (CurrentController::default(), 0.0, 1e-7);
        for k in 0..100_000_u32 {
            let (i_ref, measured) = (DqHat::new(0.0, 1.0), DqHat::new(0.0, i));
            let u = controller.command(&gains, &motor, i_ref, measured, 0.0).q();
            controller.integrate(&gains, i_ref - measured, None, h);
            i += h * (u - motor.R_s * i) / motor.L_q;
            if i > 1.0 - (-1.0_f64).exp() {
                return f64::from(k) * h;
            }
        }
        f64::NAN
    }

    #[test]
    fn the_closed_loop_is_first_order_with_the_bandwidth() {
        let expected = 1.0 / CurrentLoop::default().bandwidth;
        assert!((time_constant(false) / expected - 1.0).abs() < 1e-3);
        assert!((time_constant(true) / expected - 1.0).abs() < 1e-3);
    }

    #[test]
    fn the_voltage_stays_when_the_frame_changes() {
        let c = CurrentController { integral: DqHat::new(3.0, 4.0) };
        let stator = Axis::<Estimated>::at(1.2).to_stator(c.integral);
        let turned = c.in_frame_behind(0.5);
        assert!((Axis::<Estimated>::at(0.7).to_stator(turned.integral) - stator).magnitude() < 1e-14);
    }

    /// On the inductances of a rotor at any angle, the gains of a start stay at half of the stable limit; those of the estimated frame
    /// exceed it where the saliency is high, and are the same where it is low.
    #[test]
    fn the_gains_off_the_rotor_are_stable_at_any_angle() {
        let high = Motor { n_p: 2, R_s: 0.42, L_d: 10e-3, L_q: 48e-3, psi_M: 0.25 };
        let T_s = 1e-4;
        // The largest eigenvalue of T_s L^-1 G for a rotor that is `angle` (rad) off.
        let greatest = |motor: &Motor, gains: &CurrentGains, angle: f64| {
            let (mean, half) = (0.5 * (1.0 / motor.L_d + 1.0 / motor.L_q), 0.5 * (1.0 / motor.L_d - 1.0 / motor.L_q));
            let (a, b, c) =
                (mean + half * (2.0 * angle).cos(), half * (2.0 * angle).sin(), mean - half * (2.0 * angle).cos());
            let [d, q] = [&gains.d, &gains.q].map(|axis| axis.k_p + axis.active_resistance);
            let (trace, product) = (a * d + c * q, (a * c - b * b) * d * q);
            T_s * 0.5 * (trace + (trace * trace - 4.0 * product).max(0.0).sqrt())
        };
        for active_resistance in [true, false] {
            for bandwidth in [600.0, 1200.0, 2400.0] {
                let par = CurrentLoop { bandwidth, active_resistance, ..CurrentLoop::default() };
                let (own, start) = (CurrentGains::new(&par, &high), CurrentGains::off_rotor(&par, &high, T_s));
                let worst = |gains| (0..90).map(|k| greatest(&high, gains, 0.02 * f64::from(k))).fold(0.0, f64::max);
                assert!(worst(&start) <= OFF_ROTOR + 1e-9, "{par:?}: {}", worst(&start));
                assert!(!active_resistance || worst(&own) > OFF_ROTOR, "{par:?}: {}", worst(&own));
                let low = Motor::IPMSM_2_2_KW;
                assert_eq!(
                    CurrentGains::new(&par, &low) == CurrentGains::off_rotor(&par, &low, T_s),
                    bandwidth < 2000.0 || !active_resistance
                );
            }
        }
    }

    /// The voltage stays when gains and frame change at once.
    #[test]
    fn a_hand_over_to_other_gains_keeps_the_voltage() {
        let motor = Motor { n_p: 2, R_s: 0.42, L_d: 10e-3, L_q: 48e-3, psi_M: 0.25 };
        let par = CurrentLoop { active_resistance: true, bandwidth: 1200.0, ..CurrentLoop::default() };
        let (own, start) = (CurrentGains::new(&par, &motor), CurrentGains::off_rotor(&par, &motor, 1e-4));
        assert_ne!(own, start);
        // At standstill, so that nothing is decoupled.
        let (c, i, angle) = (CurrentController { integral: DqHat::new(3.0, 4.0) }, DqHat::new(2.0, 7.0), 0.5);
        let before = Axis::<Estimated>::at(1.2).to_stator(c.command(&start, &motor, i, i, 0.0));
        let turned = Axis::<Estimated>::at(angle).to_stator(i);
        let turned = DqHat::new(turned.alpha(), turned.beta());
        let after = c.taken_over(&start, i, &own, angle).command(&own, &motor, turned, turned, 0.0);
        assert!((Axis::<Estimated>::at(0.7).to_stator(after) - before).magnitude() < 1e-12, "{after:?}");
    }

    #[test]
    fn back_calculation_settles_where_the_command_is_the_limit() {
        let (motor, mut c) = (Motor::IPMSM_2_2_KW, CurrentController::default());
        let gains = CurrentGains::new(&CurrentLoop::default(), &motor);
        let (i_ref, i, limit) = (DqHat::new(-3.0, 5.0), DqHat::ZERO, DqHat::new(-12.0, motor.psi_M + 20.0));
        for _ in 0..100_000 {
            let wanted = c.command(&gains, &motor, i_ref, i, 0.0);
            c.integrate(&gains, i_ref - i, Some(limit - wanted), 1e-4);
        }
        // limitation = -K_p e: the integral part stays bounded at the limit instead of growing with K_i e t.
        assert!((c.integral - limit).magnitude() < 1e-6, "{:?}", c.integral);
    }

    /// Loops with every combination of the options.
    fn loops() -> [CurrentLoop; 4] {
        let with = |active_resistance, reference_feed_forward| CurrentLoop {
            active_resistance,
            reference_feed_forward,
            ..CurrentLoop::default()
        };
        [with(false, false), with(true, false), with(false, true), with(true, true)]
    }

    /// On the currents of its references, the command is the voltage of the turning machine, u = R i + j w psi, once the
    /// integrators have taken over the remainder of the decoupling.
    #[test]
    fn the_command_is_the_voltage_of_the_turning_machine() {
        let motor = Motor::IPMSM_2_2_KW;
        for par in loops() {
            for (i, w) in
                [(DqHat::new(-2.0, 5.0), 300.0), (DqHat::new(1.0, -7.0), 300.0), (DqHat::new(-3.0, 4.0), -200.0)]
            {
                let psi = drive_plant::machine::flux(&motor, drive_base::frame::Dq::new(i.d(), i.q()));
                let u = i * motor.R_s + DqHat::new(psi.d(), psi.q()).turned() * w;
                let gains = CurrentGains::new(&par, &motor);
                let by = |L: f64| par.bandwidth * L - motor.R_s;
                let active = DqHat::new(by(motor.L_d) * i.d(), by(motor.L_q) * i.q());
                let left = if par.reference_feed_forward { DqHat::ZERO } else { i * motor.R_s };
                let integral = left + if par.active_resistance { active } else { DqHat::ZERO };
                let command = CurrentController { integral }.command(&gains, &motor, i, i, w);
                assert!((command - u).magnitude() < 1e-9, "{par:?} {i:?} {w}: {command:?}, not {u:?}");
            }
        }
    }

    /// An error adds K_p of its axis to the command, and `output` shows the same.
    #[test]
    fn an_error_acts_with_the_proportional_gain_of_its_axis() {
        let motor = Motor::IPMSM_2_2_KW;
        let gains = CurrentGains::new(&CurrentLoop::default(), &motor);
        let c = CurrentController { integral: DqHat::new(3.0, -4.0) };
        let (i, error) = (DqHat::new(-2.0, 5.0), DqHat::new(0.1, -0.2));
        let w_c = CurrentLoop::default().bandwidth;
        let expected = DqHat::new(w_c * motor.L_d * 0.1, w_c * motor.L_q * -0.2);
        let added = c.command(&gains, &motor, i + error, i, 300.0) - c.command(&gains, &motor, i, i, 300.0);
        assert!((added - expected).magnitude() < 1e-9, "{added:?}, not {expected:?}");
        assert!((c.output(&gains, error) - c.integral - expected).magnitude() < 1e-9);
    }

    #[test]
    fn tuning_does_not_change_the_command() {
        let motor = Motor::IPMSM_2_2_KW;
        let (i_ref, i) = (DqHat::new(-2.0, 5.0), DqHat::new(-1.7, 4.4));
        for par in loops() {
            let other = Motor { R_s: 1.3 * motor.R_s, ..motor.clone() };
            let [old, new] = [
                CurrentGains::new(&par, &motor),
                CurrentGains::new(&CurrentLoop { bandwidth: 0.6 * par.bandwidth, ..par.clone() }, &other),
            ];
            let mut c = CurrentController { integral: DqHat::new(3.0, -4.0) };
            let before = c.command(&old, &motor, i_ref, i, 300.0);
            c.retune(&old, &new, i_ref, i);
            let after = c.command(&new, &motor, i_ref, i, 300.0);
            assert!((after - before).magnitude() < 1e-9, "{par:?}: {before:?} {after:?}");
        }
    }
}
