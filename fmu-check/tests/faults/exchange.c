/* A small FMU for Model Exchange and co-simulation, FMI 2.0 and with -DFMI3 FMI 3.0, that breaks no rule; and with
   a fault of fault.h exactly one.
   x' = gain (u - x), y = 2 x + u; event indicator z = x - 0.5, whose crossing adds 100 to n; time events at start + k 0.1 add 1
   to n, and every third one 0.25 to x. References: 0 time, 1 gain, 2 u, 3 x, 4 der(x), 5 y, 6 d (discrete, without use), 7 n, 8 z,
   9 above (Boolean: x was above 0.5 at the last event). */
#include "fault.h"
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { INSTANTIATED = 1, INITIALIZATION = 2, EVENT = 4, CONTINUOUS = 8, STEP = 16, TERMINATED = 32, FAILED = 64, ANY = 127 };
#define EVALUATED (INITIALIZATION | EVENT | CONTINUOUS | STEP | TERMINATED)
#define EXPORT __attribute__((visibility("default")))

typedef struct {
    double start, t, gain, u, x, d;
    int n, k, above, mode, exchange, events, early, evaluations;
    double last_x, last_z, last_t, last_dx, shown;
} M;

typedef struct { bool again, terminate, nominals, states, defined; double next; } Update;

static int fail(M *m) { return m->mode = FAILED, ERROR; }
#define ENTER(allowed) do { if (!m) return ERROR; if (!(m->mode & (allowed))) return fail(m); } while (0)

static void fresh(M *m) {
    M kept = *m;
    memset(m, 0, sizeof *m);
    m->exchange = kept.exchange, m->events = kept.events, m->early = kept.early;
    m->gain = FAULT(STIFF) ? 1e4 : 1, m->x = 1, m->above = 1, m->mode = INSTANTIATED;
    if (FAULT(V07m) && m->exchange) m->x = 2;
    if (FAULT(E12) && kept.mode) m->x = kept.x;
    if (FAULT(E12m) && kept.mode == CONTINUOUS) m->mode = CONTINUOUS;
    if (FAULT(E12g) && kept.mode == CONTINUOUS) m->gain = kept.gain;
}

/* Instances that were made, and that were freed. */
static int made, gone;

static M *make(int exchange, int events, int early) {
    if (FAULT(E17) && exchange && made++) return NULL;
    if (FAULT(B07e) && exchange) *(volatile char *)malloc(5000) = 1;
    if (FAULT(B08e) && exchange) write(1, "hello\n", 6);
    if (FAULT(B08g) && exchange) setenv("MODE", "exchange", 1);
    if (FAULT(N00) && events) return NULL;
    M *m = calloc(1, sizeof *m);
    m->exchange = exchange, m->events = events, m->early = early;
    return fresh(m), m;
}

static double instant(const M *m) { return m->start + m->k * 0.1; }
static bool due(const M *m, double t) { return t >= instant(m) - 1e-6; }

static double slope(M *m) {
    if (FAULT(E16s) && m->mode == EVENT) return 0;
    double dx = m->gain * (m->u - m->x);
    if (FAULT(E17f)) dx += 0.01 * gone;
    if (FAULT(E06a)) {
        dx += 1e-4 * (m->x - m->last_x);
        m->last_x = m->x;
    }
    if (FAULT(E06k)) {
        if (m->t == m->last_t && m->last_t) return m->last_dx;
        m->last_t = m->t, m->last_dx = dx;
    }
    if (FAULT(E06b)) dx *= 1 + 1e-14 * (m->evaluations++ % 5);
    return dx;
}

static double indicator(const M *m) {
    double z = m->x - 0.5;
    if (FAULT(E25s)) return m->x > 0.9 ? 1 : -1;
    if (FAULT(E25)) return m->n > 3 && m->n < 8 ? 0 : z == 0 ? 1e-12 : z;
    return z == 0 ? 1e-12 : z;
}

static bool tick(M *m) {
    /* The event is due, and does nothing. */
    if (FAULT(E19t) && !m->exchange) return m->k++, false;
    m->n++, m->k++;
    if (m->k % 3) return false;
    m->x += 0.25;
    return true;
}

static int enter_initialization(M *m, double start) {
    ENTER(INSTANTIATED);
    return m->start = m->t = start, m->mode = INITIALIZATION, OK;
}

static int leave_initialization(M *m) {
    ENTER(INITIALIZATION);
    if (FAULT(G09m) && m->exchange) m->x = 1;
    return m->mode = m->exchange || m->events ? EVENT : STEP, OK;
}

