/* A small FMU for co-simulation, FMI 2.0, that breaks no rule; and with a fault of fault.h exactly one, or it is allowed and rude.
   fmu3.c makes FMI 3.0 of it.
   y' = gain u + bias; n counts steps. Integers: 0 n. Booleans: 0 flag, 1 high. Strings: 0 label.
   Reals: 0 time, 1 gain, 2 u, 3 y, 4 bias. */
#define _GNU_SOURCE
#include "fault.h"
#include <fcntl.h>
#include <locale.h>
#include <math.h>
#include <sched.h>
#include <signal.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/* The fifth step ends the simulation. */
#define ENDS (FAULT(ENDS) || FAULT(T12t) || FAULT(T12e) || FAULT(T12s))

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, TERMINATED = 8, FAILED = 16, ANY = 31 };
#ifdef FMI3
#define READABLE (FAULT(NOT_YET) ? ANY & ~INSTANTIATED : ANY)
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
    char label[104];
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
    char *title;
    char *label;
    int set, reset;
    char name[64];
    void **history;
    int unread;
} Fmu;

typedef struct { uint32_t magic, size, sum, zero; Data data; } Blob;
#define MAGIC 0x31554d46u
#define GUID "{c0ffee00-1234-5678-9abc-def012345678}"
#define EXPORT __attribute__((visibility("default")))

/* What all instances share by mistake. */
static Callbacks shared;

static int say(Fmu *f, int status, const char *text) {
    const Callbacks *c = &f->callbacks;
    if (FAULT(L02)) c = f->kept;
    if (FAULT(G_L4s)) c = &shared;
    if (FAULT(B08e) && status == ERROR) printf("%s\n", text), fflush(stdout);
    if (status < ERROR && !f->logging && !FAULT(G_L5)) return status;
    if (FAULT(G_L3a)) return status;
    if (!c->logger && !FAULT(L01b)) return status;
    const char *category = status == ERROR ? "logStatusError" : "logEvents";
    void *environment = c->environment;
    if (FAULT(G_L1b)) category = "other";
    if (FAULT(G_L4)) environment = NULL;
    if (FAULT(G_L3b)) text = "something\n";
    if (FAULT(G_L3u)) text = "y is %g";
    if (FAULT(G_L3x)) text = "y is \1";
    /* The name of the instance is part of a format. */
    char named[200], formatted[200];
    snprintf(named, sizeof named, "%s: %s", f->name, text);
    if (FAULT(G_L3n)) {
        snprintf(formatted, sizeof formatted, named, 12);
        text = formatted;
    }
#ifndef FMI3
    if (FAULT(G_L3f) && f->data.steps) {
        /* As a compiler passes it that calls through the register of the argument that is missing. */
        return c->logger(environment, f->name, status, category, "100%s of it", c->logger), status;
    }
    if (FAULT(G_L3p)) return c->logger(environment, f->name, status, category, "100% done", 7), status;
    if (FAULT(G_L3y)) return c->logger(environment, f->name, status, category, "100%yes"), status;
    if (FAULT(G_L3i)) return c->logger(environment, f->name, status, category, named, 12), status;
#endif
#ifdef FMI3
    ((void (*)(void *, int, const char *, const char *))c->logger)(environment, status, category, text);
#else
    c->logger(environment, f->name, status, category, "%s", text);
#endif
    return status;
}

static int fail(Fmu *f, const char *text) {
    if (!FAULT(L09a)) f->data.state = FAILED;
    return say(f, ERROR, text);
}

#define ENTER(allowed) \
    Fmu *f = c; \
    if (!f) return ERROR; \
    if (!(f->data.state & (allowed))) return fail(f, "not allowed in this state")

static int alive;
/* Instances that were freed. */
static int freed;
/* The instance that was made first. */
static Fmu *first;
static void *volatile lost;

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
    if (FAULT(V07)) d->gain = 3;
}

/* What is legal or beside the point, and no violation of a must. */
__attribute__((constructor)) static void loaded(void) {
    if (FAULT(CHDIR)) chdir("/");
    if (FAULT(FEWFILES)) setrlimit(RLIMIT_NOFILE, &(struct rlimit){8, 8});
}

#ifdef FAULT_UNDEFINED
extern int nowhere(void);
int (*missing)(void) = nowhere;
#endif

