/* An FMU of FMI 2.0 that answers what the name of its instance says: bytes as hexadecimal digits. Each status and value takes the next of
   them, and zeros follow the last. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
typedef unsigned VR;

/* One instance at a time. */
static unsigned char tape[1 << 16];
static size_t at, end;
static int made;

static unsigned char next(void) { return at < end ? tape[at++] : 0; }
/* Mostly OK; otherwise Warning, Discard, Error, Fatal, Pending or no status at all. */
static int status(void) {
    unsigned char b = next();
    return b < 0xE0 ? 0 : b < 0xFE ? b & 7 : 77;
}
static void bytes(void *to, size_t n) {
    for (size_t i = 0; i < n; i++) ((unsigned char *)to)[i] = next();
}
static double real(void) {
    unsigned char b = next();
    double x;
    if (b < 0xC0) return (b - 96) / 16.0;
    bytes(&x, sizeof x);
    return x;
}
static int nibble(char c) { return c >= 'a' ? c - 'a' + 10 : c - '0'; }

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *where, const void *callbacks, int visible,
                             int logging) {
    (void)type; (void)guid; (void)where; (void)callbacks; (void)visible; (void)logging;
    at = end = 0;
    for (const char *c = name + 1; c[0] && c[1] && end < sizeof tape; c += 2) tape[end++] = (unsigned char)(nibble(c[0]) << 4 | nibble(c[1]));
    return next() == 0xFF ? NULL : &made;
}
EXPORT void fmi2FreeInstance(void *c) { (void)c; }

#define ANSWER(name) EXPORT int name(void) { return status(); }
ANSWER(fmi2SetupExperiment) ANSWER(fmi2EnterInitializationMode) ANSWER(fmi2ExitInitializationMode) ANSWER(fmi2Terminate) ANSWER(fmi2Reset)
ANSWER(fmi2SetDebugLogging) ANSWER(fmi2SetReal) ANSWER(fmi2SetInteger) ANSWER(fmi2SetBoolean) ANSWER(fmi2SetString)
ANSWER(fmi2SetFMUstate) ANSWER(fmi2FreeFMUstate) ANSWER(fmi2SetRealInputDerivatives) ANSWER(fmi2CancelStep) ANSWER(fmi2DoStep)
ANSWER(fmi2EnterEventMode) ANSWER(fmi2EnterContinuousTimeMode) ANSWER(fmi2SetTime) ANSWER(fmi2SetContinuousStates)
ANSWER(fmi2GetDirectionalDerivative) ANSWER(fmi2GetRealOutputDerivatives)

static int reals(double *x, size_t n) {
    for (size_t i = 0; i < n; i++) x[i] = real();
    return status();
}
EXPORT int fmi2GetReal(void *c, const VR *vr, size_t n, double *x) { (void)c; (void)vr; return reals(x, n); }
EXPORT int fmi2GetDerivatives(void *c, double *x, size_t n) { (void)c; return reals(x, n); }
EXPORT int fmi2GetEventIndicators(void *c, double *x, size_t n) { (void)c; return reals(x, n); }
EXPORT int fmi2GetContinuousStates(void *c, double *x, size_t n) { (void)c; return reals(x, n); }
EXPORT int fmi2GetNominalsOfContinuousStates(void *c, double *x, size_t n) { (void)c; return reals(x, n); }
EXPORT int fmi2GetInteger(void *c, const VR *vr, size_t n, int *x) { (void)c; (void)vr; bytes(x, n * sizeof *x); return status(); }
EXPORT int fmi2GetBoolean(void *c, const VR *vr, size_t n, int *x) { (void)c; (void)vr; bytes(x, n * sizeof *x); return status(); }
EXPORT int fmi2GetString(void *c, const VR *vr, size_t n, const char **x) {
    static char text[256];
    (void)c; (void)vr;
    memset(text, 0, sizeof text);
    bytes(text, next() & 31);
    for (size_t i = 0; i < n; i++) x[i] = next() == 0xFF ? NULL : text;
    return status();
}
EXPORT int fmi2GetFMUstate(void *c, void **state) { (void)c; *state = next() == 0xFF ? NULL : &made; return status(); }
EXPORT int fmi2SerializedFMUstateSize(void *c, void *state, size_t *n) {
    (void)c; (void)state;
    bytes(n, next() == 0xFF ? sizeof *n : 1);
    return status();
}
EXPORT int fmi2SerializeFMUstate(void *c, void *state, char *to, size_t n) { (void)c; (void)state; memset(to, 7, n); return status(); }
EXPORT int fmi2DeSerializeFMUstate(void *c, const char *from, size_t n, void **state) {
    (void)c; (void)from; (void)n;
    *state = &made;
    return status();
}
struct events { int again, end, nominals, states, time; double next; };
EXPORT int fmi2NewDiscreteStates(void *c, struct events *to) {
    (void)c;
    to->again = next() > 0xC0;
    to->end = next() > 0xE0;
    to->nominals = next() & 1;
    to->states = next() & 1;
    to->time = next() & 1;
    to->next = real();
    return status();
}
EXPORT int fmi2CompletedIntegratorStep(void *c, int last, int *enter, int *end_) {
    (void)c; (void)last;
    *enter = next() > 0xC0;
    *end_ = next() > 0xF0;
    return status();
}
EXPORT int fmi2GetStatus(void *c, int kind, int *x) { (void)c; (void)kind; *x = status(); return status(); }
EXPORT int fmi2GetRealStatus(void *c, int kind, double *x) { (void)c; (void)kind; *x = real(); return status(); }
EXPORT int fmi2GetIntegerStatus(void *c, int kind, int *x) { (void)c; (void)kind; bytes(x, sizeof *x); return status(); }
EXPORT int fmi2GetBooleanStatus(void *c, int kind, int *x) { (void)c; (void)kind; bytes(x, sizeof *x); return status(); }
EXPORT int fmi2GetStringStatus(void *c, int kind, const char **x) { (void)c; (void)kind; *x = NULL; return status(); }
