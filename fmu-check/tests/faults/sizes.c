/* A small FMU of FMI 3.0 with a tunable structural parameter n (1) and a fixed one k (2), which size the input u (3), the output y (4)
   and the parameter g (5); with the faults of fault.h. */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "fault.h"

#define EXPORT __attribute__((visibility("default")))
#define MOST 8
enum { OK, WARNING, DISCARD, ERROR };
enum { INSTANTIATED, CONFIGURATION, INITIALIZATION, STEP, RECONFIGURATION, TERMINATED, BROKEN };

typedef const unsigned *Refs;
typedef struct {
    int state;
    uint64_t n, k;
    /* What the arrays have. */
    size_t has_n, has_k;
    double u[MOST], y[MOST], g[MOST];
} Fmu;

static const Fmu START = {INSTANTIATED, 2, 3, 2, 3, {0}, {0}, {1, 1, 1}};

static int fail(Fmu *f) { f->state = BROKEN; return ERROR; }

#define IN(condition) Fmu *f = c; if (!f) return ERROR; if (!(condition)) return fail(f)

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token) {
    (void)name; (void)token;
    Fmu *f = malloc(sizeof *f);
    *f = START;
    return f;
}
EXPORT void fmi3FreeInstance(void *c) { free(c); }
EXPORT int fmi3EnterInitializationMode(void *c) { IN(f->state == INSTANTIATED); f->state = INITIALIZATION; return OK; }
EXPORT int fmi3ExitInitializationMode(void *c) { IN(f->state == INITIALIZATION); f->state = STEP; return OK; }
EXPORT int fmi3Terminate(void *c) { IN(f->state == STEP); f->state = TERMINATED; return OK; }
EXPORT int fmi3Reset(void *c) {
    IN(true);
    if (FAULT(C10)) f->state = INSTANTIATED;
    else *f = START;
    return OK;
}
EXPORT int fmi3EnterConfigurationMode(void *c) {
    IN(f->state == INSTANTIATED || f->state == STEP && !FAULT(C08));
    f->state = f->state == STEP ? RECONFIGURATION : CONFIGURATION;
    return OK;
}
EXPORT int fmi3ExitConfigurationMode(void *c) {
    IN(f->state == CONFIGURATION || f->state == RECONFIGURATION);
    f->state = f->state == RECONFIGURATION ? STEP : INSTANTIATED;
    if (f->n > MOST || f->k > MOST) return fail(f);
    if (FAULT(C04)) return OK;
    f->has_n = f->n;
    f->has_k = f->k;
    return OK;
}

EXPORT int fmi3GetUInt64(void *c, Refs vr, size_t n, uint64_t v[], size_t m) {
    IN(n == m);
    for (size_t i = 0; i < n; i++) v[i] = vr[i] == 1 ? f->n : f->k;
    return OK;
}
EXPORT int fmi3SetUInt64(void *c, Refs vr, size_t n, const uint64_t v[], size_t m) {
    IN(n == m && (f->state == CONFIGURATION || f->state == RECONFIGURATION));
    for (size_t i = 0; i < n; i++) {
        if ((v[i] < 1 || v[i] > 5) && !FAULT(C07)) return fail(f);
        if (f->state == RECONFIGURATION && vr[i] == 2 && !FAULT(C08f)) return fail(f);
        *(vr[i] == 1 ? &f->n : &f->k) = v[i] < MOST ? v[i] : MOST;
    }
    return OK;
}

static double *place(Fmu *f, unsigned r, size_t *n) {
    *n = r == 5 ? f->has_k : f->has_n;
    return r == 3 ? f->u : r == 4 ? f->y : f->g;
}
EXPORT int fmi3GetFloat64(void *c, Refs vr, size_t n, double v[], size_t m) {
    IN(n == 1);
    size_t has;
    const double *from = place(f, vr[0], &has);
    if (m != has && !FAULT(C05)) return fail(f);
    memcpy(v, from, has * sizeof *v);
    return OK;
}
EXPORT int fmi3SetFloat64(void *c, Refs vr, size_t n, const double v[], size_t m) {
    IN(n == 1 && (f->state != CONFIGURATION && f->state != RECONFIGURATION || FAULT(C06)));
    size_t has;
    double *to = place(f, vr[0], &has);
    if (m != has && !FAULT(C05s) || m > MOST) return fail(f);
    memcpy(to, v, m * sizeof *v);
    return OK;
}
EXPORT int fmi3DoStep(void *c, double t, double h, bool no_prior, bool *event, bool *terminate, bool *early, double *last) {
    (void)no_prior;
    IN(f->state == STEP && (f->has_n == 2 || !FAULT(C04s)));
    for (size_t i = 0; i < f->has_n; i++) f->y[i] += h * f->u[i];
    *event = *terminate = *early = false;
    *last = t + h;
    return OK;
}

EXPORT int fmi3GetFMUState(void *c, void **state) {
    IN(true);
    if (!*state) *state = malloc(sizeof *f);
    memcpy(*state, f, sizeof *f);
    return OK;
}
EXPORT int fmi3SetFMUState(void *c, void *state) {
    IN(state);
    const Fmu now = *f;
    memcpy(f, state, sizeof *f);
    if (FAULT(C09)) {
        f->n = now.n;
        f->has_n = now.has_n;
    }
    return OK;
}
EXPORT int fmi3FreeFMUState(void *c, void **state) { (void)c; free(*state); *state = NULL; return OK; }
