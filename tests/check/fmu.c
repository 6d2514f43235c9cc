/* A small FMU for co-simulation, FMI 2.0, that breaks no rule; and with -DFAULT_<name> exactly one, or it is allowed and rude.
   fmu3.c makes FMI 3.0 of it.
   y' = gain u + bias; n counts steps. Integers: 0 n. Booleans: 0 flag. Strings: 0 label.
   Reals: 0 time, 1 gain, 2 u, 3 y, 4 bias. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

/* The fifth step ends the simulation. */
#if defined FAULT_ENDS || defined FAULT_T12t || defined FAULT_T12e || defined FAULT_T12s
#define ENDS
#endif

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, TERMINATED = 8, FAILED = 16, ANY = 31 };
#ifdef FMI3
#define READABLE ANY
#else
#define READABLE (INITIALIZATION | STEP | TERMINATED | FAILED)
#endif

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished;
    void *environment;
} Callbacks;

typedef struct {
    double start, time, stop, gain, u, y, bias;
    int32_t n, flag, state, has_stop, ready, steps;
    char label[64];
    uint64_t extra;
#ifdef FMI3
    uint64_t frame_size;
    uint8_t frame[64];
#endif
} Data;

typedef struct {
    Data data;
    Callbacks callbacks;
    const Callbacks *kept;
    int logging;
    char *label;
    char name[64];
} Fmu;

typedef struct { uint32_t magic, size, sum, zero; Data data; } Blob;
#define MAGIC 0x31554d46u
#define GUID "{c0ffee00-1234-5678-9abc-def012345678}"
#define EXPORT __attribute__((visibility("default")))

static int say(Fmu *f, int status, const char *text) {
    const Callbacks *c = &f->callbacks;
#ifdef FAULT_L02
    c = f->kept;
#endif
    if (status < ERROR && !f->logging) {
#ifndef FAULT_G_L5
        return status;
#endif
    }
#ifdef FAULT_G_L3a
    return status;
#endif
#ifndef FAULT_L01b
    if (!c->logger) return status;
#endif
    const char *category = status == ERROR ? "logStatusError" : "logEvents";
    void *environment = c->environment;
#ifdef FAULT_G_L1b
    category = "other";
#endif
#ifdef FAULT_G_L4
    environment = NULL;
#endif
#ifdef FAULT_G_L3b
    (void)text;
    text = "something\n";
#endif
#ifdef FMI3
    ((void (*)(void *, int, const char *, const char *))c->logger)(environment, status, category, text);
#else
    c->logger(environment, f->name, status, category, "%s", text);
#endif
    return status;
}

static int fail(Fmu *f, const char *text) {
#ifndef FAULT_L09a
    f->data.state = FAILED;
#endif
    return say(f, ERROR, text);
}

#define ENTER(allowed) \
    Fmu *f = c; \
    if (!f) return ERROR; \
    if (!(f->data.state & (allowed))) return fail(f, "not allowed in this state")

#ifdef FAULT_ONCE
static int alive;
#endif

static void fresh(Data *d) {
    memset(d, 0, sizeof *d);
    d->gain = 2;
    d->n = 1;
    d->state = INSTANTIATED;
    strcpy(d->label, "a");
#ifdef FMI3
    d->frame_size = 3;
    memcpy(d->frame, "foo", 3);
#endif
#ifdef FAULT_V07
    d->gain = 3;
#endif
}

/* What is legal or beside the point, and no violation of a must. */
#ifdef FAULT_CHDIR
__attribute__((constructor)) static void leave(void) { chdir("/"); }
#endif
#ifdef FAULT_FEWFILES
__attribute__((constructor)) static void starve(void) { setrlimit(RLIMIT_NOFILE, &(struct rlimit){8, 8}); }
#endif