static int update(M *m, Update *u) {
    memset(u, 0, sizeof *u);
    ENTER(FAULT(N05) ? EVENT | STEP : EVENT);
    while (due(m, m->t)) u->states |= tick(m);
    int above = m->x > 0.5;
    if (FAULT(E16d)) m->u = 0;
    if (above != m->above) m->above = above, m->n += 100;
    u->defined = true, u->next = instant(m);
    if (FAULT(E20) && m->k > 3) u->next = NAN;
    if (FAULT(E20s) && m->k > 3) u->next = INFINITY;
    if (FAULT(E21) && m->exchange) u->next -= m->t;
    if (FAULT(E22) && fabs(m->t - m->start - (m->k - 1) * 0.1) > 1e-6) u->defined = false;
    if (FAULT(E23)) u->again = m->k > 3;
    if (FAULT(E24a)) u->states = false;
    if (FAULT(E24b)) u->states = true;
    if (FAULT(E24n)) u->nominals = true;
    if (FAULT(N06) && !m->exchange) u->next -= 0.1;
    return OK;
}

static int enter_event(M *m) {
    ENTER(CONTINUOUS | (m->events || FAULT(N04) ? STEP : 0));
    if (FAULT(N07) && !m->exchange) m->x += 1e-3;
    return m->mode = EVENT, OK;
}

static int enter_continuous(M *m) {
    ENTER(m->exchange ? EVENT : 0);
    if (FAULT(E00)) return fail(m);
    if (FAULT(E16)) m->x += 1e-3;
    if (FAULT(E16u)) m->u = 0;
    if (FAULT(E16t)) m->t += 1e-3;
    return m->mode = CONTINUOUS, OK;
}

static int terminate(M *m) {
    ENTER((FAULT(E01) ? 0 : EVENT) | CONTINUOUS | STEP);
    return m->mode = TERMINATED, OK;
}

static int reset(M *m) { return m ? fresh(m), OK : ERROR; }

static int set_time(M *m, double t) {
    ENTER(CONTINUOUS);
    if (FAULT(E06t) && t < m->t) return fail(m);
    if (FAULT(E08b) && t < m->t) return OK;
    if (FAULT(B08f)) __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040);
    m->last_z = indicator(m);
    if (FAULT(E26)) m->n += t > m->t;
    return m->t = t, OK;
}

static int set_states(M *m, const double *x, size_t n) {
    ENTER(CONTINUOUS);
    if (!FAULT(E10) && n != 1) return fail(m);
    if (FAULT(E09) && !isfinite(x[0])) return fail(m);
    if (!isfinite(x[0])) return DISCARD;
    m->shown = m->x = x[0];
    if (FAULT(E05)) m->x = (float)x[0];
    return OK;
}

static int vector(M *m, double *to, size_t n, int which) {
    int allowed = FAULT(E01i) ? EVALUATED & ~INITIALIZATION : EVALUATED;
#ifndef FMI3
    if (which == 3) allowed |= INSTANTIATED;
#endif
    ENTER(allowed);
    if (!m->exchange) return fail(m);
    if (!FAULT(E10) && n != 1) return fail(m);
    double nominal = 2;
    if (FAULT(E04a)) nominal = 0;
    if (FAULT(E04b)) nominal = 3;
    if (FAULT(E06z) && which == 2 && m->mode == CONTINUOUS && m->last_z) return to[0] = m->last_z, OK;
    to[0] = which == 0 ? m->x : which == 1 ? slope(m) + (FAULT(E15) ? 0.1 : 0) : which == 2 ? indicator(m) : nominal;
    if (FAULT(E03) && which == 1) to[1] = 0;
    return OK;
}

static int completed(M *m) {
    ENTER(FAULT(E02) ? ANY : CONTINUOUS);
    m->shown = m->x;
    if (FAULT(E07)) m->x += 1e-6;
    if (FAULT(E07u)) m->u = 0;
    return OK;
}

static int get(M *m, const unsigned *vr, size_t n, double *to) {
#ifdef FMI3
    ENTER(ANY);
#else
    ENTER(EVALUATED | FAILED);
#endif
    for (size_t i = 0; i < n; i++) {
        double y = 2 * m->x + m->u, time = m->t;
        if (FAULT(NOISE)) y += rand() % 1000 * 1e-3;
        if (FAULT(E08)) time = m->start;
        if (FAULT(E11)) y += m->d;
        if (FAULT(E11h)) y += m->d * (m->x - 1);
        if (FAULT(NOT_YET) && m->mode == INSTANTIATED && vr[i] != 1) return fail(m);
        if (vr[i] == 7 || vr[i] > 8) return fail(m);
        const double all[] = {time, m->gain, m->u, FAULT(E15x) && m->mode == CONTINUOUS && m->shown ? m->shown : m->x, vr[i] == 4 ? slope(m) * (FAULT(T13) && !m->exchange ? 3 : 1) : 0, y, m->d, 0, indicator(m)};
        to[i] = all[vr[i]];
    }
    return OK;
}

