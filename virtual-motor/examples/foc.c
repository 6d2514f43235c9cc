/* A plain FOC loop at 20 kHz on the virtual motor: two current controllers, a speed controller, an encoder.
 *
 *   cargo build --release -p virtual-motor
 *   cc -O2 -I virtual-motor/include virtual-motor/examples/foc.c target/release/libvirtual_motor.a -lm -lpthread -ldl -o foc && ./foc
 *
 * It turns the reference motor at 1000 rpm and loads it with 1 N.m at 0.3 s. The upper half is what a firmware has: it sees counts and
 * gives duty cycles. The lower half takes the place of the hardware.
 */
#include "virtual_motor.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define PI 3.14159265358979323846
#define T 50e-6            /* period of PWM and current loop, s */
#define COUNTS 4096        /* counts of the encoder per turn */
#define POLE_PAIRS 3
#define R_S 2.0            /* Ohm */
#define L_S 6e-3           /* H */
#define J 1.5e-3           /* kg.m2 */
#define K_T 0.675          /* N.m/A: 1.5 n_p psi_M */
#define I_MAX 7.5          /* A */
#define CURRENT_LOOP 4000.0 /* rad/s */
#define SPEED_LOOP 60.0    /* rad/s */
#define SPEED_EVERY 20     /* periods of the current loop per period of the speed loop */

/* ---- The firmware --------------------------------------------------------------------------------------------------------- */

typedef struct {
    double amperes, volts; /* per count */
    double i_zero;         /* counts at 0 A */
    double speed_ref;      /* rad/s */
    double speed, i_q_ref, sum_d, sum_q, sum_speed;
    uint32_t last;
    int tick;
} controller;

static double limited(double x, double limit) { return x > limit ? limit : x < -limit ? -limit : x; }

/* The interrupt at the beginning of a PWM period: from counts to the duty cycles of the next period. */
static void interrupt(controller *c, const uint32_t i[3], uint32_t link, uint32_t count, double duties[3]) {
    if (++c->tick == SPEED_EVERY) {
        int32_t moved = (int32_t)(count - c->last);
        moved -= moved > COUNTS / 2 ? COUNTS : moved < -COUNTS / 2 ? -COUNTS : 0;
        c->speed += 0.3 * (moved * 2.0 * PI / COUNTS / (SPEED_EVERY * T) - c->speed);
        c->last = count;
        c->tick = 0;
        double error = c->speed_ref - c->speed, k_p = J * SPEED_LOOP / K_T;
        double wanted = k_p * error + c->sum_speed;
        c->i_q_ref = limited(wanted, I_MAX);
        if (wanted == c->i_q_ref) c->sum_speed += 0.25 * k_p * SPEED_LOOP * SPEED_EVERY * T * error;
    }

    double i_a = (i[0] - c->i_zero) * c->amperes, i_b = (i[1] - c->i_zero) * c->amperes;
    double alpha = i_a, beta = (i_a + 2.0 * i_b) / sqrt(3.0);
    double theta = POLE_PAIRS * 2.0 * PI * (count + 0.5) / COUNTS;
    double i_d = cos(theta) * alpha + sin(theta) * beta, i_q = cos(theta) * beta - sin(theta) * alpha;

    double u_dc = link * c->volts, u_max = 0.55 * u_dc;
    double u_d = CURRENT_LOOP * L_S * (0.0 - i_d) + c->sum_d, u_q = CURRENT_LOOP * L_S * (c->i_q_ref - i_q) + c->sum_q;
    if (hypot(u_d, u_q) < u_max) {
        c->sum_d += CURRENT_LOOP * R_S * T * (0.0 - i_d);
        c->sum_q += CURRENT_LOOP * R_S * T * (c->i_q_ref - i_q);
    } else {
        double scale = u_max / hypot(u_d, u_q);
        u_d *= scale;
        u_q *= scale;
    }

    /* The duty cycles act in the next period, whose middle is 1.5 T away. */
    theta += POLE_PAIRS * c->speed * 1.5 * T;
    double u_alpha = cos(theta) * u_d - sin(theta) * u_q, u_beta = sin(theta) * u_d + cos(theta) * u_q;
    double u[3] = {u_alpha, -0.5 * u_alpha + 0.5 * sqrt(3.0) * u_beta, -0.5 * u_alpha - 0.5 * sqrt(3.0) * u_beta};
    double common = -0.5 * (fmax(u[0], fmax(u[1], u[2])) + fmin(u[0], fmin(u[1], u[2])));
    for (int x = 0; x < 3; x++) duties[x] = fmin(1.0, fmax(0.0, 0.5 + (u[x] + common) / u_dc));
}

/* ---- The hardware --------------------------------------------------------------------------------------------------------- */

static void check(vm_status status) {
    if (status == VM_OK) return;
    char text[512];
    vm_error_text(text, sizeof text);
    fprintf(stderr, "error %d: %s\n", (int)status, text);
    exit(1);
}

int main(void) {
    vm_motor motor;
    uint32_t t_pwm, dead_time, tau_load, speed;
    check(vm_create(&motor));
    check(vm_find("inverter.T_pwm", &t_pwm));
    check(vm_find("inverter.dead_time", &dead_time));
    check(vm_find("tau_load", &tau_load));
    check(vm_find("speed", &speed));
    check(vm_set(motor, t_pwm, T));
    check(vm_set(motor, dead_time, 1e-6));

    vm_adc_setup adc;
    check(vm_get_adc(motor, &adc));
    controller c = {0};
    c.amperes = 1.0 / adc.current_gain;
    c.volts = 1.0 / adc.voltage_gain;
    c.i_zero = adc.current_offset;
    c.speed_ref = 1000.0 * PI / 30.0;

    double duties[3] = {0.5, 0.5, 0.5}, mean = 0.0, lowest = 1e9;
    for (int k = 0; k < 14000; k++) {
        vm_adc_counts counts;
        vm_encoder_count encoder;
        double next[3], w;
        check(vm_adc(motor, &counts));
        check(vm_encoder(motor, &encoder));
        interrupt(&c, counts.i, counts.u_dc, encoder.count, next);
        if (k == 6000) check(vm_set(motor, tau_load, 1.0));
        check(vm_advance_duties(motor, (k + 1) * T, duties, 1));
        for (int x = 0; x < 3; x++) duties[x] = next[x];
        check(vm_get(motor, speed, &w));
        if (k >= 6000 && w < lowest) lowest = w;
        if (k >= 12000) mean += w / 2000.0;
        if (k % 1000 == 999) printf("%.2f s: %7.2f rpm, i_q = %.2f A\n", (k + 1) * T, w * 30.0 / PI, c.i_q_ref);
    }
    printf("lowest speed under load %.1f rpm, mean of the last 0.1 s %.2f rpm\n", lowest * 30.0 / PI, mean * 30.0 / PI);
    check(vm_destroy(motor));
    return 0;
}
