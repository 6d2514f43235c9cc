/* Two small models with the C interfaces of FMI 2.0 and FMI 3.0, for tests of the importer. Each has the variables below.

   Plant (STATES = 1): x' = u - x, output x, and z = 1 - 2 u at every instant. At every crossing of x and level it notes the time in y and counts.
   Sampler (STATES = 0): at start + k T it samples the input i; from the next sample on its output y is 1 - 2 i of that sample.

   Both refuse a step that does not begin where they are, a discrete input outside of event mode (Model Exchange), and an update
   of discrete states in another mode. `fault` selects what a model does wrong. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { U = 1, X, DER_X, I, Y, T, LEVEL, COUNT, FAULT, Z, TOLERANCE, PRIOR, N };
enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING };
enum { RESTLESS = 1, NAN_DERIVATIVE, DISCARDS, ZERO_NOMINAL, SAME_EVENT, FAILS, STEP_EVENTS, TERMINATES, FLIPS, NAN_STATE, NEW_NOMINAL, NO_SOLUTION, BEFORE };

typedef void (*Log3)(void *, int, const char *, const char *);
typedef struct {
    double t, start, v[N], computed;
    int k, calls;
    bool above, events, early, initial, in_event, exchange;
    void *environment;
    Log3 log;
} M;

typedef struct { bool again, terminate, nominals, states, defined; double next; } Update;

static M *make(bool exchange, bool events, bool early, void *environment, Log3 log) {
    M *m = calloc(1, sizeof(M));
    m->v[X] = 1, m->v[T] = 0.1, m->v[LEVEL] = -1;
    m->initial = true, m->exchange = exchange, m->events = events || exchange, m->early = early;
    m->environment = environment, m->log = log;
    return m;
}

/* A run of these models makes some thousand calls: an importer that goes round in a circle ends here, and does not hang. */
static void count(M *m) {
    if (++m->calls > 1000000) fputs("the importer makes an endless number of calls\n", stderr), abort();
}

static bool fault(M *m, int which) { return m->v[FAULT] == which; }
static double instant(M *m) { return fma(m->k, m->v[T], m->start); }
static bool due(M *m, double t) { return !STATES && t >= instant(m) - 1e-5 * m->v[T]; }

static int begin(M *m) {
    if (due(m, m->t)) m->v[Y] = m->computed;
    return m->in_event = true, OK;
}

static int leave(M *m) { return m->in_event = false, OK; }

static void sample(M *m) {
    m->computed = 1 - 2 * m->v[I];
    m->v[COUNT]++, m->k++;
}

static int update(M *m, Update *u) {
    bool above = m->v[X] > m->v[LEVEL];
    count(m);
    memset(u, 0, sizeof *u);
    if (!m->in_event) return ERROR;
    if (!STATES) {
        while (due(m, m->t)) sample(m);
        u->defined = true, u->next = instant(m);
    } else if (above != m->above) {
        m->above = above, m->v[Y] = m->t, m->v[COUNT]++;
    }
    if (fault(m, RESTLESS)) u->again = true;
    if (fault(m, FLIPS)) m->v[Y] = 1 - m->v[Y];
    if (fault(m, SAME_EVENT)) u->defined = true, u->next = m->t;
    if (fault(m, TERMINATES)) u->terminate = m->t >= 0.5;
    if (fault(m, NAN_STATE) && m->v[COUNT] > 0) m->v[X] = NAN, u->states = true;
    if (fault(m, NEW_NOMINAL) && m->v[COUNT] > 0) u->nominals = true;
    return OK;
}

static int derivative(M *m, double *dx) {
    count(m);
    *dx = m->v[U] - m->v[X];
    if (fault(m, NAN_DERIVATIVE) && m->t > 0.5) *dx = NAN;
    if (fault(m, DISCARDS) && m->v[X] < 0.5) return DISCARD;
    if (fault(m, FAILS) && m->t > 0.5) {
        if (m->log) m->log(m->environment, ERROR, "", "the plant has failed");
        return ERROR;
    }
    return OK;
}

static int get(M *m, const uint32_t *vr, size_t n, double *to) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == DER_X) derivative(m, to + i);
        else if (vr[i] == Z) to[i] = fault(m, NO_SOLUTION) ? 1 + m->v[U] * m->v[U] : 1 - 2 * m->v[U];
        else to[i] = m->v[vr[i]];
    }
    return OK;
}

static int set(M *m, const uint32_t *vr, size_t n, const double *from) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == I && m->exchange && !m->initial && !m->in_event) return ERROR;
        m->v[vr[i]] = from[i];
    }
    return OK;
}

static int leave_initialization(M *m) {
    m->t = m->start, m->above = m->v[X] > m->v[LEVEL], m->initial = false;
    if (m->events) begin(m);
    return OK;
}

