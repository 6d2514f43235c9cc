/* A small FMU of FMI 3.0 with a clock of each kind (1 to 5), a counter n (10) and an input u (11) on the first, and an output y (12)
   that can be read inside steps: for co-simulation with Event Mode and intermediate updates, and for Scheduled Execution. With the
   faults of fault.h. */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "fault.h"

#define EXPORT __attribute__((visibility("default")))
enum { OK, WARNING, DISCARD, ERROR };
enum { INSTANTIATED, INITIALIZATION, STEP, EVENT, UPDATE, ACTIVATION, CLOCK_UPDATE, TERMINATED, BROKEN };
enum { SAMPLE = 1, SLOW, WAKE, HIT, OUT, N = 10, U, Y };

typedef const unsigned *Refs;
typedef void (*Intermediate)(void *, double, bool, bool, bool, bool, bool *, double *);
typedef struct {
    int state, qualifier, ticks;
    bool scheduled, early, active[6];
    double n, u, y, time;
    void *environment;
    Intermediate intermediate;
    void (*clocks)(void *), (*lock)(void), (*unlock)(void);
} Fmu;

static int fail(Fmu *f) { f->state = BROKEN; return ERROR; }

#define IN(condition) Fmu *f = c; if (!f) return ERROR; if (!(condition)) return fail(f)

static bool good(const char *name, const char *token) {
    if (!FAULT(L01a) && (!name || !*name || !token)) return false;
    return FAULT(X04) || !token || !strcmp(token, "{c0ffee00-1234-5678-9abc-def012345679}");
}

EXPORT const char *fmi3GetVersion(void) { return FAULT(X02b) ? "3.0.2" : "3.0"; }
EXPORT int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const names[]) {
    Fmu *f = c;
    if (!f || (n && FAULT(G_L2a))) return ERROR;
    for (size_t i = 0; i < n; i++) {
        if (!FAULT(G_L2b) && (!names[i] || strcmp(names[i], "logStatusError"))) return fail(f);
    }
    return OK;
}
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
    bool event_mode, bool early, Refs required, size_t n, void *environment, void *log, Intermediate intermediate) {
    if (!event_mode && !FAULT(K08)) return NULL;
    if (!good(name, token)) return NULL;
    Fmu *f = calloc(1, sizeof *f);
    f->early = early;
    f->environment = environment;
    f->intermediate = intermediate;
    return f;
}
EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible, bool logging,
    void *environment, void *log, void (*clocks)(void *), void (*lock)(void), void (*unlock)(void)) {
    if (!good(name, token)) {
        if (log && logging && !FAULT(G_L3c)) ((void (*)(void *, int, const char *, const char *))log)(environment, ERROR, "logStatusError", "wrong name or token");
        return NULL;
    }
    Fmu *f = calloc(1, sizeof *f);
    f->scheduled = true;
    f->environment = environment;
    f->clocks = clocks;
    f->lock = lock;
    f->unlock = unlock;
    return f;
}
EXPORT void fmi3FreeInstance(void *c) { free(c); }
EXPORT int fmi3EnterInitializationMode(void *c, bool has, double tolerance, double start) {
    IN(f->state == INSTANTIATED);
    f->time = start;
    f->state = INITIALIZATION;
    return OK;
}
EXPORT int fmi3ExitInitializationMode(void *c) {
    IN(f->state == INITIALIZATION);
    f->state = f->scheduled ? ACTIVATION : EVENT;
    return OK;
}
EXPORT int fmi3EnterEventMode(void *c) { IN(f->state == STEP); f->state = EVENT; return OK; }
EXPORT int fmi3EnterStepMode(void *c) { IN(f->state == EVENT); f->state = STEP; return OK; }
EXPORT int fmi3Terminate(void *c) {
    IN(f->state == STEP || f->state == EVENT || f->state == ACTIVATION || f->state == UPDATE && FAULT(U05));
    if (f->state != UPDATE) f->state = TERMINATED;
    return OK;
}

static void tick(Fmu *f, unsigned clock) {
    if (clock == SAMPLE) {
        f->n++;
        if (++f->ticks % 3 == 0) f->qualifier = 2;
        f->active[OUT] = f->ticks % 2;
    }
    if (clock == WAKE) f->qualifier = 0;
}

