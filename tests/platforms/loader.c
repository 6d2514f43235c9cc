/* Loads the binary of an FMU and drives it, with nothing but C: for platforms that the tests themselves do not run on.

     loader LIBRARY 2|3 TOKEN run SPEED_REF TAU_LOAD OUTPUT...   a start, a speed step and a load step of PmsmDrive
     loader LIBRARY 2|3 TOKEN fault MODE FAULTY PANICKY          a model that is made to fail: the statuses it returns

   Numbers are value references, but for the two values of MODE. Doubles are printed with their bits. */
#define __USE_MINGW_ANSI_STDIO 1
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

enum { LIMIT = 64 };

static void *library;
static int version;
static const char *token;

static void stop(const char *what) {
    fprintf(stderr, "loader: %s\n", what);
    exit(1);
}

static void load(const char *path) {
#ifdef _WIN32
    library = (void *)LoadLibraryA(path);
    if (!library) {
        fprintf(stderr, "loader: %s: error %lu\n", path, GetLastError());
        exit(1);
    }
#else
    library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) stop(dlerror());
#endif
}

/* The function of the standard with this name, without its prefix. */
static void *function(const char *name) {
    char full[LIMIT];
    snprintf(full, sizeof full, "fmi%d%s", version, name);
#ifdef _WIN32
    void *found = (void *)GetProcAddress((HMODULE)library, full);
#else
    void *found = dlsym(library, full);
#endif
    if (!found) stop(full);
    return found;
}

typedef const uint32_t *References;

static void log2_(void *environment, const char *instance, int status, const char *category, const char *message, ...) {
    (void)environment, (void)instance, (void)category;
    printf("  log, status %d: %s\n", status, message);
}

static void log3_(void *environment, int status, const char *category, const char *message) {
    (void)environment, (void)category;
    printf("  log, status %d: %s\n", status, message);
}

static void *instantiate(void) {
    static const struct {
        void (*log)(void *, const char *, int, const char *, const char *, ...);
        void *(*allocate)(size_t, size_t);
        void (*release)(void *);
        void (*finished)(void *, int);
        void *environment;
    } callbacks = {log2_, calloc, free, NULL, NULL};
    void *instance;
    if (version == 2) {
        void *(*f)(const char *, int, const char *, const char *, const void *, int, int) = function("Instantiate");
        instance = f("it", 1, token, NULL, &callbacks, 0, 0);
    } else {
        void *(*f)(const char *, const char *, const char *, bool, bool, bool, bool, References, size_t, void *,
                   void (*)(void *, int, const char *, const char *), void *) = function("InstantiateCoSimulation");
        instance = f("it", token, NULL, false, false, false, false, NULL, 0, NULL, log3_, NULL);
    }
    if (!instance) stop("no instance");
    return instance;
}

static int plain(const char *name, void *instance) {
    int (*f)(void *) = function(name);
    return f(instance);
}

static void good(int status, const char *what) {
    if (status != 0) {
        printf("%s returned %d\n", what, status);
        exit(1);
    }
}

static void begin(void *instance) {
    if (version == 2) {
        int (*f)(void *, int, double, double, int, double) = function("SetupExperiment");
        good(f(instance, 0, 0.0, 0.0, 0, 0.0), "SetupExperiment");
        good(plain("EnterInitializationMode", instance), "EnterInitializationMode");
    } else {
        int (*f)(void *, bool, double, double, bool, double) = function("EnterInitializationMode");
        good(f(instance, false, 0.0, 0.0, false, 0.0), "EnterInitializationMode");
    }
    good(plain("ExitInitializationMode", instance), "ExitInitializationMode");
}

static int step(void *instance, double t, double h) {
    if (version == 2) {
        int (*f)(void *, double, double, int) = function("DoStep");
        return f(instance, t, h, 1);
    }
    int (*f)(void *, double, double, bool, bool *, bool *, bool *, double *) = function("DoStep");
    bool event, end, early;
    double last;
    return f(instance, t, h, true, &event, &end, &early, &last);
}

static void set_reals(void *instance, References references, size_t n, const double *values) {
    if (version == 2) {
        int (*f)(void *, References, size_t, const double *) = function("SetReal");
        good(f(instance, references, n, values), "SetReal");
    } else {
        int (*f)(void *, References, size_t, const double *, size_t) = function("SetFloat64");
        good(f(instance, references, n, values, n), "SetFloat64");
    }
}