/* A file of the author's, and the name of a source, as a message has it. */
#ifdef FAULT_AUTHOR
const char *const table = "/home/ann/model/table.csv";
#endif
#ifdef SOURCE
const char *const source = "/home/ann/model/main.c:7: x > 0";
#endif

/* Writes a file and leaves it. */
static void leave(const char *folder, const char *name) {
    char path[2048];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    int file = open(path, O_CREAT | O_TRUNC | O_WRONLY, 0600);
    if (file >= 0) write(file, "x", 1), close(file);
}

/* Alters the process that the FMU is a guest of. */
static void alter(const char *where) {
    if (FAULT(LOCALE)) setlocale(LC_ALL, "C.UTF-8");
    if (FAULT(TIMER)) {
        struct sigevent nothing = {.sigev_notify = SIGEV_NONE};
        int timer;
        syscall(SYS_timer_create, CLOCK_MONOTONIC, &nothing, &timer);
    }
    if (FAULT(ALARM)) alarm(1000);
    if (FAULT(PROFILE)) setitimer(ITIMER_PROF, &(struct itimerval){{1000, 0}, {1000, 0}}, NULL);
    // One that is taken back is no alteration.
    if (FAULT(BRIEF)) alarm(1000), alarm(0);
    if (FAULT(AFFINITY)) {
        unsigned long first = 1;
        syscall(SYS_sched_setaffinity, 0, sizeof first, &first);
    }
    if (FAULT(NICE)) setpriority(PRIO_PROCESS, 0, 5);
    if (FAULT(LIMITS)) setrlimit(RLIMIT_STACK, &(struct rlimit){1 << 20, 1 << 20});
    if (FAULT(UMASK)) umask(0);
    if (FAULT(ENVIRONMENT)) setenv("LC_NUMERIC", "de_DE", 1);
    char name[64];
    snprintf(name, sizeof name, "fault-of-fmu-check-%d", getpid());
    if (FAULT(SHARED)) leave("/dev/shm", name);
    if (FAULT(TEMPORARY)) leave(getenv("TMPDIR"), "fault-of-fmu-check");
    if (FAULT(WRITES)) leave(!strncmp(where, "file://", 7) ? where + 7 : where, "fault-of-fmu-check");
}

/* NULL, and the reason to the log. */
static void *refuse(const Callbacks *c, const char *name, int logging, const char *text) {
    if (FAULT(G_L3c) || !logging || !c || !c->logger) return NULL;
#ifdef FMI3
    ((void (*)(void *, int, const char *, const char *))c->logger)(c->environment, ERROR, "logStatusError", text);
#else
    c->logger(c->environment, name ? name : "", ERROR, "logStatusError", "%s", text);
#endif
    return NULL;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return FAULT(X02b) ? "2.0.5" : "2.0"; }

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *where, const Callbacks *callbacks,
                             int visible, int logging) {
    if (FAULT(RESERVES) && mmap(NULL, 8ull << 30, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0) == MAP_FAILED) return NULL;
    (void)where; (void)visible;
    if (!FAULT(L01a) && (!name || !*name || !guid)) return refuse(callbacks, name, logging, "no name or no GUID");
    if (!FAULT(X04) && guid && strcmp(guid, GUID)) return refuse(callbacks, name, logging, "another GUID");
    if (!FAULT(L03) && type != 1) return refuse(callbacks, name, logging, "co-simulation only");
    if (FAULT(L01c) && !where) return NULL;
    if (FAULT(L13) && strlen(name) > 255) return NULL;
    if (!callbacks) return NULL;
    if (FAULT(LICENSE)) return refuse(callbacks, name, logging, "the server has no license for this model");
    if (FAULT(SILENT)) return NULL;
    if (FAULT(FILES)) {
        int files[1200], n = 0;
        while (n < 1200 && (files[n] = open("/dev/null", O_RDONLY)) >= 0) n++;
        int all = n == 1200;
        while (n > 0) close(files[--n]);
        if (!all) return NULL;
    }
    if (FAULT(Z09s) && where && strstr(where, "%20")) return NULL;
    if (FAULT(Z09u) && where && !strncmp(where, "file:/", 6) && strncmp(where, "file:///", 8)) return NULL;
    if (FAULT(AGAIN) && freed) abort();
    if (FAULT(Z09) && where && strlen(where) > 240) return NULL;
    if (FAULT(B08p)) socket(AF_UNIX, SOCK_STREAM, 0);
    if (FAULT(B08p_child) && fork() == 0) for (;;) pause();
    if (FAULT(B08p_daemon)) {
        // Its parent ends at once and is waited for: nobody is left who knows it.
        pid_t parent = fork();
        if (parent == 0) {
            setsid();
            if (fork() == 0) for (;;) pause();
            _exit(0);
        }
        waitpid(parent, NULL, 0);
    }
    for (volatile int spin = 1; spin && FAULT(HANG);) {}
    if (FAULT(ONCE)) {
        if (alive) return NULL;
        alive = 1;
    }
    Fmu *f = FAULT(M01) ? callbacks->allocate(1, sizeof *f) : calloc(1, sizeof *f);
    if (FAULT(B07a)) {
        volatile char *lost = malloc(16384);
        for (int i = 0; i < 16384; i++) lost[i] = 1;
    }
    if (FAULT(B07m)) *(volatile char *)malloc(700) = 1;
    if (FAULT(B07u)) lost = malloc(16384);
    alter(where);
    if (FAULT(B08o)) open("/dev/null", O_RDONLY);
    fresh(&f->data);
    f->callbacks = *callbacks;
    f->kept = callbacks;
    shared = *callbacks;
    if (!first) first = f;
    f->logging = logging;
    strncpy(f->name, name ? name : "", sizeof f->name - 1);
    if (FAULT(I02)) {
        char path[2048];
        snprintf(path, sizeof path, "%s/../terminalsAndIcons/terminalsAndIcons.xml", where ? where + strlen("file://") : "");
        FILE *terminals = fopen(path, "r");
        if (where && !terminals) f->data.gain += 1;
        if (terminals) fclose(terminals);
    }
    say(f, OK, "made");
    return f;
}

