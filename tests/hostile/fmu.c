/* An FMU of FMI 2.0 that misbehaves: the variable HOSTILE of the environment says how and where, as "PLACE ACT". */
#define _GNU_SOURCE
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#define EXPORT __attribute__((visibility("default")))
typedef unsigned VR;

static void daemonize(int keep) {
    if (fork() == 0) {
        setsid();
        if (fork() == 0)
            for (;;) sleep(1000);
        if (!keep) _exit(0);
        for (;;) sleep(1000);
    }
}

static int deeper(volatile int *n) {
    volatile char page[4096];
    page[0] = (char)*n;
    *n += 1;
    return deeper(n) + page[0];
}

static void act(const char *where) {
    const char *what = getenv("HOSTILE");
    if (!what || strncmp(what, where, strlen(where))) return;
    what += strlen(where) + 1;
    if (!strcmp(what, "exit")) exit(0);
    if (!strcmp(what, "_exit")) _exit(0);
    if (!strcmp(what, "exit3")) exit(3);
    if (!strcmp(what, "terminate-group")) { kill(0, SIGTERM); pause(); }
    if (!strcmp(what, "kill-group")) { kill(0, SIGKILL); pause(); }
    if (!strcmp(what, "kill-guard")) { prctl(PR_SET_PDEATHSIG, 0); kill(getppid(), SIGKILL); pause(); }
    if (!strcmp(what, "crash")) *(volatile int *)8 = 1;
    if (!strcmp(what, "abort")) abort();
    if (!strcmp(what, "recurse")) { volatile int n = 0; deeper(&n); }
    if (!strcmp(what, "hang")) for (;;) pause();
    if (!strcmp(what, "spin")) for (volatile int on = 1; on;) {}
    if (!strcmp(what, "stop")) raise(SIGSTOP);
    if (!strcmp(what, "deaf")) {
        sigset_t all;
        sigfillset(&all);
        sigprocmask(SIG_BLOCK, &all, NULL);
        for (;;) pause();
    }
    if (!strcmp(what, "fork")) daemonize(0);
    if (!strcmp(what, "fork-many"))
        for (int i = 0; i < 50; i++) daemonize(1);
    if (!strcmp(what, "fork-and-crash")) { daemonize(1); *(volatile int *)8 = 1; }
    if (!strcmp(what, "print")) { puts("\033[31mhello"); fprintf(stderr, "hello\n"); fflush(stdout); }
    if (!strcmp(what, "allocate"))
        for (;;) {
            volatile char *p = malloc(64 << 20);
            for (int i = 0; i < 64 << 20; i += 4096) p[i] = 1;
        }
    if (!strcmp(what, "files"))
        for (int i = 0; i < 100000; i++) dup(0);
    if (!strcmp(what, "close"))
        for (int i = 0; i < 4096; i++) close(i);
    if (!strcmp(what, "scribble"))
        for (int i = 3; i < 64; i++) write(i, "hello\n", 6);
    if (!strcmp(what, "chdir")) chdir("/");
    if (!strncmp(what, "network:", 8)) {
        struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(atoi(what + 8)), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
        if (connect(socket(AF_INET, SOCK_STREAM, 0), (struct sockaddr *)&to, sizeof to) == 0) exit(7);
    }
    if (!strcmp(what, "temporary")) {
        char path[4096];
        snprintf(path, sizeof path, "%s/litter", getenv("TMPDIR"));
        FILE *litter = fopen(path, "w");
        if (litter) fclose(litter);
    }
}

__attribute__((constructor)) static void load(void) { act("load"); }

static int made;
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *where, const void *callbacks,
                             int visible, int logging) {
    (void)name; (void)type; (void)guid; (void)where; (void)callbacks; (void)visible; (void)logging;
    act("instantiate");
    return &made;
}
EXPORT void fmi2FreeInstance(void *c) { (void)c; act("free"); }
EXPORT int fmi2DoStep(void *c, double t, double h, int p) {
    (void)c; (void)h; (void)p;
    if (t > 0.3) act("step");
    return 0;
}
EXPORT int fmi2EnterInitializationMode(void *c) { (void)c; act("initialize"); return 0; }

#define OK(name) EXPORT int name(void *c) { (void)c; return 0; }
#define NO(name) EXPORT int name(void *c) { (void)c; return 3; }
OK(fmi2SetupExperiment) OK(fmi2ExitInitializationMode) OK(fmi2Terminate) OK(fmi2Reset) OK(fmi2SetDebugLogging)
OK(fmi2SetReal) OK(fmi2SetInteger) OK(fmi2SetBoolean) OK(fmi2SetString)
NO(fmi2GetInteger) NO(fmi2GetBoolean) NO(fmi2GetString) NO(fmi2GetFMUstate) NO(fmi2SetFMUstate) NO(fmi2FreeFMUstate)
NO(fmi2SerializedFMUstateSize) NO(fmi2SerializeFMUstate) NO(fmi2DeSerializeFMUstate) NO(fmi2GetDirectionalDerivative)
NO(fmi2SetRealInputDerivatives) NO(fmi2GetRealOutputDerivatives) NO(fmi2CancelStep) NO(fmi2GetStatus)
NO(fmi2GetRealStatus) NO(fmi2GetIntegerStatus) NO(fmi2GetBooleanStatus) NO(fmi2GetStringStatus)
EXPORT int fmi2GetReal(void *c, const VR *vr, size_t n, double *x) {
    (void)c; (void)vr;
    for (size_t i = 0; i < n; i++) x[i] = 1;
    return 0;
}
