/* An importer in C: LIBRARY VERSION TOKEN. For each n it instantiates in a child of its own whose allocation n fails, then with all of
   them, steps, and prints: allocations to instantiate, allocations of a step; instances, NULLs, aborts and other ends of the children. */
#include <dlfcn.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

extern long fault_at(long number);

static void *library;
static const char *token;

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (!found) fprintf(stderr, "no %s\n", name), exit(2);
    return found;
}

static void silent(void) {}

/* FMI 2.0: fmi2CallbackFunctions. */
static const void *callbacks[5];

static void *instantiate(int version) {
    if (version == 2) {
        void *(*call)(const char *, int, const char *, const char *, const void *, int, int) = function("fmi2Instantiate");
        callbacks[0] = (void *)silent, callbacks[1] = (void *)calloc, callbacks[2] = (void *)free;
        return call("it", 1, token, "", callbacks, 0, 0);
    }
    void *(*call)(const char *, const char *, const char *, _Bool, _Bool, _Bool, _Bool, const void *, size_t, void *, void *, void *) =
        function("fmi3InstantiateCoSimulation");
    return call("it", token, "", 0, 0, 0, 0, NULL, 0, NULL, (void *)silent, NULL);
}

static int start_and_step(int version, void *it) {
    if (version == 2) {
        int (*setup)(void *, int, double, double, int, double) = function("fmi2SetupExperiment");
        int (*enter)(void *) = function("fmi2EnterInitializationMode"), (*leave)(void *) = function("fmi2ExitInitializationMode");
        int (*step)(void *, double, double, int) = function("fmi2DoStep");
        if (setup(it, 0, 0, 0, 0, 0) || enter(it) || leave(it)) return 1;
        fault_at(0);
        return step(it, 0, 1e-4, 1);
    }
    int (*enter)(void *, _Bool, double, double, _Bool, double) = function("fmi3EnterInitializationMode");
    int (*leave)(void *) = function("fmi3ExitInitializationMode");
    int (*step)(void *, double, double, _Bool, _Bool *, _Bool *, _Bool *, double *) = function("fmi3DoStep");
    _Bool a, b, c;
    double last;
    if (enter(it, 0, 0, 0, 0, 0) || leave(it)) return 1;
    fault_at(0);
    return step(it, 0, 1e-4, 1, &a, &b, &c, &last);
}

int main(int count, char **arguments) {
    if (count != 4) return 2;
    int version = atoi(arguments[2]);
    library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    token = arguments[3];
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 2;
    instantiate(version);
    fault_at(0);
    void *it = instantiate(version);
    long allocations = fault_at(0);
    if (!it || start_and_step(version, it)) return 2;
    long of_step = fault_at(0), instances = 0, nulls = 0, aborts = 0, others = 0;
    for (long n = 1; n <= allocations; n++) {
        fflush(stdout);
        pid_t child = fork();
        if (!child) {
            close(2);
            fault_at(n);
            void *made = instantiate(version);
            _exit(made ? 10 : 11);
        }
        int status = 0;
        waitpid(child, &status, 0);
        if (WIFEXITED(status) && WEXITSTATUS(status) == 10) instances++;
        else if (WIFEXITED(status) && WEXITSTATUS(status) == 11) nulls++;
        else if (WIFSIGNALED(status) && WTERMSIG(status) == SIGABRT) aborts++;
        else others++;
    }
    printf("%ld %ld %ld %ld %ld %ld\n", allocations, of_step, instances, nulls, aborts, others);
    return 0;
}