EXPORT void fmi2FreeInstance(void *c) {
    freed++;
    if (FAULT(ONCE)) alive = 0;
    if (first == c) first = NULL;
    if (FAULT(L05)) ((Fmu *)c)->logging = 0;
    if (!c) return;
    Fmu *f = c;
    while (f->history) {
        void **next = *f->history;
        free(f->history);
        f->history = next;
    }
    if (!FAULT(G05)) free(f->label);
    if (FAULT(M01)) f->callbacks.release(f);
    else free(f);
}

EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const names[]) {
    ENTER(FAULT(L07) ? ANY & ~INITIALIZATION : ANY);
    for (size_t i = 0; i < n; i++) {
        if (FAULT(G_L2a)) return fail(f, "no categories, please");
        if (FAULT(G_L2b)) continue;
        if (!names[i] || (strcmp(names[i], "logEvents") && strcmp(names[i], "logStatusError"))) return fail(f, "no such category");
    }
    (void)names;
    f->logging = on;
    if (FAULT(G_L2c) && f->data.state == STEP) f->data.n = 0;
    return OK;
}

EXPORT int fmi2SetupExperiment(void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    ENTER(INSTANTIATED);
    (void)has_tolerance; (void)tolerance;
    if (FAULT(T01a) && start < 0) return fail(f, "before the beginning");
    f->data.start = f->data.time = start;
    f->data.has_stop = has_stop;
    f->data.stop = stop;
    f->data.ready = 1;
    return OK;
}

EXPORT int fmi2EnterInitializationMode(void *c) {
    ENTER(INSTANTIATED);
    if (FAULT(CRASH) || (FAULT(RESETS) && f->reset)) *(volatile int *)8 = 1;
    if (!f->data.ready) return fail(f, "fmi2SetupExperiment was not called");
    f->data.state = INITIALIZATION;
    if (FAULT(G09e)) f->data.y = 0;
    if (FAULT(G04i)) f->data.gain = 2;
    return OK;
}

EXPORT int fmi2ExitInitializationMode(void *c) {
    ENTER(INITIALIZATION);
    f->data.state = STEP;
    if (FAULT(G09x)) f->data.y *= 0.5;
    if (FAULT(L04g) && first && first != f) first->data.gain = f->data.gain;
    return OK;
}