static int set(M *m, const unsigned *vr, size_t n, const double *from) {
    ENTER(INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == 1 && m->mode & (INSTANTIATED | INITIALIZATION)) m->gain = from[i];
        else if (vr[i] == 2 && FAULT(E05u) && m->mode == EVENT) continue;
        else if (vr[i] == 2) m->u = from[i];
        else if (vr[i] == 3 && (m->mode == CONTINUOUS || (FAULT(STARTS) && m->mode == INSTANTIATED))) m->x = from[i];
        else if (vr[i] == 6 && m->mode != CONTINUOUS) m->d = from[i];
        else return fail(m);
    }
    return OK;
}

static int get_n(M *m, const unsigned *vr, size_t n, int *to) {
    ENTER(EVALUATED | FAILED | INSTANTIATED);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != 7) return fail(m);
        to[i] = m->n;
    }
    return OK;
}

static int get_above(M *m, const unsigned *vr, size_t n, int *to) {
    ENTER(EVALUATED | FAILED | INSTANTIATED);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != 9) return fail(m);
        to[i] = m->above;
        if (FAULT(E26b)) to[i] = (m->k + due(m, m->t)) % 2;
        if (FAULT(E26c)) to[i] = m->x > 0.9;
    }
    return OK;
}

/* Columns of the matrix: u, x; rows: der(x), x, y. */
static int entry(M *m, unsigned unknown, unsigned known, double *to) {
    if ((known != 2 && known != 3) || (unknown != 3 && unknown != 4 && unknown != 5)) return ERROR;
    *to = unknown == 4 ? (known == 2 ? m->gain : -m->gain) : unknown == 5 ? (known == 2 ? 1 : 2) : known == 3;
    if (FAULT(D01) && unknown == 5 && known == 3) *to = 2.1;
    return OK;
}

static int partial(M *m, const unsigned *u, size_t nu, const unsigned *k, size_t nk, const double *seed, size_t ns, double *to,
                   size_t nt, bool adjoint) {
    ENTER(EVENT | CONTINUOUS | STEP | TERMINATED | INITIALIZATION);
    if (FAULT(D05) && !m->exchange) return fail(m);
    if (!FAULT(D03) && (ns != (adjoint ? nu : nk) || nt != (adjoint ? nk : nu))) return fail(m);
    memset(to, 0, nt * sizeof *to);
    for (size_t i = 0; i < nu; i++) {
        for (size_t j = 0; j < nk; j++) {
            double a = 0;
            if (entry(m, u[i], k[j], &a) && !FAULT(D03)) return fail(m);
            if (FAULT(D02) && adjoint) a *= 1.01;
            if (FAULT(D01s) && !adjoint) to[i] += a;
            else if (FAULT(D02s) && adjoint) to[j] += a;
            else if (adjoint) to[j] += a * seed[i];
            else to[i] += a * seed[j];
        }
    }
    if (FAULT(D04)) m->x *= 1 + 1e-9;
    return OK;
}

static int step(M *m, double t, double h, bool *event, bool *early, double *last) {
    *event = *early = false;
    ENTER(STEP);
    if (!(h > 0 && h < 1e6) || !(fabs(t - m->t) <= 1e-6)) return fail(m);
    double end = t + h;
    while (m->t < end - 1e-9) {
        double to = fmin(end, fmax(instant(m), m->t));
        m->x = m->u + (m->x - m->u) * exp(-m->gain * (FAULT(E19) ? 0.2 : 1) * (to - m->t));
        m->t = to;
        if (!due(m, m->t)) continue;
        if (m->events) *event = true;
        if (m->early && to < end - 1e-9 && !(m->events && to == t)) {
            if (!m->events) tick(m);
            *early = true;
            break;
        }
        if (m->events && to >= end - 1e-9) break;
        tick(m);
        *event = false;
    }
    *last = m->t - (FAULT(LAST) && !*early ? 1e-4 * h : 0);
    if (FAULT(N01) && m->early && m->k > 4) return fail(m);
    if (FAULT(N02) && m->k == 5) *event = true;
    if (FAULT(N03) && *early) *last = t + 2 * h;
    if (FAULT(N03e) && m->early && m->k == 5) *early = true, *last = end;
    return OK;
}

