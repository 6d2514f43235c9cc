/* A PM synchronous motor with inverter and sensors, for motor-control firmware that runs on a PC.
 *
 * The motor is the plant of the FMU PmsmPlant: the same variables, the same equations and, with the same duty cycles, the same state,
 * bit for bit. A firmware advances it to the instants of its own timer, and reads counts and bits there.
 *
 * Every function returns VM_OK or the code of an error; then vm_error_text has a text that names the argument, its value and what is
 * allowed, and the call has changed nothing. Ids are values: an id of a destroyed motor is refused. Pointers are used during the call
 * only. After its creation, a motor allocates no memory in a call that returns VM_OK. Several threads may use several motors at the
 * same time; calls on one motor wait for each other. A panic in the library ends the call with VM_PANICKED.
 *
 * Units: s, V, A, rad, N.m. Currents are positive into the motor. Phases are 0 = a, 1 = b, 2 = c.
 */
#ifndef VIRTUAL_MOTOR_H
#define VIRTUAL_MOTOR_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Result of a function. */
typedef int32_t vm_status;
enum {
    VM_OK = 0,
    VM_NULL_POINTER = 1,     /* a pointer is NULL */
    VM_BAD_ID = 2,           /* no motor has this id: it is null, or its motor was destroyed */
    VM_TOO_MANY = 3,         /* there are VM_MOTORS motors */
    VM_BAD_FILE = 4,         /* a motor file or preset cannot be read, or describes no motor */
    VM_UNKNOWN_VARIABLE = 5, /* no variable has this name or number */
    VM_BAD_VALUE = 6,        /* a value is not allowed */
    VM_NOT_SETTABLE = 7,     /* the variable cannot be set, or not anymore */
    VM_BAD_TIME = 8,         /* the time is not finite, or before the present time */
    VM_SHOOT_THROUGH = 9,    /* both gates of a leg are on */
    VM_NEEDS_SWITCHED = 10,  /* the function needs inverter.mode = 2 (Switched) */
    VM_INCONSISTENT = 11,    /* the parameters contradict each other: set others, and advance again */
    VM_FAILED = 12,          /* the motor has no state at this time: too fast, or not finite */
    VM_PANICKED = 13         /* a bug of this library; the motor can only be destroyed */
};

/* Maximum number of motors at a time. */
enum { VM_MOTORS = 256 };

/* Id of a motor, passed by value; {0, 0} is no motor. */
typedef struct vm_motor {
    uint32_t index;
    uint32_t generation;
} vm_motor;

/* Gate signals of vm_advance_gates. */
enum {
    VM_GATE_A_UPPER = 0x01,
    VM_GATE_A_LOWER = 0x02,
    VM_GATE_B_UPPER = 0x04,
    VM_GATE_B_LOWER = 0x08,
    VM_GATE_C_UPPER = 0x10,
    VM_GATE_C_LOWER = 0x20
};

/* Current sensors of vm_adc_setup. */
enum {
    VM_PHASES = 0,   /* in the phases: always a reading */
    VM_LOW_SIDE = 1, /* a shunt below each leg: a reading while the current flows from or to the lower rail, otherwise 0 A */
    VM_LINK = 2      /* one shunt in the link: the sum of the currents from or to the upper rail */
};

/* Channels of the converter: count = floor(offset + gain x + 1/2), limited to 0 ... 2^bits - 1. */
typedef struct vm_adc_setup {
    double current_gain;   /* counts per A; negative with an inverting amplifier, not 0 */
    double current_offset; /* counts at 0 A */
    double voltage_gain;   /* counts per V, not 0 */
    double voltage_offset; /* counts at 0 V */
    uint32_t bits;         /* resolution, 1 to 24 */
    uint32_t sensors;      /* VM_PHASES, VM_LOW_SIDE or VM_LINK */
} vm_adc_setup;

/* Counts of the converter. */
typedef struct vm_adc_counts {
    uint32_t i[3]; /* phase currents; with VM_LINK, the current of the link and two times 0 A */
    uint32_t u_dc; /* DC-link voltage */
} vm_adc_counts;

/* Incremental encoder. */
typedef struct vm_encoder_setup {
    double offset;   /* mechanical angle at which count 0 begins, rad */
    uint32_t counts; /* edges of both tracks per turn, four times the lines: a multiple of 4 from 4 to 2^24 */
} vm_encoder_setup;

/* Reading of the encoder. */
typedef struct vm_encoder_count {
    uint32_t count; /* within the turn, 0 to counts - 1 */
    int32_t turns;  /* whole turns */
    uint32_t bits;  /* bit 0: track A, bit 1: track B, bit 2: index; A leads B at a positive speed */
} vm_encoder_count;

/* Terminals of the motor. */
typedef struct vm_terminal_voltages {
    double u[3];        /* voltages to the lower rail, V; a floating terminal has the back EMF */
    uint32_t counts[3]; /* the same through the channel of the DC-link voltage */
    uint32_t upper;     /* bit x: the current of leg x flows from or to the upper rail */
    uint32_t lower;     /* bit x: from or to the lower rail; with neither bit, the leg carries no current */
} vm_terminal_voltages;

