/* The small FMU of fmu.c as FMI 3.0, where references count over all types: 5 n, 6 flag, 7 label, 8 frame, 9 high. */
#define FMI3
#include "fmu.c"
#include <stdbool.h>

typedef const unsigned *Refs;

EXPORT const char *fmi3GetVersion(void) { return FAULT(X02b) ? "3.0.2" : "3.0"; }

static void *make(const char *name, int type, const char *token, const char *where, bool logging, void *environment, void *log) {
    const Callbacks callbacks = {(void (*)(void *, const char *, int, const char *, const char *, ...))log, NULL, NULL, NULL, environment};
    Fmu *f = fmi2Instantiate(name, type, token, where, &callbacks, 0, logging);
    if (f) f->data.ready = 1;
    return f;
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *where, bool visible, bool logging, bool event_mode,
                                         bool early, Refs required, size_t n, void *environment, void *log, void *update) {
    (void)visible; (void)early; (void)required; (void)update;
    if (!FAULT(L03) && (event_mode || n)) return NULL;
    return make(name, 1, token, where, logging, environment, log);
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *where, bool visible, bool logging, void *environment, void *log) {
    (void)visible;
    return make(name, 0, token, where, logging, environment, log);
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *where, bool visible, bool logging, void *environment,
                                               void *log, void *update, void *lock, void *unlock) {
    (void)visible; (void)update; (void)lock; (void)unlock;
    return make(name, 2, token, where, logging, environment, log);
}

EXPORT void fmi3FreeInstance(void *c) { fmi2FreeInstance(c); }
EXPORT int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const names[]) { return fmi2SetDebugLogging(c, on, n, names); }
EXPORT int fmi3EnterInitializationMode(void *c, bool has_tolerance, double tolerance, double start, bool has_stop, double stop) {
    int status = fmi2SetupExperiment(c, has_tolerance, tolerance, start, has_stop, stop);
    return status == OK ? fmi2EnterInitializationMode(c) : status;
}
EXPORT int fmi3ExitInitializationMode(void *c) { return fmi2ExitInitializationMode(c); }
EXPORT int fmi3Terminate(void *c) { return fmi2Terminate(c); }
EXPORT int fmi3Reset(void *c) {
    int status = fmi2Reset(c);
    if (c) ((Fmu *)c)->data.ready = 1;
    return status;
}

/* As many values as references; references of a type from its first one. */
static int fits(void *c, Refs vr, size_t n, size_t m, unsigned first, unsigned *own) {
    Fmu *f = c;
    if (!f) return ERROR;
    if (!FAULT(G01c) && n != m) return fail(f, "another number of values");
    if (n > 16) return fail(f, "so many");
    for (size_t i = 0; vr && i < n; i++) own[i] = vr[i] - first;
    return OK;
}

#define FITS(first) \
    unsigned own[16]; \
    int status = fits(c, vr, n, m, first, own); \
    if (status != OK) return status; \
    Refs at = vr ? own : NULL

EXPORT int fmi3GetFloat64(void *c, Refs vr, size_t n, double v[], size_t m) { FITS(0); return fmi2GetReal(c, at, n, v); }
EXPORT int fmi3SetFloat64(void *c, Refs vr, size_t n, const double v[], size_t m) { FITS(0); return fmi2SetReal(c, at, n, v); }
EXPORT int fmi3GetInt32(void *c, Refs vr, size_t n, int v[], size_t m) { FITS(5); return fmi2GetInteger(c, at, n, v); }
EXPORT int fmi3SetInt32(void *c, Refs vr, size_t n, const int v[], size_t m) { FITS(5); return fmi2SetInteger(c, at, n, v); }
EXPORT int fmi3GetString(void *c, Refs vr, size_t n, const char *v[], size_t m) { FITS(7); return fmi2GetString(c, at, n, v); }
EXPORT int fmi3SetString(void *c, Refs vr, size_t n, const char *const v[], size_t m) { FITS(7); return fmi2SetString(c, at, n, v); }
EXPORT int fmi3GetBoolean(void *c, Refs vr, size_t n, uint8_t v[], size_t m) {
    FITS(6);
    int wide[16];
    status = fmi2GetBoolean(c, at, n, v ? wide : NULL);
    for (size_t i = 0; status == OK && i < n; i++) v[i] = (uint8_t)wide[i];
    return status;
}
EXPORT int fmi3SetBoolean(void *c, Refs vr, size_t n, const uint8_t v[], size_t m) {
    FITS(6);
    int wide[16];
    for (size_t i = 0; v && i < n; i++) wide[i] = v[i];
    return fmi2SetBoolean(c, at, n, v ? wide : NULL);
}