#ifdef FAULT_UNDEFINED
extern int nowhere(void);
int (*missing)(void) = nowhere;
#endif

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
#ifdef FAULT_X02b
EXPORT const char *fmi2GetVersion(void) { return "2.0.5"; }
#else
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
#endif

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *where, const Callbacks *callbacks,
                             int visible, int logging) {
    (void)where; (void)visible;
#ifndef FAULT_L01a
    if (!name || !*name) return NULL;
    if (!guid) return NULL;
#endif
#ifndef FAULT_X04
    if (guid && strcmp(guid, GUID)) return NULL;
#endif
#ifndef FAULT_L03
    if (type != 1) return NULL;
#endif
#ifdef FAULT_L01c
    if (!where) return NULL;
#endif
    (void)type;
    if (!callbacks) return NULL;
#ifdef FAULT_Z09
    if (where && strlen(where) > 240) return NULL;
#endif
#ifdef FAULT_B08p
    socket(AF_UNIX, SOCK_STREAM, 0);
#endif
#ifdef FAULT_B08p_child
    if (fork() == 0) for (;;) pause();
#endif
#ifdef FAULT_B08p_daemon
    // Its parent ends at once and is waited for: nobody is left who knows it.
    pid_t parent = fork();
    if (parent == 0) {
        setsid();
        if (fork() == 0) for (;;) pause();
        _exit(0);
    }
    waitpid(parent, NULL, 0);
#endif
#ifdef FAULT_HANG
    for (volatile int spin = 1; spin;) {}
#endif
#ifdef FAULT_ONCE
    if (alive) return NULL;
    alive = 1;
#endif
#ifdef FAULT_M01
    Fmu *f = callbacks->allocate(1, sizeof *f);
#else
    Fmu *f = calloc(1, sizeof *f);
#endif
#ifdef FAULT_B07a
    volatile char *lost = malloc(16384);
    for (int i = 0; i < 16384; i++) lost[i] = 1;
#endif
    fresh(&f->data);
    f->callbacks = *callbacks;
    f->kept = callbacks;
    f->logging = logging;
    strncpy(f->name, name ? name : "", sizeof f->name - 1);
#ifdef FAULT_I02
    char path[2048];
    snprintf(path, sizeof path, "%s/../terminalsAndIcons/terminalsAndIcons.xml", where ? where + strlen("file://") : "");
    FILE *terminals = fopen(path, "r");
    if (where && !terminals) f->data.gain += 1;
    if (terminals) fclose(terminals);
#endif
    say(f, OK, "made");
    return f;
}

EXPORT void fmi2FreeInstance(void *c) {
#ifdef FAULT_ONCE
    alive = 0;
#endif
#ifdef FAULT_L05
    ((Fmu *)c)->logging = 0;
#endif
    if (!c) return;
#ifndef FAULT_M01
    free(((Fmu *)c)->label);
    free(c);
#endif
}

EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const names[]) {
#ifdef FAULT_L07
    ENTER(ANY & ~INITIALIZATION);
#else
    ENTER(ANY);
#endif
    for (size_t i = 0; i < n; i++) {
#ifdef FAULT_G_L2a
        return fail(f, "no categories, please");
#endif
#ifndef FAULT_G_L2b
        if (!names[i] || (strcmp(names[i], "logEvents") && strcmp(names[i], "logStatusError"))) return fail(f, "no such category");
#endif
    }
    (void)names;
    f->logging = on;
    return OK;
}

EXPORT int fmi2SetupExperiment(void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    ENTER(INSTANTIATED);
    (void)has_tolerance; (void)tolerance;
#ifdef FAULT_T01a
    if (start < 0) return fail(f, "before the beginning");
#endif
    f->data.start = f->data.time = start;
    f->data.has_stop = has_stop;
    f->data.stop = stop;
    f->data.ready = 1;
    return OK;
}

EXPORT int fmi2EnterInitializationMode(void *c) {
    ENTER(INSTANTIATED);
#ifdef FAULT_CRASH
    *(volatile int *)8 = 1;
#endif
    if (!f->data.ready) return fail(f, "fmi2SetupExperiment was not called");
    f->data.state = INITIALIZATION;
#ifdef FAULT_G09e
    f->data.y = 0;
#endif
    return OK;
}

EXPORT int fmi2ExitInitializationMode(void *c) {
    ENTER(INITIALIZATION);
    f->data.state = STEP;
#ifdef FAULT_G09x
    f->data.y *= 0.5;
#endif
    return OK;
}

EXPORT int fmi2Terminate(void *c) {
#ifdef FAULT_L08n
    if (((volatile Fmu *)c)->logging > 1) return ERROR;
    ENTER(STEP);
#elif defined FAULT_L08
    ENTER(ANY);
#else
    ENTER(STEP);
#endif
#ifdef FAULT_T12e
    if (f->data.steps >= 5) return fail(f, "the simulation has ended");
#endif
#ifdef FAULT_L10
    f->data.y = 1234;
#endif
#ifdef FAULT_B08
    printf("bye\n");
    fflush(stdout);
#endif
    if (f->data.state != FAILED) f->data.state = TERMINATED;
    return OK;
}

EXPORT int fmi2Reset(void *c) {
    ENTER(ANY);
#if defined FAULT_L06 || defined FAULT_G09r
    double y = f->data.y;
    fresh(&f->data);
    f->data.y = y;
#else
    fresh(&f->data);
#endif
    return OK;
}