static void get_reals(void *instance, References references, size_t n, double *values) {
    if (version == 2) {
        int (*f)(void *, References, size_t, double *) = function("GetReal");
        good(f(instance, references, n, values), "GetReal");
    } else {
        int (*f)(void *, References, size_t, double *, size_t) = function("GetFloat64");
        good(f(instance, references, n, values, n), "GetFloat64");
    }
}

static void set_enumeration(void *instance, uint32_t reference, int value) {
    if (version == 2) {
        int (*f)(void *, References, size_t, const int *) = function("SetInteger");
        good(f(instance, &reference, 1, &value), "SetInteger");
    } else {
        int (*f)(void *, References, size_t, const int64_t *, size_t) = function("SetInt64");
        int64_t wide = value;
        good(f(instance, &reference, 1, &wide, 1), "SetInt64");
    }
}

/* The whole state, as the FMU serializes it: its size and a hash (FNV-1a). */
static void print_state(void *instance) {
    bool two = version == 2;
    int (*get)(void *, void **) = function(two ? "GetFMUstate" : "GetFMUState");
    int (*size_of)(void *, void *, size_t *) = function(two ? "SerializedFMUstateSize" : "SerializedFMUStateSize");
    int (*serialize)(void *, void *, unsigned char *, size_t) = function(two ? "SerializeFMUstate" : "SerializeFMUState");
    int (*release)(void *, void **) = function(two ? "FreeFMUstate" : "FreeFMUState");
    void *state = NULL;
    size_t size = 0;
    good(get(instance, &state), "GetFMUState");
    good(size_of(instance, state, &size), "SerializedFMUStateSize");
    unsigned char *bytes = malloc(size);
    if (!bytes) stop("no memory");
    good(serialize(instance, state, bytes, size), "SerializeFMUState");
    good(release(instance, &state), "FreeFMUState");
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++) hash = (hash ^ bytes[i]) * 0x100000001b3u;
    free(bytes);
    printf("  state of %lu bytes, hash %08lx%08lx\n", (unsigned long)size, (unsigned long)(hash >> 32),
           (unsigned long)(hash & 0xffffffffu));
}

static void print_real(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    printf("  %08lx%08lx %.17g\n", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xffffffffu), value);
}

/* 1000 rpm from 0.05 s on, 2 N.m from 0.45 s on. */
static void run(const uint32_t *inputs, const uint32_t *outputs, size_t n) {
    void *instance = instantiate();
    begin(instance);
    double values[LIMIT];
    for (int k = 0; k < 700; k++) {
        double in[2] = {k >= 50 ? 104.72 : 0.0, k >= 450 ? 2.0 : 0.0};
        set_reals(instance, inputs, 2, in);
        good(step(instance, k * 1e-3, 1e-3), "DoStep");
        if ((k + 1) % 70 != 0) continue;
        printf("t = %d ms\n", k + 1);
        get_reals(instance, outputs, n, values);
        for (size_t i = 0; i < n; i++) print_real(values[i]);
        print_state(instance);
    }
    ((void (*)(void *))function("FreeInstance"))(instance);
}

/* A step in each mode; then Reset leads back. */
static void fault(uint32_t mode, const int *values, size_t n) {
    void *instance = instantiate();
    for (size_t i = 0; i < n; i++) {
        set_enumeration(instance, mode, values[i]);
        begin(instance);
        printf("mode %d: DoStep returned %d\n", values[i], step(instance, 0.0, 0.1));
        printf("again: DoStep returned %d\n", step(instance, 0.0, 0.1));
        good(plain("Reset", instance), "Reset");
        begin(instance);
        printf("after Reset: DoStep returned %d\n", step(instance, 0.0, 0.1));
        good(plain("Reset", instance), "Reset");
    }
    ((void (*)(void *))function("FreeInstance"))(instance);
}

int main(int argc, char **argv) {
    uint32_t numbers[LIMIT];
    if (argc < 8 || argc > LIMIT) stop("wrong arguments");
    load(argv[1]);
    version = atoi(argv[2]);
    token = argv[3];
    size_t n = (size_t)argc - 5;
    for (size_t i = 0; i < n; i++) numbers[i] = (uint32_t)strtoul(argv[i + 5], NULL, 10);
    if (strcmp(argv[4], "run") == 0) {
        run(numbers, numbers + 2, n - 2);
    } else {
        int values[LIMIT];
        for (size_t i = 1; i < n; i++) values[i - 1] = (int)numbers[i];
        fault(numbers[0], values, n - 1);
    }
    puts("end");
    return 0;
}