/* The bytes of frame, 6 at most. */
#define FRAME 6
EXPORT int fmi3GetBinary(void *c, Refs vr, size_t n, size_t sizes[], const uint8_t *v[], size_t m) {
    FITS(8);
    ENTER(READABLE);
    if (n && (!vr || !v || !sizes)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (own[i] != 0) return fail(f, "no such Binary");
        sizes[i] = FAULT(G05b) && f->data.frame_size > 4 ? 4 : f->data.frame_size;
        v[i] = f->data.frame;
    }
    return OK;
}
EXPORT int fmi3SetBinary(void *c, Refs vr, size_t n, const size_t sizes[], const uint8_t *const v[], size_t m) {
    FITS(8);
    ENTER(INSTANTIATED | INITIALIZATION | STEP);
    if (n && (!vr || !v || !sizes)) return fail(f, "NULL");
    for (size_t i = 0; i < n; i++) {
        if (own[i] != 0) return fail(f, "no such Binary");
        if (f->data.state == STEP) return fail(f, "frame is fixed");
        if (!FAULT(G05m) && sizes[i] > FRAME) return fail(f, "too many bytes");
        if (sizes[i] > sizeof f->data.frame || (sizes[i] && !v[i])) return fail(f, "too many bytes, or NULL");
        f->data.frame_size = sizes[i];
        if (sizes[i]) memcpy(f->data.frame, v[i], sizes[i]);
    }
    return OK;
}

/* Types that no variable has. */
#define ABSENT(type) \
    EXPORT int fmi3Get##type(void *c, Refs vr, size_t n, void *v) { (void)vr; (void)v; ENTER(READABLE); return n ? fail(f, "no such variable") : OK; } \
    EXPORT int fmi3Set##type(void *c, Refs vr, size_t n, void *v) { (void)vr; (void)v; ENTER(INSTANTIATED | INITIALIZATION | STEP); return n ? fail(f, "no such variable") : OK; }
ABSENT(Float32) ABSENT(Int8) ABSENT(UInt8) ABSENT(Int16) ABSENT(UInt16)
ABSENT(UInt32) ABSENT(Int64) ABSENT(UInt64)

EXPORT int fmi3GetFMUState(void *c, void **state) { return fmi2GetFMUstate(c, state); }
EXPORT int fmi3SetFMUState(void *c, void *state) { return fmi2SetFMUstate(c, state); }
EXPORT int fmi3FreeFMUState(void *c, void **state) { return fmi2FreeFMUstate(c, state); }
EXPORT int fmi3SerializedFMUStateSize(void *c, void *state, size_t *size) { return fmi2SerializedFMUstateSize(c, state, size); }
EXPORT int fmi3SerializeFMUState(void *c, void *state, char bytes[], size_t size) { return fmi2SerializeFMUstate(c, state, bytes, size); }
EXPORT int fmi3DeserializeFMUState(void *c, const char bytes[], size_t size, void **state) { return fmi2DeSerializeFMUstate(c, bytes, size, state); }

EXPORT int fmi3DoStep(void *c, double t, double h, bool no_prior, bool *event, bool *terminate, bool *early, double *last) {
    if (!FAULT(T06c) && c && (!event || !terminate || !early || !last)) return fail(c, "NULL");
    int status = fmi2DoStep(c, t, h, no_prior);
    if (status != OK) return status;
    *event = *terminate = *early = false;
    *last = t + h;
    if (FAULT(T06a)) *early = true;
    if (FAULT(T06e)) *event = true;
    if (FAULT(LATE)) *last += 0.3 * h;
    if (FAULT(STANDS)) *last = t;
    *terminate = ENDS && ((Fmu *)c)->data.steps >= 5;
    return OK;
}

EXPORT int fmi3EnterConfigurationMode(void *c) { return c && FAULT(C03) ? OK : none(c); }
EXPORT int fmi3GetDirectionalDerivative(void *c) { return c && FAULT(L08u) ? OK : none(c); }

#define NONE(name) EXPORT int fmi3##name(void *c) { return none(c); }
NONE(EnterEventMode) NONE(GetClock) NONE(SetClock) NONE(GetNumberOfVariableDependencies)
NONE(GetVariableDependencies) NONE(GetAdjointDerivative) NONE(ExitConfigurationMode) NONE(GetIntervalDecimal)
NONE(GetIntervalFraction) NONE(GetShiftDecimal) NONE(GetShiftFraction) NONE(SetIntervalDecimal)
NONE(SetIntervalFraction) NONE(SetShiftDecimal) NONE(SetShiftFraction) NONE(EvaluateDiscreteStates)
NONE(UpdateDiscreteStates) NONE(EnterContinuousTimeMode) NONE(CompletedIntegratorStep) NONE(SetTime)
NONE(SetContinuousStates) NONE(GetContinuousStateDerivatives) NONE(GetEventIndicators) NONE(GetContinuousStates)
NONE(GetNominalsOfContinuousStates) NONE(GetNumberOfEventIndicators) NONE(GetNumberOfContinuousStates) NONE(EnterStepMode)
NONE(GetOutputDerivatives) NONE(ActivateModelPartition)
#ifdef FAULT_B02a
EXPORT int fmi3Surprise(void) { return 0; }
#endif