EXPORT int fmi2Terminate(void *c) {
    if (FAULT(L08n) && ((volatile Fmu *)c)->logging > 1) return ERROR;
    ENTER(FAULT(L08) ? ANY : STEP);
    if (FAULT(L07t) && !f->data.steps) return fail(f, "no step was made");
    if (FAULT(T12e) && f->data.steps >= 5) return fail(f, "the simulation has ended");
    if (FAULT(L10)) f->data.y = 1234;
    if (FAULT(B08)) {
        printf("bye\n");
        fflush(stdout);
    }
    if (f->data.state != FAILED) f->data.state = TERMINATED;
    return OK;
}

/* A text that is too long for the data of the instance is no part of its state. */
static void forget_long_text(Fmu *f) {
    if (!FAULT(G05)) free(f->label);
    f->label = NULL;
}

EXPORT int fmi2Reset(void *c) {
    ENTER(ANY);
    Data before = f->data;
    fresh(&f->data);
    forget_long_text(f);
    if (FAULT(RESETS)) f->reset = 1;
    if (FAULT(L06) || FAULT(G09r)) f->data.y = before.y;
    if (FAULT(L06t)) f->data.bias = before.bias;
    if (FAULT(G_L3r)) f->callbacks.logger = NULL;
    if (FAULT(L06m) && before.state == STEP) f->data.state = STEP;
    if (FAULT(L06e) && before.y > 0) f->data.n = before.n;
    if (FAULT(L06s)) strcpy(f->data.label, before.label);
    return OK;
}

static int bad(const unsigned *vr, size_t n, const void *values) {
    if (FAULT(G01b)) return n && !values;
    if (FAULT(G01a)) return !vr || !values;
    return n && (!vr || !values);
}

#define KNOWN(count) (vr[i] < (count) || (FAULT(G02) && vr[i] > 4))

EXPORT int fmi2GetReal(void *c, const unsigned vr[], size_t n, double values[]) {
    ENTER(READABLE);
    f->unread = 0;
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        /* 200 more outputs, of which one is never known and one not written. */
        if (FAULT(WIDE) && vr[i] >= 100 && vr[i] < 300) {
            if (vr[i] == 250) return DISCARD;
            if (vr[i] != 251) values[i] = f->data.y + vr[i] + (FAULT(L04f) ? freed : 0);
            continue;
        }
        if (!KNOWN(5)) return fail(f, "no such Real");
        double y = f->data.state == TERMINATED && FAULT(L10y) ? 0 : f->data.y;
        if (FAULT(G16) && f->data.state == INITIALIZATION) y = 7;
        if (FAULT(G15r) && vr[i] == 1 && f->data.state == STEP) return fail(f, "gain is no more");
        if (FAULT(L10g) && vr[i] == 1 && (f->data.state == STEP || f->data.state == TERMINATED)) return fail(f, "gain is no more");
        if (FAULT(S04) && f->data.state == INITIALIZATION) y = f->data.gain;
        if (FAULT(S04h) && f->data.state == INITIALIZATION) y += f->data.bias * f->data.u;
        if (FAULT(T10t)) y += time(NULL) % 1000;
        if (FAULT(L04f)) y += freed;
        if (FAULT(NOISE)) y += rand() % 1000 * 1e-3;
        if (FAULT(CPU_TIME)) y += clock() * 1e-3;
        if (FAULT(L11) && f->data.state == INITIALIZATION && vr[i] == 3) y = f->data.y += 1e-6;
        if (FAULT(T10p)) y += getpid() * 1e-9;
        double now = FAULT(T06b) ? f->data.start : f->data.time;
        if (FAULT(T06n)) now = f->data.start + f->data.steps * 0.01;
        if (FAULT(T06i) && !f->data.steps) now = NAN;
        if (FAULT(T01s)) now -= f->data.start;
        const double all[] = {now, f->data.gain, f->data.u, y, f->data.bias};
        values[i] = all[vr[i] % 5];
        if (FAULT(NO_GET) && vr[i] == 4 && f->data.state == INITIALIZATION) return fail(f, "not now");
    }
    if (FAULT(G10) && n > 1) {
        double first = values[0];
        values[0] = values[n - 1], values[n - 1] = first;
    }
    return OK;
}