static int step(M *m, double t, double h, bool *event, bool *early, double *last) {
    double end = t + h, width = 1e-5 * m->v[T];
    count(m);
    *event = *early = false;
    if (m->in_event || fabs(t - m->t) > width) return ERROR;
#ifdef LONGEST
    /* Of two halves of a step, the state changes also where it is discarded. */
    m->v[X] += h > LONGEST && t > 0.25;
    if (h > LONGEST && t > 0.25) return DISCARD;
    m->v[Y]++;
#endif
    if (STATES) {
        m->v[X] = m->v[U] + (m->v[X] - m->v[U]) * exp(-h);
    } else {
        for (; instant(m) < end - width; sample(m)) {
            if (instant(m) > t + width && m->early) {
                *early = true, *event = m->events, end = instant(m);
                break;
            }
            m->v[Y] = m->computed;
        }
        if (m->events && instant(m) <= end + width) *event = true;
        if (!m->events && instant(m) <= end + width) m->v[Y] = m->computed;
    }
    m->t = *last = end;
    if (fault(m, BEFORE)) *early = true, *last = t - h;
    return OK;
}

static int states(M *m, double *x) { return x[0] = m->v[X], OK; }
static int nominals(M *m, double *x) {
    bool bad = fault(m, ZERO_NOMINAL) || (fault(m, NEW_NOMINAL) && m->v[COUNT] > 0);
    return x[0] = bad ? 0 : 1, OK;
}
static int indicators(M *m, double *z) { return z[0] = m->v[X] - m->v[LEVEL], OK; }

/* FMI 2.0 */
typedef struct { void (*logger)(void *, const char *, int, const char *, const char *, ...); void *a, *b, *c, *environment; } Callbacks;
typedef struct { int again, terminate, nominals, states, defined; double next; } EventInfo;

void *fmi2Instantiate(const char *n, int type, const char *g, const char *r, const Callbacks *c, int v, int l) {
    return make(type == 0, false, false, c->environment, NULL);
}
void fmi2FreeInstance(M *m) { free(m); }
int fmi2SetupExperiment(M *m, int a, double b, double start, int c, double d) { return m->v[TOLERANCE] = a ? b : -1, m->start = m->t = start, OK; }
int fmi2EnterInitializationMode(M *m) { return OK; }
int fmi2ExitInitializationMode(M *m) { return leave_initialization(m); }
int fmi2Terminate(M *m) { return OK; }
int fmi2Reset(M *m) { return ERROR; }
int fmi2GetReal(M *m, const uint32_t *vr, size_t n, double *to) { return get(m, vr, n, to); }
int fmi2SetReal(M *m, const uint32_t *vr, size_t n, const double *from) { return set(m, vr, n, from); }
int fmi2GetInteger(M *m, const uint32_t *vr, size_t n, int *to) { return ERROR; }
int fmi2SetInteger(M *m, const uint32_t *vr, size_t n, const int *from) { return ERROR; }
int fmi2GetBoolean(M *m, const uint32_t *vr, size_t n, int *to) { return ERROR; }
int fmi2SetBoolean(M *m, const uint32_t *vr, size_t n, const int *from) { return ERROR; }
int fmi2GetString(M *m, const uint32_t *vr, size_t n, const char **to) { return ERROR; }
int fmi2SetString(M *m, const uint32_t *vr, size_t n, const char *const *from) { return ERROR; }
int fmi2DoStep(M *m, double t, double h, int p) {
    bool event, early;
    double last;
    m->v[PRIOR] = p;
#ifdef ASYNCHRONOUS
    /* It returns Pending, and is done when it has been asked three times. */
    m->v[Y] = 3;
    return step(m, t, h, &event, &early, &last) ? ERROR : PENDING;
#endif
    return step(m, t, h, &event, &early, &last);
}
#ifdef ASYNCHRONOUS
int fmi2GetStatus(M *m, int kind, int *to) { return kind == 0 ? (*to = m->v[Y]-- > 0 ? PENDING : OK, OK) : DISCARD; }
#endif
int fmi2GetFMUstate(M *m, M **to) { return *to = memcpy(*to ? *to : malloc(sizeof(M)), m, sizeof(M)), OK; }
int fmi2SetFMUstate(M *m, M *from) { return memcpy(m, from, sizeof(M)), OK; }
int fmi2FreeFMUstate(M *m, M **state) { return free(*state), *state = NULL, OK; }
int fmi2EnterEventMode(M *m) { return begin(m); }
int fmi2NewDiscreteStates(M *m, EventInfo *info) {
    Update u;
    int status = update(m, &u);
    *info = (EventInfo){u.again, u.terminate, u.nominals, u.states, u.defined, u.next};
    return status;
}
int fmi2EnterContinuousTimeMode(M *m) { return leave(m); }
int fmi2CompletedIntegratorStep(M *m, int p, int *event, int *terminate) {
    return *event = fault(m, STEP_EVENTS), *terminate = 0, m->v[COUNT] += fault(m, STEP_EVENTS), OK;
}
int fmi2SetTime(M *m, double t) { return m->t = t, OK; }
int fmi2SetContinuousStates(M *m, const double *x, size_t n) { return m->v[X] = x[0], OK; }
int fmi2GetDerivatives(M *m, double *dx, size_t n) { return derivative(m, dx); }
int fmi2GetEventIndicators(M *m, double *z, size_t n) { return indicators(m, z); }
int fmi2GetContinuousStates(M *m, double *x, size_t n) { return states(m, x); }
int fmi2GetNominalsOfContinuousStates(M *m, double *x, size_t n) { return nominals(m, x); }
int fmi2GetDirectionalDerivative(M *m, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, double *to) {
    for (size_t i = 0; i < nu; i++) {
        to[i] = 0;
        for (size_t j = 0; j < nk; j++) to[i] += seed[j] * (u[i] == Z ? (k[j] == U ? -2 : 0) : k[j] == U ? 1 : -1);
    }
    return OK;
}