EXPORT int fmi3GetClock(void *c, Refs vr, size_t n, bool v[]) {
    IN(n == 1 && vr[0] >= SAMPLE && vr[0] <= OUT && (f->state == EVENT || f->state == CLOCK_UPDATE && !FAULT(P04)));
    v[0] = f->active[vr[0]] && !(FAULT(K02) && vr[0] != OUT);
    if (f->scheduled && !FAULT(P05)) f->active[vr[0]] = false;
    return OK;
}
EXPORT int fmi3SetClock(void *c, Refs vr, size_t n, const bool v[]) {
    IN(n == 1 && vr[0] >= SAMPLE && (vr[0] < OUT || vr[0] == OUT && FAULT(K06)) && (f->state == EVENT || f->state == STEP && FAULT(K06s)));
    if (vr[0] == HIT && FAULT(K00)) return fail(f);
    f->active[vr[0]] = v[0];
    return OK;
}
EXPORT int fmi3UpdateDiscreteStates(void *c, bool *again, bool *terminate, bool *nominals, bool *values, bool *defined, double *next) {
    IN(f->state == EVENT);
    *again = *terminate = *nominals = *values = *defined = false;
    for (unsigned i = SAMPLE; i <= HIT; i++) {
        if (f->active[i]) tick(f, i);
        f->active[i] = f->active[i] && FAULT(K01) && i == SLOW;
    }
    f->active[OUT] = false;
    return OK;
}
EXPORT int fmi3GetIntervalDecimal(void *c, Refs vr, size_t n, double x[], int qualifiers[]) {
    bool known = c && ((Fmu *)c)->state == INITIALIZATION;
    IN(n == 1 && (vr[0] == SAMPLE && known || vr[0] == WAKE && (known || f->state == EVENT || f->state == CLOCK_UPDATE)));
    x[0] = vr[0] == SAMPLE ? FAULT(K03) ? 0.2 : 0.1 : FAULT(K05) ? -0.01 : 0.03;
    qualifiers[0] = vr[0] == SAMPLE ? 2 : f->qualifier;
    if (vr[0] == WAKE && f->qualifier == 2 && !FAULT(K04)) f->qualifier = 1;
    return OK;
}
EXPORT int fmi3SetIntervalDecimal(void *c, Refs vr, size_t n, const double x[]) {
    IN(n == 1 && vr[0] == SLOW && x[0] > 0 && f->state == INITIALIZATION && !FAULT(K03f));
    return OK;
}
EXPORT int fmi3GetShiftDecimal(void *c, Refs vr, size_t n, double x[]) {
    IN(n == 1 && vr[0] == SAMPLE && f->state == INITIALIZATION);
    x[0] = FAULT(K03s) ? 0 : 0.05;
    return OK;
}

static void update_clocks(Fmu *f) {
    f->state = CLOCK_UPDATE;
    f->clocks(FAULT(P04e) ? NULL : f->environment);
    if (f->state == CLOCK_UPDATE) f->state = ACTIVATION;
}
EXPORT int fmi3ActivateModelPartition(void *c, unsigned clock, double t) {
    IN(f->state == ACTIVATION || (f->state == INSTANTIATED || f->state == INITIALIZATION) && f->scheduled && FAULT(P02));
    if ((clock < SAMPLE || clock > HIT) && !FAULT(P01) || clock == HIT && FAULT(P00)) return fail(f);
    if (f->lock || FAULT(P03n)) f->lock();
    f->time = t;
    tick(f, clock);
    if (f->unlock && !(FAULT(P03) && clock == SLOW)) f->unlock();
    if (f->active[OUT] || f->qualifier == 2) update_clocks(f);
    return f->state == BROKEN ? ERROR : OK;
}

EXPORT int fmi3GetFloat64(void *c, Refs vr, size_t n, double v[], size_t m) {
    IN(n == m && (f->state != UPDATE || !FAULT(U01)));
    for (size_t i = 0; i < n; i++) v[i] = vr[i] == N ? f->n : vr[i] == U ? f->u : vr[i] == Y ? f->y : f->time;
    if (f->state == STEP && f->intermediate && FAULT(U00g)) f->intermediate(f->environment, f->time, false, false, false, false, NULL, NULL);
    return OK;
}
EXPORT int fmi3SetFloat64(void *c, Refs vr, size_t n, const double v[], size_t m) {
    IN(n == 1 && vr[0] == U && (f->state == EVENT && (f->active[SAMPLE] || FAULT(K07)) || f->state < STEP || f->state == ACTIVATION));
    f->u = v[0];
    return OK;
}

/* Four internal steps; the importer is called after each. */
EXPORT int fmi3DoStep(void *c, double t, double h, bool no_prior, bool *event, bool *terminate, bool *early, double *last) {
    IN(f->state == STEP);
    *event = *terminate = *early = false;
    double end = t + h;
    for (int k = 1; k <= 4 && !*early; k++) {
        double next = k == 4 ? t + h : t + k * h / 4, until = next;
        if (next >= end) next = end;
        *early = next == end && end < t + h;
        f->y += next - f->time;
        f->time = next;
        if (!f->intermediate || *early) continue;
        bool asked = false, can = f->early || FAULT(U03);
        f->state = UPDATE;
        f->intermediate(FAULT(U00e) ? NULL : f->environment, FAULT(U00) ? next + h : next, true, true, true, can, &asked, &until);
        if (f->state != UPDATE) return fail(f);
        f->state = STEP;
        if (FAULT(U06)) f->y += 1e-3;
        if (asked && can && !FAULT(U02)) {
            end = until;
            *early = end <= next && end < t + h;
        }
    }
    *last = f->time;
    return OK;
}