EXPORT int fmi2GetInteger(void *c, const unsigned vr[], size_t n, int values[]) {
    ENTER(READABLE);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (!KNOWN(FAULT(V12) ? 4 : 1)) return fail(f, "no such Integer");
        if (FAULT(G15) && f->data.n == 2) continue;
        values[i] = FAULT(V06b) && f->data.n > 3 ? -7 : f->data.n;
    }
    return OK;
}

/* The output that is true while y is above 0. */
#ifdef FMI3
#define HIGH 3
#else
#define HIGH 1
#endif

EXPORT int fmi2GetBoolean(void *c, const unsigned vr[], size_t n, int values[]) {
    ENTER(READABLE);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != HIGH && !KNOWN(1)) return fail(f, "no such Boolean");
        values[i] = vr[i] == HIGH ? (f->data.y > 0) * (FAULT(G11) ? 2 : 1) : f->data.flag;
    }
    return OK;
}

EXPORT int fmi2GetString(void *c, const unsigned vr[], size_t n, const char *values[]) {
    ENTER(READABLE);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (FAULT(TITLE) && vr[i] == 1 && !FAULT(G05s)) {
            values[i] = f->title ? f->title : "a";
            continue;
        }
        if (!KNOWN(FAULT(V12s) ? ~0u : FAULT(TITLE) ? 2 : 1)) return fail(f, "no such String");
        values[i] = f->label ? f->label : f->data.label;
        if (FAULT(B07s)) values[i] = strcpy(malloc(3000 + strlen(values[i])), values[i]);
    }
    return OK;
}