static int bad(const unsigned *vr, size_t n, const void *values) {
#ifdef FAULT_G01b
    return n && !values;
#elif defined FAULT_G01a
    return !vr || !values;
#else
    return n && (!vr || !values);
#endif
}

#ifdef FAULT_G02
#define KNOWN(count) (vr[i] < (count) || vr[i] > 4)
#else
#define KNOWN(count) (vr[i] < (count))
#endif

EXPORT int fmi2GetReal(void *c, const unsigned vr[], size_t n, double values[]) {
    ENTER(READABLE);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (!KNOWN(5)) return fail(f, "no such Real");
        double y = f->data.y;
#ifdef FAULT_S04
        if (f->data.state == INITIALIZATION) y = f->data.gain;
#endif
#ifdef FAULT_L11
        if (f->data.state == INITIALIZATION && vr[i] == 3) y = f->data.y += 1e-6;
#endif
#ifdef FAULT_T10p
        y += getpid() * 1e-9;
#endif
        double time = f->data.time;
#ifdef FAULT_T06b
        time = f->data.start;
#endif
        const double all[] = {time, f->data.gain, f->data.u, y, f->data.bias};
        values[i] = all[vr[i] % 5];
    }
    return OK;
}

EXPORT int fmi2GetInteger(void *c, const unsigned vr[], size_t n, int values[]) {
    ENTER(READABLE);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
#ifdef FAULT_V12
        if (!KNOWN(4)) return fail(f, "no such Integer");
#else
        if (!KNOWN(1)) return fail(f, "no such Integer");
#endif
        values[i] = f->data.n;
#ifdef FAULT_V06b
        if (f->data.n > 3) values[i] = -7;
#endif
    }
    return OK;
}

EXPORT int fmi2GetBoolean(void *c, const unsigned vr[], size_t n, int values[]) {
    ENTER(READABLE);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (!KNOWN(1)) return fail(f, "no such Boolean");
        values[i] = f->data.flag;
    }
    return OK;
}

EXPORT int fmi2GetString(void *c, const unsigned vr[], size_t n, const char *values[]) {
    ENTER(READABLE);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (!KNOWN(1)) return fail(f, "no such String");
        values[i] = f->label ? f->label : f->data.label;
    }
    return OK;
}

EXPORT int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double values[]) {
    ENTER(INSTANTIATED | INITIALIZATION | STEP);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (int write = 0; write < 2; write++) {
#ifdef FAULT_G03c
        write = 1;
#endif
        for (size_t i = 0; i < n; i++) {
            if (!KNOWN(5)) return fail(f, "no such Real");
            switch (vr[i]) {
            case 1:
                if (f->data.state == STEP) return fail(f, "gain is fixed");
#ifndef FAULT_G07b
                if (!(values[i] >= 0 && values[i] <= 10)) return fail(f, "gain is out of range");
#endif
#ifdef FAULT_G04
                if (write) f->data.gain = (float)values[i] * 0.999;
#else
                if (write) f->data.gain = values[i];
#endif
                break;
            case 2:
                if (write) f->data.u = values[i];
                break;
#ifdef STARTS
            case 3:
#ifdef FAULT_G09i
                if (f->data.state == INSTANTIATED) return fail(f, "y is an output");
#endif
                if (f->data.state == STEP) return fail(f, "y starts only");
                if (write) f->data.y = values[i];
                break;
#endif
            case 4:
#ifdef FAULT_G06
                if (f->data.state == STEP) return fail(f, "bias is fixed");
#endif
                if (!isfinite(values[i])) return fail(f, "bias is not finite");
                if (write) f->data.bias = values[i];
                break;
#ifdef FAULT_G03b
            case 3:
                if (write) f->data.y = values[i];
                break;
#endif
#ifdef FAULT_G02
            default:
                if (vr[i] > 4) break;
                return fail(f, "cannot be set");
#else
            default: return fail(f, "cannot be set");
#endif
            }
        }
    }
    return OK;
}

EXPORT int fmi2SetInteger(void *c, const unsigned vr[], size_t n, const int values[]) {
    ENTER(INSTANTIATED | INITIALIZATION | STEP);
    if (bad(vr, n, values)) return fail(f, "NULL");
    return n ? fail(f, "no Integer can be set") : OK;
}

EXPORT int fmi2SetBoolean(void *c, const unsigned vr[], size_t n, const int values[]) {
    ENTER(INSTANTIATED | INITIALIZATION | STEP);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (!KNOWN(1)) return fail(f, "no such Boolean");
        if (f->data.state == STEP) return fail(f, "flag is fixed");
#ifdef FAULT_G08
        f->data.flag = values[i];
#else
        f->data.flag = values[i] != 0;
#endif
    }
    return OK;
}