/* FMI 3.0 */
void *fmi3InstantiateCoSimulation(const char *n, const char *t, const char *r, bool v, bool l, bool events, bool early,
                                  const uint32_t *i, size_t ni, void *environment, Log3 log, void *u) {
    return make(false, events, early, environment, log);
}
#ifndef WITHOUT_EXCHANGE
void *fmi3InstantiateModelExchange(const char *n, const char *t, const char *r, bool v, bool l, void *environment, Log3 log) {
    return make(true, false, false, environment, log);
}
#endif
void fmi3FreeInstance(M *m) { free(m); }
int fmi3EnterInitializationMode(M *m, bool a, double b, double start, bool c, double d) { return m->v[TOLERANCE] = a ? b : -1, m->start = m->t = start, OK; }
int fmi3ExitInitializationMode(M *m) { return leave_initialization(m); }
int fmi3Terminate(M *m) { return OK; }
int fmi3Reset(M *m) { return ERROR; }
int fmi3GetFloat64(M *m, const uint32_t *vr, size_t n, double *to, size_t nv) { return get(m, vr, n, to); }
int fmi3SetFloat64(M *m, const uint32_t *vr, size_t n, const double *from, size_t nv) { return set(m, vr, n, from); }
int fmi3DoStep(M *m, double t, double h, bool p, bool *event, bool *terminate, bool *early, double *last) {
    return m->v[PRIOR] = p, *terminate = false, step(m, t, h, event, early, last);
}
int fmi3EnterEventMode(M *m) { return begin(m); }
int fmi3EnterStepMode(M *m) { return leave(m); }
int fmi3UpdateDiscreteStates(M *m, bool *again, bool *terminate, bool *nominal, bool *state, bool *defined, double *next) {
    Update u;
    int status = update(m, &u);
    *again = u.again, *terminate = u.terminate, *nominal = u.nominals, *state = u.states, *defined = u.defined, *next = u.next;
    return status;
}
int fmi3EnterContinuousTimeMode(M *m) { return leave(m); }
int fmi3CompletedIntegratorStep(M *m, bool p, bool *event, bool *terminate) {
    return *event = fault(m, STEP_EVENTS), *terminate = false, m->v[COUNT] += fault(m, STEP_EVENTS), OK;
}
int fmi3SetTime(M *m, double t) { return m->t = t, OK; }
int fmi3SetContinuousStates(M *m, const double *x, size_t n) { return m->v[X] = x[0], OK; }
int fmi3GetContinuousStateDerivatives(M *m, double *dx, size_t n) { return derivative(m, dx); }
int fmi3GetEventIndicators(M *m, double *z, size_t n) { return indicators(m, z); }
int fmi3GetContinuousStates(M *m, double *x, size_t n) { return states(m, x); }
int fmi3GetNominalsOfContinuousStates(M *m, double *x, size_t n) { return nominals(m, x); }
int fmi3GetNumberOfContinuousStates(M *m, size_t *n) { return *n = STATES, OK; }
int fmi3GetNumberOfEventIndicators(M *m, size_t *n) { return *n = STATES, OK; }
int fmi3GetDirectionalDerivative(M *m, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, size_t ns,
                                 double *to, size_t nt) {
    return ns == nk && nt == nu ? fmi2GetDirectionalDerivative(m, u, nu, k, nk, seed, to) : ERROR;
}
int fmi3GetFMUState(M *m, M **to) { return *to = memcpy(*to ? *to : malloc(sizeof(M)), m, sizeof(M)), OK; }
int fmi3SetFMUState(M *m, M *from) { return memcpy(m, from, sizeof(M)), OK; }
int fmi3FreeFMUState(M *m, M **state) { return free(*state), *state = NULL, OK; }
