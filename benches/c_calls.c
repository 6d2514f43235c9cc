// The pair in an importer written in C, for instruction counts of set, get and step: no other code runs between the calls.
//
//   cc -O2 -o calls benches/c_calls.c -ldl
//   valgrind --tool=callgrind ./calls 10000 PLANT CONTROLLER
//
// PLANT and CONTROLLER are the unpacked archives of PmsmPlant and SensorlessController for FMI 3.0. Two counts of periods give the
// instructions of one. `callgrind_annotate --inclusive=yes` names the functions of FMI, and all others in libraries of `fmu build --keep-symbols`.
#include <dlfcn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef unsigned Reference;

struct unit {
    void *instance;
    int (*get)(void *, const Reference *, size_t, double *, size_t);
    int (*set)(void *, const Reference *, size_t, const double *, size_t);
    int (*step)(void *, double, double, bool, bool *, bool *, bool *, double *);
    char *xml;
};

static void demand(bool is, const char *what) {
    if (!is) {
        fprintf(stderr, "%s\n", what);
        exit(1);
    }
}

static Reference reference(const struct unit *unit, const char *name) {
    char wanted[64];
    snprintf(wanted, sizeof wanted, " name=\"%s\" valueReference=\"", name);
    const char *found = strstr(unit->xml, wanted);
    demand(found, name);
    return (Reference)atoi(found + strlen(wanted));
}

static struct unit load(const char *folder, const char *name) {
    char path[4096], token[64];
    struct unit unit = {.xml = calloc(1, 1 << 22)};
    snprintf(path, sizeof path, "%s/modelDescription.xml", folder);
    FILE *file = fopen(path, "r");
    demand(file && unit.xml && fread(unit.xml, 1, (1 << 22) - 1, file), path);
    fclose(file);
    const char *place = strstr(unit.xml, "instantiationToken=\"");
    demand(place && sscanf(place, "instantiationToken=\"%63[^\"]", token) == 1, "instantiationToken");
    snprintf(path, sizeof path, "%s/binaries/x86_64-linux/%s.so", folder, name);
    void *library = dlopen(path, RTLD_NOW);
    demand(library, path);
    void *(*instantiate)(const char *, const char *, const char *, bool, bool, bool, bool, const Reference *, size_t, void *, void *, void *) =
        dlsym(library, "fmi3InstantiateCoSimulation");
    int (*enter)(void *, bool, double, double, bool, double) = dlsym(library, "fmi3EnterInitializationMode");
    int (*leave)(void *) = dlsym(library, "fmi3ExitInitializationMode");
    unit.get = dlsym(library, "fmi3GetFloat64");
    unit.set = dlsym(library, "fmi3SetFloat64");
    unit.step = dlsym(library, "fmi3DoStep");
    unit.instance = instantiate(name, token, NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    demand(unit.instance && !enter(unit.instance, false, 0, 0, false, 0) && !leave(unit.instance), name);
    return unit;
}

int main(int count, char **arguments) {
    demand(count == 4, "PERIODS PLANT CONTROLLER");
    struct unit plant = load(arguments[2], "PmsmPlant"), controller = load(arguments[3], "SensorlessController");
    const char *i_names[] = {"i_a", "i_b", "i_c"}, *u_names[] = {"u_a", "u_b", "u_c"};
    Reference plant_i[3], plant_u[3], controller_i[3], controller_u[3];
    for (int k = 0; k < 3; k++) {
        plant_i[k] = reference(&plant, i_names[k]), plant_u[k] = reference(&plant, u_names[k]);
        controller_i[k] = reference(&controller, i_names[k]), controller_u[k] = reference(&controller, u_names[k]);
    }
    Reference speed_ref = reference(&controller, "speed_ref"), tau_load = reference(&plant, "tau_load");
    double speed = 104.72, load_torque = 1, i[3], u[3], last;
    controller.set(controller.instance, &speed_ref, 1, &speed, 1);
    plant.set(plant.instance, &tau_load, 1, &load_torque, 1);
    bool event, ends, early;
    for (long k = 0, periods = atol(arguments[1]); k < periods; k++) {
        plant.get(plant.instance, plant_i, 3, i, 3);
        controller.get(controller.instance, controller_u, 3, u, 3);
        plant.set(plant.instance, plant_u, 3, u, 3);
        controller.set(controller.instance, controller_i, 3, i, 3);
        double t = (double)k * 1e-4;
        int status = plant.step(plant.instance, t, 1e-4, true, &event, &ends, &early, &last);
        status |= controller.step(controller.instance, t, 1e-4, true, &event, &ends, &early, &last);
        demand(status == 0, "a step fails");
    }
    printf("%.17g %.17g\n", i[0], u[0]);
    return 0;
}