EXPORT int fmi2SetString(void *c, const unsigned vr[], size_t n, const char *const values[]) {
    ENTER(INSTANTIATED | INITIALIZATION | STEP);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (!KNOWN(1)) return fail(f, "no such String");
        if (!values[i]) return fail(f, "NULL");
        if (f->data.state == STEP) return fail(f, "label is fixed");
#ifdef FAULT_G05
        f->label = (char *)values[i];
#else
        free(f->label);
        f->label = malloc(strlen(values[i]) + 1);
        strcpy(f->label, values[i]);
#endif
    }
    return OK;
}

EXPORT int fmi2GetFMUstate(void *c, void **state) {
    ENTER(INSTANTIATED | INITIALIZATION | STEP | TERMINATED);
    if (!state) return fail(f, "NULL");
#ifdef FAULT_F01b
    if (*state) return OK;
#endif
    if (!*state) *state = malloc(sizeof(Data));
    *(Data *)*state = f->data;
#ifdef FAULT_F04b
    ((Data *)*state)->extra = (uint64_t)(uintptr_t)f;
#endif
    return OK;
}

EXPORT int fmi2SetFMUstate(void *c, void *state) {
    ENTER(ANY);
#ifndef FAULT_F03b
    if (!state) return fail(f, "NULL");
#endif
#ifdef FAULT_F02s
    f->data = *(Data *)state;
    f->data.y *= 1 + 1e-12;
#elif defined FAULT_F02
    int32_t n = f->data.n;
    f->data = *(Data *)state;
    f->data.n = n;
#elif defined FAULT_TIME_STAYS
    double time = f->data.time;
    f->data = *(Data *)state;
    f->data.time = time;
#else
    f->data = *(Data *)state;
#endif
    return OK;
}

EXPORT int fmi2FreeFMUstate(void *c, void **state) {
    ENTER(ANY);
    if (!state) return OK;
#ifdef FAULT_F01a
    return OK;
#endif
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT int fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) {
    ENTER(ANY);
    if (!state || !size) return fail(f, "NULL");
    *size = sizeof(Blob);
    return OK;
}

static uint32_t sum(const void *data, size_t n) {
    uint32_t h = 2166136261u;
    for (size_t i = 0; i < n; i++) h = (h ^ ((const unsigned char *)data)[i]) * 16777619u;
    return h;
}

EXPORT int fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t size) {
    ENTER(ANY);
    if (!state || !bytes) return fail(f, "NULL");
#ifndef FAULT_F04d
    if (size != sizeof(Blob)) return fail(f, "another size");
#endif
    Blob blob = {MAGIC, sizeof(Blob), 0, 0, *(Data *)state};
#ifdef FAULT_F04a
    blob.data.n = 1;
#endif
    blob.sum = sum(&blob.data, sizeof blob.data);
    memcpy(bytes, &blob, sizeof blob);
    return OK;
}

EXPORT int fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t size, void **state) {
    ENTER(ANY);
    if (!bytes || !state || size != sizeof(Blob)) return fail(f, "no state");
    Blob blob;
    memcpy(&blob, bytes, sizeof blob);
#ifndef FAULT_F04c
    if (blob.magic != MAGIC || blob.size != sizeof blob || blob.zero || blob.sum != sum(&blob.data, sizeof blob.data)) return fail(f, "no state");
#endif
    *state = malloc(sizeof(Data));
    memcpy(*state, &blob.data, sizeof blob.data);
    return OK;
}

EXPORT int fmi2DoStep(void *c, double t, double h, int no_prior) {
    ENTER(STEP);
    (void)no_prior;
    Data *d = &f->data;
#ifdef FAULT_FATAL
    static int dead;
    dead |= d->bias == 9;
    if (dead) return FATAL;
#endif
#ifdef FAULT_PRINT
    printf("half a line, ");
    fflush(stdout);
#endif
#ifdef FAULT_T02b
    while (h > 1e307) {}
#endif
#ifdef FAULT_T02a
    if (h == 0) return OK;
#endif
    if (!(h > 0) || isinf(h) || !isfinite(t)) return fail(f, "the step is not positive");
#ifndef FAULT_T01b
    if (fabs(t - d->time) > h / 100 + 1e-14 * fabs(t)) return fail(f, "the step does not begin where the last ended");
#endif
#ifndef FAULT_L12
    if (d->has_stop && t + h > d->stop + 1e-9 * h + 1e-14 * fabs(t)) return fail(f, "beyond the stop time");
#endif
#ifdef FAULT_G07a
    while (d->u != d->u) {}
#endif
#ifdef FAULT_T04
    if (h > 0.02) return fail(f, "too long");
#endif
#ifdef FAULT_T01c
    if (d->steps > 400) return fail(f, "no more");
#endif
    if (!isfinite(d->u)) return fail(f, "u is not finite");
#if defined ENDS && !defined FAULT_T12s
    if (d->steps >= 5) return fail(f, "the simulation has ended");
#endif
#if defined ENDS && !defined FMI3
    if (d->steps == 4) {
        d->steps++;
        d->time = t + h / 2;
        return DISCARD;
    }
#endif
#ifdef FAULT_WAIT
    if (!isfinite(d->u) || d->steps == 3) pause();
#endif
#ifdef FAULT_B06
    volatile char large[400000];
    for (size_t i = 0; i < sizeof large; i += 512) large[i] = 1;
#endif
#ifdef FAULT_B08f
    __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040);