static int load(M *m, const M *from) {
    if (!m || !from) return ERROR;
    if (FAULT(E14) && from->exchange != m->exchange) abort();
    if (from->exchange != m->exchange) return fail(m);
    int k = m->k;
    *m = *from;
    if (FAULT(E13)) m->k = k;
    if (FAULT(E13g)) m->gain = 1;
    return OK;
}

static int save(const M *m, M **to) {
    if (!m || !to) return ERROR;
    if (!*to) *to = malloc(sizeof(M));
    return **to = *m, OK;
}

static int drop(M **state) { return free(*state), *state = NULL, OK; }

#ifdef ALL_OF_EXCHANGE
#define NONE(name) EXPORT int fmi2##name(M *m) { return m ? fail(m) : ERROR; }
NONE(GetString) NONE(SetInteger) NONE(SetBoolean) NONE(SetString)
NONE(SerializedFMUstateSize) NONE(SerializeFMUstate) NONE(DeSerializeFMUstate)
#endif

#ifndef FMI3
typedef struct { int again, terminate, nominals, states, defined; double next; } EventInfo;

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *n, int type, const char *g, const char *r, const void *c, int v, int l) { return make(type == 0, 0, 0); }
EXPORT void fmi2FreeInstance(M *m) { gone++, free(m); }
EXPORT int fmi2SetDebugLogging(M *m, int on, size_t n, const char *const *c) { return m ? OK : ERROR; }
EXPORT int fmi2SetupExperiment(M *m, int a, double b, double start, int c, double d) { ENTER(INSTANTIATED); return m->start = start, OK; }
EXPORT int fmi2EnterInitializationMode(M *m) { return m ? enter_initialization(m, m->start) : ERROR; }
EXPORT int fmi2ExitInitializationMode(M *m) { return leave_initialization(m); }
EXPORT int fmi2Terminate(M *m) { return terminate(m); }
EXPORT int fmi2Reset(M *m) { return reset(m); }
EXPORT int fmi2GetReal(M *m, const unsigned *vr, size_t n, double *to) { return get(m, vr, n, to); }
EXPORT int fmi2SetReal(M *m, const unsigned *vr, size_t n, const double *from) { return set(m, vr, n, from); }
EXPORT int fmi2GetInteger(M *m, const unsigned *vr, size_t n, int *to) { return get_n(m, vr, n, to); }
EXPORT int fmi2GetBoolean(M *m, const unsigned *vr, size_t n, int *to) { return get_above(m, vr, n, to); }
EXPORT int fmi2GetFMUstate(M *m, M **to) { return save(m, to); }
EXPORT int fmi2SetFMUstate(M *m, M *from) { return load(m, from); }
EXPORT int fmi2FreeFMUstate(M *m, M **state) { return drop(state); }
EXPORT int fmi2DoStep(M *m, double t, double h, int p) {
    bool event, early;
    double last;
    return m ? step(m, t, h, &event, &early, &last) : ERROR;
}
EXPORT int fmi2EnterEventMode(M *m) { return enter_event(m); }
EXPORT int fmi2NewDiscreteStates(M *m, EventInfo *info) {
    Update u;
    int status = update(m, &u);
    *info = (EventInfo){u.again, u.terminate, u.nominals, u.states, u.defined, u.next};
    return status;
}
EXPORT int fmi2EnterContinuousTimeMode(M *m) { return enter_continuous(m); }
EXPORT int fmi2CompletedIntegratorStep(M *m, int p, int *event, int *end) { return *event = *end = 0, completed(m); }
EXPORT int fmi2SetTime(M *m, double t) { return set_time(m, t); }
EXPORT int fmi2SetContinuousStates(M *m, const double *x, size_t n) { return set_states(m, x, n); }
EXPORT int fmi2GetContinuousStates(M *m, double *to, size_t n) { return vector(m, to, n, 0); }
EXPORT int fmi2GetDerivatives(M *m, double *to, size_t n) { return vector(m, to, n, 1); }
EXPORT int fmi2GetEventIndicators(M *m, double *to, size_t n) { return vector(m, to, n, 2); }
EXPORT int fmi2GetNominalsOfContinuousStates(M *m, double *to, size_t n) { return vector(m, to, n, 3); }
EXPORT int fmi2GetDirectionalDerivative(M *m, const unsigned *u, size_t nu, const unsigned *k, size_t nk, const double *seed, double *to) {
    return partial(m, u, nu, k, nk, seed, nk, to, nu, false);
}
#else
EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT void *fmi3InstantiateCoSimulation(const char *n, const char *t, const char *r, bool v, bool l, bool events, bool early,
                                         const unsigned *q, size_t nq, void *e, void *log, void *up) { return make(0, events, early); }
