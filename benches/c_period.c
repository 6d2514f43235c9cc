/* A 10 kHz period written by hand in C, without an interface: a PMSM in its rotor frame (RK4, four substeps, sine and
 * cosine in every stage) and a Rasmussen controller with speed and current loops. `cargo bench --bench period` measures
 * against it. SI units; machine values as in the reference motor of the paper. */
#include <math.h>

typedef struct { double id, iq, w, th; } Plant;
typedef struct { double psd, psq, zi, th, w, xid, xiq, xw; } Controller;

static const double R = 1.3, L = 6e-3, PSI = 0.19, N_P = 3, J = 1.5e-3, B = 5e-4, T_S = 1e-4;
static Plant x;
static Controller c = { .psd = 0.19 };
static double va, vb;

static inline Plant derivative(Plant x, double va, double vb, double load, double s, double co) {
    double vd = va * co + vb * s, vq = -va * s + vb * co, we = N_P * x.w;
    Plant d;
    d.id = (vd - R * x.id + we * L * x.iq) / L;
    d.iq = (vq - R * x.iq - we * (L * x.id + PSI)) / L;
    d.w = (1.5 * N_P * PSI * x.iq - load - B * x.w) / J;
    d.th = we;
    return d;
}

static inline Plant along(Plant x, Plant d, double h) {
    Plant y = { x.id + h * d.id, x.iq + h * d.iq, x.w + h * d.w, x.th + h * d.th };
    return y;
}

/* Runs `periods` periods at the speed reference `speed` (rad/s, mechanical); returns the speed at their end. */
double c_periods(long long periods, double speed) {
    for (long long k = 0; k < periods; k++) {
        /* Currents of the phases. */
        double s = sin(x.th), co = cos(x.th);
        double pa = x.id * co - x.iq * s, pb = -0.5 * pa + 0.8660254037844386 * (x.id * s + x.iq * co);
        double al = pa, be = (pa + 2 * pb) * 0.5773502691896258;
        /* Observer. */
        double sh = sin(c.th), ch = cos(c.th);
        double id = al * ch + be * sh, iq = -al * sh + be * ch;
        double ud = va * ch + vb * sh, uq = -va * sh + vb * ch;
        double prd = c.psd - L * id, prq = c.psq - L * iq, w = c.w;
        c.psd += T_S * (ud - R * id - 50 * (prd - PSI) + w * c.psq);
        c.psq += T_S * (uq - R * iq - prq - w * c.psd);
        c.zi += T_S * 20000 * prq;
        c.w = 2000 * prq + c.zi;
        c.th += T_S * c.w;
        if (c.th > M_PI) c.th -= 2 * M_PI;
        if (c.th < -M_PI) c.th += 2 * M_PI;
        /* Speed loop and the low-speed law. */
        double e = N_P * speed - c.w, iqr = 0.01 * e + c.xw, iqs = iqr > 8 ? 8 : (iqr < -8 ? -8 : iqr);
        c.xw += T_S * (0.1 * e + 10 * (iqs - iqr));
        double idr = 5 * exp(-fabs(c.w) / 20.0);
        /* Current loop with decoupling and limit. */
        double ed = idr - id, eq = iqs - iq;
        double vd = 6 * ed + c.xid - c.w * L * iq, vq = 6 * eq + c.xiq + c.w * (L * id + PSI);
        double m = sqrt(vd * vd + vq * vq), k2 = m > 173 ? 173 / m : 1;
        double vds = vd * k2, vqs = vq * k2;
        c.xid += T_S * (1300 * ed + 200 * (vds - vd));
        c.xiq += T_S * (1300 * eq + 200 * (vqs - vq));
        double tha = c.th + 1.5 * T_S * c.w, s2 = sin(tha), c2 = cos(tha);
        double na = vds * c2 - vqs * s2, nb = vds * s2 + vqs * c2;
        /* Modulation. */
        double u1 = na, u2 = -0.5 * na + 0.8660254037844386 * nb, u3 = -0.5 * na - 0.8660254037844386 * nb;
        double mx = fmax(u1, fmax(u2, u3)), mn = fmin(u1, fmin(u2, u3)), z = -0.5 * (mx + mn), iv = 1 / 300.0;
        double d1 = fmin(1, fmax(0, 0.5 + (u1 + z) * iv));
        double d2 = fmin(1, fmax(0, 0.5 + (u2 + z) * iv));
        double d3 = fmin(1, fmax(0, 0.5 + (u3 + z) * iv));
        /* The plant under the voltage of the period before. */
        double h = T_S / 4;
        for (int i = 0; i < 4; i++) {
            Plant k_1 = derivative(x, va, vb, 0, sin(x.th), cos(x.th)), y = along(x, k_1, h / 2);
            Plant k_2 = derivative(y, va, vb, 0, sin(y.th), cos(y.th));
            y = along(x, k_2, h / 2);
            Plant k_3 = derivative(y, va, vb, 0, sin(y.th), cos(y.th));
            y = along(x, k_3, h);
            Plant k_4 = derivative(y, va, vb, 0, sin(y.th), cos(y.th));
            x.id += h / 6 * (k_1.id + 2 * k_2.id + 2 * k_3.id + k_4.id);
            x.iq += h / 6 * (k_1.iq + 2 * k_2.iq + 2 * k_3.iq + k_4.iq);
            x.w += h / 6 * (k_1.w + 2 * k_2.w + 2 * k_3.w + k_4.w);
            x.th += h / 6 * (k_1.th + 2 * k_2.th + 2 * k_3.th + k_4.th);
        }
        if (x.th > M_PI) x.th -= 2 * M_PI;
        if (x.th < -M_PI) x.th += 2 * M_PI;
        va = 300 * (2 * d1 - d2 - d3) / 3;
        vb = 300 * (d2 - d3) * 0.5773502691896258;
    }
    return x.w;
}