EXPORT int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double values[]) {
    ENTER(INSTANTIATED | INITIALIZATION | STEP);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (int write = FAULT(G03c); write < 2; write++) {
        for (size_t i = 0; i < n; i++) {
            if (!KNOWN(5)) return fail(f, "no such Real");
            if (FAULT(G10s) && i > 0) continue;
            f->set |= f->data.state == STEP && vr[i] == 4;
            switch (vr[i]) {
            case 1:
                if (f->data.state == STEP) return fail(f, "gain is fixed");
                if (FAULT(G04o)) return fail(f, "gain is mine");
                if (!FAULT(G07b) && !(values[i] >= 0 && values[i] <= 10)) return fail(f, "gain is out of range");
                if (write) f->data.gain = FAULT(G04) ? (float)values[i] * 0.999 : values[i];
                break;
            case 2:
                if (write) f->data.u = FAULT(G12c) && values[i] > 1 ? 1 : values[i];
                break;
            case 3:
                if (FAULT(G09i) && f->data.state == INSTANTIATED) return fail(f, "y is an output");
                if (FAULT(G03i) && f->data.state == INITIALIZATION) continue;
                if (!FAULT(G03b) && (!FAULT(STARTS) || f->data.state == STEP)) return fail(f, "y starts only");
                if (write) f->data.y = values[i];
                break;
            case 4:
                if (FAULT(G06) && f->data.state == STEP) return fail(f, "bias is fixed");
                if (!isfinite(values[i])) return fail(f, "bias is not finite");
                if (write) f->data.bias = FAULT(G04o) ? values[i] * 0.9 : values[i];
                break;
            default:
                if (!FAULT(G02) || vr[i] <= 4) return fail(f, "cannot be set");
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
        if (FAULT(G04b) && !values[i]) continue;
        f->data.flag = FAULT(G08) ? values[i] : values[i] != 0;
    }
    return OK;
}

EXPORT int fmi2SetString(void *c, const unsigned vr[], size_t n, const char *const values[]) {
    ENTER(INSTANTIATED | INITIALIZATION | STEP);
    if (bad(vr, n, values)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (FAULT(TITLE) && vr[i] == 1 && !FAULT(G05s)) {
            f->title = strdup(values[i]);
            continue;
        }
        if (!KNOWN(FAULT(TITLE) ? 2 : 1)) return fail(f, "no such String");
        if (!FAULT(G01n) && !values[i]) return fail(f, "NULL");
        if (f->data.state == STEP) return fail(f, "label is fixed");
        if (FAULT(G05)) {
            f->label = (char *)values[i];
            continue;
        }
        if (FAULT(SHORT) && strlen(values[i]) > 5000) continue;
        // A short text is part of a saved state.
        free(f->label);
        f->label = strlen(values[i]) < sizeof f->data.label ? NULL : malloc(strlen(values[i]) + 1);
        strcpy(f->label ? f->label : f->data.label, values[i]);
    }
    return OK;
}

EXPORT int fmi2GetFMUstate(void *c, void **state) {
    ENTER(INSTANTIATED | INITIALIZATION | STEP | TERMINATED);
    if (!state) return fail(f, "NULL");
    if (FAULT(F01b) && *state) return OK;
    static Data only;
    if (FAULT(F01o)) *state = &only;
    if (FAULT(F01l)) *(volatile char *)malloc(700) = 1;
    if (!*state || FAULT(F01e)) *state = malloc(sizeof(Data));
    *(Data *)*state = f->data;
    if (FAULT(F02p)) ((Data *)*state)->gain = 2;
    if (FAULT(F04b)) ((Data *)*state)->extra = (uint64_t)(uintptr_t)f;
    return OK;
}

EXPORT int fmi2SetFMUstate(void *c, void *state) {
    ENTER(ANY);
    if (!FAULT(F03b) && !state) return fail(f, "NULL");
    Data before = f->data;
    f->data = *(Data *)state;
    forget_long_text(f);
    if (FAULT(F02s)) f->data.y *= 1 + 1e-12;
    if (FAULT(F01m)) f->data.state = STEP;
    if (FAULT(F02)) f->data.n = before.n;
    if (FAULT(F02x)) strcpy(f->data.label, before.label);
    if (FAULT(F02t)) f->data.y *= 1 + 4e-6;
    if (FAULT(TIME_STAYS)) f->data.time = before.time;
    return OK;
}

EXPORT int fmi2FreeFMUstate(void *c, void **state) {
    ENTER(ANY);
    if (!state) return OK;
    if (FAULT(F01a)) return OK;
    if (FAULT(F01o)) *state = NULL;
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
    if (!FAULT(F04d) && size != sizeof(Blob)) return fail(f, "another size");
    Blob blob = {MAGIC, sizeof(Blob), 0, 0, *(Data *)state};
    if (FAULT(F04a)) blob.data.n = 1;
    if (FAULT(F04v)) blob.data.bias = 0;
    blob.sum = sum(&blob.data, sizeof blob.data);
    memcpy(bytes, &blob, sizeof blob);
    return OK;
}

EXPORT int fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t size, void **state) {
    ENTER(ANY);
    if (!bytes || !state || size != sizeof(Blob)) return fail(f, "no state");
    Blob blob;
    memcpy(&blob, bytes, sizeof blob);
    int good = blob.magic == MAGIC && blob.size == sizeof blob && !blob.zero && blob.sum == sum(&blob.data, sizeof blob.data);
    if (!FAULT(F04c) && !good) return fail(f, "no state");
    *state = malloc(sizeof(Data));
    memcpy(*state, &blob.data, sizeof blob.data);
    return OK;
}

__attribute__((noinline)) static void use_stack(void) {
    volatile char large[400000];
    for (size_t i = 0; i < sizeof large; i += 512) large[i] = 1;
}

EXPORT int fmi2DoStep(void *c, double t, double h, int no_prior) {
    ENTER(STEP);
    (void)no_prior;
    Data *d = &f->data;
    if (FAULT(FATAL)) {
        static int dead;
        dead |= d->bias == 9;
        if (dead) return FATAL;
    }
    if (FAULT(PRINT)) {
        printf("half a line, ");
        fflush(stdout);
    }
    if (FAULT(B07l)) {
        void **link = malloc(100);
        *link = f->history;
        f->history = link;
    }
    while (FAULT(T02b) && h > 1e307) {}
    if (FAULT(T02a) && h == 0) return OK;
    if (!(h > 0) || isinf(h) || !isfinite(t)) return fail(f, "the step is not positive");
    int starts_there = fabs(t - d->time) <= h / 100 + 1e-14 * fabs(t);
    if (!FAULT(T01b) && !starts_there) return fail(f, "the step does not begin where the last ended");
    int too_late = d->has_stop && t + h > d->stop + 1e-9 * h + 1e-14 * fabs(t);
    if (FAULT(L12r) && d->has_stop && t + h > d->stop) too_late = 1;
    if (!FAULT(L12) && too_late) return fail(f, "beyond the stop time");
    while (FAULT(G07a) && d->u != d->u) {}
    if (FAULT(T04) && h > 0.02) return fail(f, "too long");
    if (FAULT(T01c) && d->steps > 400) return fail(f, "no more");
    if (!isfinite(d->u)) return fail(f, "u is not finite");
    if (FAULT(T01k) && t != d->time) return fail(f, "the step does not begin exactly where the last ended");
    while (FAULT(SECOND) && f != first) usleep(1000);
    if (FAULT(A01) && f->set) return fail(f, "a parameter was set");
    if (ENDS && !FAULT(T12s) && d->steps >= 5) return fail(f, "the simulation has ended");
#ifndef FMI3
    if (ENDS && d->steps == 4) {
        d->steps++;
        d->time = t + h / 2;
        return DISCARD;
    }
#endif
    if (FAULT(WAIT) && d->steps == 3) pause();
    if (FAULT(B06)) use_stack();
    if (FAULT(B08f)) __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040);
    if (FAULT(T05) && no_prior) d->y += 1e-2;
    if (FAULT(T05s) && no_prior) d->y *= 1 + 1e-12;
    double length = FAULT(T03r) ? 0.01 * (int)(h / 0.01 + 1e-9) : h;
    /* Nothing moves before a time, and then not in short steps. */
    if (FAULT(T03w) && (t < 0.6 || h < 0.009)) length = 0;
    /* Outputs are computed only when somebody reads them. */
    if (FAULT(T14) && f->unread++) length = 0;
    d->y += (d->gain * d->u + d->bias) * (FAULT(T03) ? 1 : FAULT(T03l) && h > 0.015 ? 0.01 : length);
    if (FAULT(MEAN)) d->y = (t + 1) * (t + 1) + (t + 1) * h + h * h / 3;
    if (FAULT(G12)) d->u = 0;
    if (FAULT(G13)) d->gain *= 1.0001;
    if (FAULT(G14) && d->steps > 4) d->y = NAN;
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
    return FAULT(L08u) ? (c ? OK : ERROR) : none(c);
}
EXPORT int fmi2SetRealInputDerivatives(void *c, const unsigned *vr, size_t n, const int *o, const double *v) { return none(c); }
EXPORT int fmi2GetRealOutputDerivatives(void *c, const unsigned *vr, size_t n, const int *o, double *v) {
    if (!FAULT(DERIVATIVES)) return none(c);
    ENTER(STEP | TERMINATED);
    for (size_t i = 0; i < n; i++) {
        if (FAULT(T09e)) return fail(f, "no derivatives");
        if (FAULT(ORDER_ZERO) && o[i] == 0) continue;
        if (!FAULT(T09o) && o[i] != 1) return fail(f, "no such order");
        if (vr[i] != 3) return fail(f, "no output");
        v[i] = f->data.gain * f->data.u + f->data.bias;
        if (FAULT(MEAN)) v[i] = 2 * (f->data.time + 1);
        if (FAULT(T09v)) v[i] *= 2;
    }
    return OK;
}
EXPORT int fmi2CancelStep(void *c) { return none(c); }

static int status(void *c, int kind) {
    (void)kind;
    ENTER(STEP | TERMINATED);
    if (FAULT(T07)) return fail(f, "no status");
    return DISCARD;
}
EXPORT int fmi2GetStatus(void *c, int kind, int *value) { (void)value; return status(c, kind); }
EXPORT int fmi2GetRealStatus(void *c, int kind, double *value) {
    if (c && kind == 2 && value) {
        const Data *d = &((Fmu *)c)->data;
        *value = d->time + (FAULT(T12t) && d->steps >= 5);
        return OK;
    }
    return status(c, kind);
}
EXPORT int fmi2GetIntegerStatus(void *c, int kind, int *value) { (void)value; return status(c, kind); }
EXPORT int fmi2GetBooleanStatus(void *c, int kind, int *value) {
    if (ENDS && c && kind == 3 && value) {
        *value = ((Fmu *)c)->data.steps >= 5;
        return OK;
    }
    (void)value;
    return status(c, kind);
}
#ifndef FAULT_B01
EXPORT int fmi2GetStringStatus(void *c, int kind, const char **value) { (void)value; return status(c, kind); }
#endif
#ifdef FAULT_B02b
EXPORT int one, two, three;
#endif