/* Creation ------------------------------------------------------------------------------------------------------------------- */

/* Creates the motor with the start values of PmsmPlant: 3 pole pairs, 2 Ohm, 6 mH, 0.15 Wb, 325 V. As in every function of this
 * section, the inverter is switched (inverter.mode = 2), its carrier has the period inverter.T_pwm and no zero sequence
 * (inverter.zero_sequence = 2). A motor with iron loss has the average inverter (inverter.mode = 1): the switched one excludes iron
 * loss. The converter has 12 bits, with a full scale of 1.5 times the maximum current in both directions (here 7.5 A), and of 1.5
 * times u_dc; the encoder has 4096 counts. */
vm_status vm_create(vm_motor *motor);

/* Creates the motor of a motor file, as `fmu tune` reads it; `path` in UTF-8. */
vm_status vm_create_from_motor_file(const char *path, vm_motor *motor);

/* Creates the motor of the text of a motor file. A flux map that it names is in the current folder. */
vm_status vm_create_from_motor_text(const char *text, vm_motor *motor);

/* Creates the motor of a preset, the JSON that `fmu preset` writes: {"format": "fmu preset", "version": 2, "start": {"motor.R_s":
 * "0.775"}}. */
vm_status vm_create_from_preset(const char *json, vm_motor *motor);

/* Destroys a motor; its id is not valid anymore. */
vm_status vm_destroy(vm_motor motor);

/* Returns 1 for the id of a motor, otherwise 0. */
int32_t vm_is_valid(vm_motor motor);

/* Variables ------------------------------------------------------------------------------------------------------------------ */

/* The number of a variable of PmsmPlant, from 1 on: its value reference in the FMU. Look a name up once, before the loop. */
vm_status vm_find(const char *name, uint32_t *variable);

/* The name of a variable, at most `size` bytes with the final 0. */
vm_status vm_name(uint32_t variable, char *text, size_t size);

/* Sets a variable in its SI unit, a Boolean as 0 or 1, an enumeration as its number: inputs (u_dc, tau_load) and tunable parameters
 * (motor.R_s) at any time, other parameters before the first advance. */
vm_status vm_set(vm_motor motor, uint32_t variable, double value);

/* Reads a variable at the present time. */
vm_status vm_get(vm_motor motor, uint32_t variable, double *value);

/* Time ----------------------------------------------------------------------------------------------------------------------- */

/* The present time, s. A new motor is at 0 s. */
vm_status vm_time(vm_motor motor, double *t);

/* Advances to the time `t` (s), while the carrier switches the legs with these duty cycles (0 to 1): the share of a period in which
 * the upper switch is on, around its middle. The carrier takes them over at its next extreme (inverter.update), or at the present
 * time if that is one. It leaves inverter.dead_time between two switches. With `enable` = 0, all gates are off. */
vm_status vm_advance_duties(vm_motor motor, double t, const double duties[3], int32_t enable);

/* Advances to the time `t` (s) with these gate signals, a sum of VM_GATE_...: the timer of the firmware is the modulator, and the
 * dead time is what its signals leave. */
vm_status vm_advance_gates(vm_motor motor, double t, uint32_t gates);

/* Sensors, at the present time ----------------------------------------------------------------------------------------------- */

/* Counts of the converter: advance to the instant of the sample first. Shunts need inverter.mode = 2. */
vm_status vm_adc(vm_motor motor, vm_adc_counts *counts);

/* The reading of the encoder. */
vm_status vm_encoder(vm_motor motor, vm_encoder_count *count);

/* The Hall sensors: bit 0 is sensor a, bit 1 sensor b, bit 2 sensor c. Forward: 5, 1, 3, 2, 6, 4. */
vm_status vm_hall(vm_motor motor, uint32_t *bits);

/* The terminals of the motor, as they were up to the present time: gates that change at this time show their effect after the next
 * advance. Needs inverter.mode = 2. */
vm_status vm_terminals(vm_motor motor, vm_terminal_voltages *terminals);

/* The channels of the converter, before or after a change. */
vm_status vm_get_adc(vm_motor motor, vm_adc_setup *setup);
vm_status vm_set_adc(vm_motor motor, const vm_adc_setup *setup);

/* The encoder. */
vm_status vm_get_encoder(vm_motor motor, vm_encoder_setup *setup);
vm_status vm_set_encoder(vm_motor motor, const vm_encoder_setup *setup);

/* Sets the electrical angle at which Hall sensor a rises, rad. */
vm_status vm_set_hall(vm_motor motor, double offset);

/* Errors --------------------------------------------------------------------------------------------------------------------- */

/* Copies the text of the last error of this thread, at most `size` bytes with the final 0, and returns its length, at most 1024. */
size_t vm_error_text(char *text, size_t size);

#ifdef __cplusplus
}
#endif

#endif