EXPORT void *fmi3InstantiateModelExchange(const char *n, const char *t, const char *r, bool v, bool l, void *e, void *log) { return make(1, 0, 0); }
EXPORT void fmi3FreeInstance(M *m) { gone++, free(m); }
EXPORT int fmi3SetDebugLogging(M *m, bool on, size_t n, const char *const *c) { return m ? OK : ERROR; }
EXPORT int fmi3EnterInitializationMode(M *m, bool a, double b, double start, bool c, double d) { return enter_initialization(m, start); }
EXPORT int fmi3ExitInitializationMode(M *m) { return leave_initialization(m); }
EXPORT int fmi3Terminate(M *m) { return terminate(m); }
EXPORT int fmi3Reset(M *m) { return reset(m); }
EXPORT int fmi3GetFloat64(M *m, const unsigned *vr, size_t n, double *to, size_t nv) { return get(m, vr, n, to); }
EXPORT int fmi3SetFloat64(M *m, const unsigned *vr, size_t n, const double *from, size_t nv) { return set(m, vr, n, from); }
EXPORT int fmi3GetInt32(M *m, const unsigned *vr, size_t n, int *to, size_t nv) { return get_n(m, vr, n, to); }
EXPORT int fmi3GetBoolean(M *m, const unsigned *vr, size_t n, bool *to, size_t nv) {
    int wide[16] = {0};
    int status = n > 16 ? ERROR : get_above(m, vr, n, wide);
    for (size_t i = 0; status == OK && i < n; i++) to[i] = wide[i];
    return status;
}
EXPORT int fmi3GetFMUState(M *m, M **to) { return save(m, to); }
EXPORT int fmi3SetFMUState(M *m, M *from) { return load(m, from); }
EXPORT int fmi3FreeFMUState(M *m, M **state) { return drop(state); }
EXPORT int fmi3DoStep(M *m, double t, double h, bool p, bool *event, bool *end, bool *early, double *last) {
    return m ? *end = false, step(m, t, h, event, early, last) : ERROR;
}
EXPORT int fmi3EnterEventMode(M *m) { return enter_event(m); }
EXPORT int fmi3EnterStepMode(M *m) { ENTER(m->exchange ? 0 : EVENT); return m->mode = STEP, OK; }
EXPORT int fmi3UpdateDiscreteStates(M *m, bool *again, bool *end, bool *nominal, bool *state, bool *defined, double *next) {
    Update u;
    int status = update(m, &u);
    *again = u.again, *end = u.terminate, *nominal = u.nominals, *state = u.states, *defined = u.defined, *next = u.next;
    return status;
}
EXPORT int fmi3EnterContinuousTimeMode(M *m) { return enter_continuous(m); }
EXPORT int fmi3CompletedIntegratorStep(M *m, bool p, bool *event, bool *end) { return *event = *end = false, completed(m); }
EXPORT int fmi3SetTime(M *m, double t) { return set_time(m, t); }
EXPORT int fmi3SetContinuousStates(M *m, const double *x, size_t n) { return set_states(m, x, n); }
EXPORT int fmi3GetContinuousStates(M *m, double *to, size_t n) { return vector(m, to, n, 0); }
EXPORT int fmi3GetContinuousStateDerivatives(M *m, double *to, size_t n) { return vector(m, to, n, 1); }
EXPORT int fmi3GetEventIndicators(M *m, double *to, size_t n) { return vector(m, to, n, 2); }
EXPORT int fmi3GetNominalsOfContinuousStates(M *m, double *to, size_t n) { return vector(m, to, n, 3); }
EXPORT int fmi3GetNumberOfContinuousStates(M *m, size_t *n) { return *n = 1, OK; }
EXPORT int fmi3GetNumberOfEventIndicators(M *m, size_t *n) { return *n = 1, OK; }
EXPORT int fmi3GetDirectionalDerivative(M *m, const unsigned *u, size_t nu, const unsigned *k, size_t nk, const double *seed, size_t ns,
                                        double *to, size_t nt) {
    return partial(m, u, nu, k, nk, seed, ns, to, nt, false);
}
EXPORT int fmi3GetAdjointDerivative(M *m, const unsigned *u, size_t nu, const unsigned *k, size_t nk, const double *seed, size_t ns,
                                    double *to, size_t nt) {
    return partial(m, u, nu, k, nk, seed, ns, to, nt, true);
}
#endif
