/* The faults that this copy of a library has, as words: a test writes others over them, so that a library is compiled once for all
   of its faults. FAULT(X) holds if X is one of the words. */
#ifndef FAULT_H
#define FAULT_H
#ifndef FAULTS
#define FAULTS "NONE"
#endif

static volatile char faults[96] = "The faults of this library: " FAULTS;

static int is_fault(const char *name) {
    const volatile char *at = faults + sizeof "The faults of this library:";
    while (*at) {
        const char *letter = name;
        while (*at == ' ') at++;
        while (*letter && *at == *letter) at++, letter++;
        if (!*letter && (*at == ' ' || !*at)) return 1;
        while (*at && *at != ' ') at++;
    }
    return 0;
}

#define FAULT(name) is_fault(#name)
#endif