#endif
#ifdef FAULT_T05
    if (no_prior) d->y += 1e-2;
#endif
#ifdef FAULT_T05s
    if (no_prior) d->y *= 1 + 1e-12;
#endif
#ifdef FAULT_MEAN
    d->y = (pow(t + 1 + h, 3) - pow(t + 1, 3)) / (3 * h);
#elif defined FAULT_T03
    d->y += d->gain * d->u + d->bias;
#else
    d->y += (d->gain * d->u + d->bias) * h;
#endif
    d->n = d->n < 1000000 ? d->n + 1 : d->n;
    d->steps++;
    d->time = t + h;
    return OK;
}

static int none(void *c) {
    ENTER(ANY);
    return fail(f, "not supported");
}

EXPORT int fmi2GetDirectionalDerivative(void *c, const unsigned *a, size_t n, const unsigned *b, size_t m, const double *s, double *v) {
    (void)a; (void)n; (void)b; (void)m; (void)s; (void)v;
#ifdef FAULT_L08u
    return c ? OK : ERROR;
#else
    return none(c);
#endif
}
EXPORT int fmi2SetRealInputDerivatives(void *c, const unsigned *vr, size_t n, const int *o, const double *v) { (void)vr; (void)n; (void)o; (void)v; return none(c); }
EXPORT int fmi2GetRealOutputDerivatives(void *c, const unsigned *vr, size_t n, const int *o, double *v) {
#ifdef DERIVATIVES
    ENTER(STEP | TERMINATED);
    for (size_t i = 0; i < n; i++) {
#ifdef FAULT_T09e
        return fail(f, "no derivatives");
#endif
#ifdef ORDER_ZERO
        if (o[i] == 0) continue;
#endif
#ifndef FAULT_T09o
        if (o[i] != 1) return fail(f, "no such order");
#endif
        if (vr[i] != 3) return fail(f, "no output");
        v[i] = f->data.gain * f->data.u + f->data.bias;
#ifdef FAULT_MEAN
        v[i] = 2 * (f->data.time + 1);
#endif
#ifdef FAULT_T09v
        v[i] *= 2;
#endif
    }
    return OK;
#else
    (void)vr; (void)n; (void)o; (void)v;
    return none(c);
#endif
}
EXPORT int fmi2CancelStep(void *c) { return none(c); }

static int status(void *c, int kind) {
    (void)kind;
    ENTER(STEP | TERMINATED);
#ifdef FAULT_T07
    return fail(f, "no status");
#endif
    return DISCARD;
}
EXPORT int fmi2GetStatus(void *c, int kind, int *value) { (void)value; return status(c, kind); }
EXPORT int fmi2GetRealStatus(void *c, int kind, double *value) {
#ifdef FAULT_T12t
    if (c && kind == 2 && value && ((Fmu *)c)->data.steps >= 5) { *value = ((Fmu *)c)->data.time + 1; return OK; }
#endif
    if (c && kind == 2 && value) { *value = ((Fmu *)c)->data.time; return OK; }
    return status(c, kind);
}
EXPORT int fmi2GetIntegerStatus(void *c, int kind, int *value) { (void)value; return status(c, kind); }
EXPORT int fmi2GetBooleanStatus(void *c, int kind, int *value) {
#ifdef ENDS
    if (c && kind == 3 && value) { *value = ((Fmu *)c)->data.steps >= 5; return OK; }
#endif
    (void)value;
    return status(c, kind);
}
#ifndef FAULT_B01
EXPORT int fmi2GetStringStatus(void *c, int kind, const char **value) { (void)value; return status(c, kind); }
#endif
#ifdef FAULT_B02b
EXPORT int one, two, three;
#endif
