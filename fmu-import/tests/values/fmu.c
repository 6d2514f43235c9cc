/* An FMU that keeps what it gets and shows what it was told, for tests of the importer's calls.

   Real variable 0 is a mask: bit k of it makes result k of DoStep, of an update and of a completed step true; with bit 5 a step of
   FMI 2.0 is Pending, and discarded when GetStatus was asked three times. Variables 1 to 5 hold what EnterInitializationMode or
   SetupExperiment passed, 6 whether the last step was one without a return to an earlier time, 7 how often GetStatus was asked. Values of all other types share one store of bytes, so that one type can
   read what another has written. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    double real[8];
    char bytes[64];
    char *text[2];
} M;

static bool bit(M *m, int k) { return (int)m->real[0] >> k & 1; }
static int times(M *m, bool has, double tolerance, double start, bool with, double stop) {
    double all[] = {has, tolerance, start, with, stop};
    return memcpy(m->real + 1, all, sizeof all), 0;
}
static int get(M *m, size_t size, size_t k, void *to) { return memcpy(to, m->bytes, size * k), 0; }
static int set(M *m, size_t size, size_t k, const void *from) { return memcpy(m->bytes, from, size * k), 0; }
static int get_reals(M *m, const uint32_t *r, size_t n, double *to) {
    for (size_t i = 0; i < n; i++) to[i] = m->real[r[i]];
    return 0;
}
static int set_reals(M *m, const uint32_t *r, size_t n, const double *from) {
    for (size_t i = 0; i < n; i++) m->real[r[i]] = from[i];
    return 0;
}
static int get_texts(M *m, size_t k, const char **to) { return memcpy(to, m->text, k * sizeof *to), 0; }
static int set_texts(M *m, size_t k, const char *const *from) {
    for (size_t i = 0; i < k; i++) m->text[i] = strdup(from[i]);
    return 0;
}

/* FMI 2.0 */
typedef struct { int again, terminate, nominals, states, defined; double next; } EventInfo;
void *fmi2Instantiate(const char *n, int type, const char *g, const char *r, const void *c, int v, int l) { return calloc(1, sizeof(M)); }
void fmi2FreeInstance(M *m) { free(m); }
int fmi2SetupExperiment(M *m, int a, double b, double c, int d, double e) { return times(m, a, b, c, d, e); }
int fmi2EnterInitializationMode(M *m) { return 0; }
int fmi2ExitInitializationMode(M *m) { return 0; }
int fmi2Terminate(M *m) { return 0; }
int fmi2Reset(M *m) { return 0; }
int fmi2GetReal(M *m, const uint32_t *r, size_t n, double *to) { return get_reals(m, r, n, to); }
int fmi2SetReal(M *m, const uint32_t *r, size_t n, const double *from) { return set_reals(m, r, n, from); }
int fmi2GetInteger(M *m, const uint32_t *r, size_t n, int *to) { return get(m, 4, n, to); }
int fmi2SetInteger(M *m, const uint32_t *r, size_t n, const int *from) { return set(m, 4, n, from); }
int fmi2GetBoolean(M *m, const uint32_t *r, size_t n, int *to) { return get(m, 4, n, to); }
int fmi2SetBoolean(M *m, const uint32_t *r, size_t n, const int *from) { return set(m, 4, n, from); }
int fmi2GetString(M *m, const uint32_t *r, size_t n, const char **to) { return get_texts(m, n, to); }
int fmi2SetString(M *m, const uint32_t *r, size_t n, const char *const *from) { return set_texts(m, n, from); }
int fmi2DoStep(M *m, double t, double h, int p) { return m->real[6] = p, m->real[7] = 0, bit(m, 5) ? 5 : bit(m, 1) ? 2 : 0; }
int fmi2GetStatus(M *m, int kind, int *to) { return *to = ++m->real[7] < 3 ? 5 : bit(m, 1) ? 2 : 0, kind == 0 ? 0 : 3; }
int fmi2GetFMUstate(M *m, void **state) { return *state = m, 0; }
int fmi2FreeFMUstate(M *m, void **state) { return *state = 0, 0; }
int fmi2GetBooleanStatus(M *m, int kind, int *to) { return *to = kind == 3, 0; }
int fmi2GetRealStatus(M *m, int kind, double *to) { return *to = kind == 2 ? 0.25 : -1, 0; }
int fmi2NewDiscreteStates(M *m, EventInfo *e) {
    *e = (EventInfo){bit(m, 0), bit(m, 1), bit(m, 2), bit(m, 3), bit(m, 4), 7};
    return 0;
}
int fmi2CompletedIntegratorStep(M *m, int p, int *event, int *terminate) { return *event = bit(m, 0), *terminate = bit(m, 1), 0; }

/* FMI 3.0 */
void *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *r, bool v, bool l, bool e, bool y, const uint32_t *q, size_t k,
                                  void *environment, void *log, void *update) { return calloc(1, sizeof(M)); }
void fmi3FreeInstance(M *m) { free(m); }
int fmi3EnterInitializationMode(M *m, bool a, double b, double c, bool d, double e) { return times(m, a, b, c, d, e); }
int fmi3ExitInitializationMode(M *m) { return 0; }
int fmi3Terminate(M *m) { return 0; }
int fmi3Reset(M *m) { return 0; }
int fmi3GetFloat64(M *m, const uint32_t *r, size_t n, double *to, size_t k) { return get_reals(m, r, n, to); }
int fmi3SetFloat64(M *m, const uint32_t *r, size_t n, const double *from, size_t k) { return set_reals(m, r, n, from); }
#define TYPE(NAME, T)                                                                                                     \
    int fmi3Get##NAME(M *m, const uint32_t *r, size_t n, T *to, size_t k) { return get(m, sizeof(T), k, to); }             \
    int fmi3Set##NAME(M *m, const uint32_t *r, size_t n, const T *from, size_t k) { return set(m, sizeof(T), k, from); }
TYPE(Float32, float)
TYPE(Int8, int8_t)
TYPE(UInt8, uint8_t)
TYPE(Int16, int16_t)
TYPE(UInt16, uint16_t)
TYPE(Int32, int32_t)
TYPE(UInt32, uint32_t)
TYPE(Int64, int64_t)
TYPE(UInt64, uint64_t)
TYPE(Boolean, uint8_t)
int fmi3GetString(M *m, const uint32_t *r, size_t n, const char **to, size_t k) { return get_texts(m, k, to); }
int fmi3SetString(M *m, const uint32_t *r, size_t n, const char *const *from, size_t k) { return set_texts(m, k, from); }
int fmi3GetFMUState(M *m, void **state) { return *state = m, 0; }
int fmi3FreeFMUState(M *m, void **state) { return *state = 0, 0; }
int fmi3DoStep(M *m, double t, double h, bool p, bool *event, bool *terminate, bool *early, double *last) {
    return m->real[6] = p, *event = bit(m, 0), *terminate = bit(m, 1), *early = bit(m, 2), *last = t + h / 2, 0;
}
int fmi3UpdateDiscreteStates(M *m, bool *again, bool *terminate, bool *nominals, bool *states, bool *defined, double *next) {
    *again = bit(m, 0), *terminate = bit(m, 1), *nominals = bit(m, 2), *states = bit(m, 3), *defined = bit(m, 4), *next = 7;
    return 0;
}
int fmi3CompletedIntegratorStep(M *m, bool p, bool *event, bool *terminate) { return *event = bit(m, 0), *terminate = bit(m, 1), 0; }
