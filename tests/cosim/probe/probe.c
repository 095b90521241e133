/* A small FMI 2.0 co-simulation FMU for the tests: x' = u - k x by Euler's method with the mean of u over the
   step, and every kind of failure on demand.

   Real     0 u (input)  1 x (output)  2 k  3 start_x  4 fault_time  5..7 gain[1..3]  8 twice (output) = 2 u
   Integer  0 fault (parameter): the status to answer with, 5 = NaN in x, 6 = never,
             7 = a crash, 8 = exit
             1 initial_fault   2 count (output)
            3 mode (Enumeration)   4 number (input)   5 number_out (output)
   Boolean  0 flag (input)   1 flag_out (output)
   String   0 label (parameter), part of the log message                                                          */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"

enum { U, X, K, START_X, FAULT_TIME, GAIN, TWICE = 8, REALS };
enum { FAULT, INITIAL_FAULT, COUNT, MODE, NUMBER, NUMBER_OUT, INTEGERS };

typedef struct {
    const fmi2CallbackFunctions *callbacks;
    fmi2Real real[REALS];
    fmi2Integer integer[INTEGERS];
    fmi2Boolean boolean[2];
    char label[64];
    char name[64];
    double reached;
    double derivative[2]; /* of u */
    int fatal, states;
} Probe;

static fmi2Status answer(Probe *p, int status) {
    static const char *category[] = {"logStatusOK", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                     "logStatusFatal"};
    if (status > 0)
        p->callbacks->logger(p->callbacks->componentEnvironment, p->name, (fmi2Status)status, category[status],
                             "%s answers %d\nas it was told", p->label, status);
    p->fatal |= status == fmi2Fatal;
    return (fmi2Status)status;
}

static void outputs(Probe *p) {
    p->real[TWICE] = 2.0 * p->real[U];
    p->integer[NUMBER_OUT] = p->integer[NUMBER];
    p->boolean[1] = p->boolean[0];
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) { return fmi2OK; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean on) {
    if (strcmp(guid, "probe")) {
        callbacks->logger(callbacks->componentEnvironment, name, fmi2Error, "logStatusError", "wrong guid %s", guid);
        return NULL;
    }
    Probe *p = calloc(1, sizeof(Probe));
    p->callbacks = callbacks;
    p->real[K] = 1.0;
    p->real[FAULT_TIME] = -1.0;
    p->integer[MODE] = 1;
    strcpy(p->label, "probe");
    snprintf(p->name, sizeof p->name, "%s", name);
    return p;
}

/* A call after fmi2Fatal ends the process: the tests would see it. */
void fmi2FreeInstance(fmi2Component c) {
    if (((Probe *)c)->fatal) abort();
    free(c);
}
fmi2Status fmi2Terminate(fmi2Component c) {
    if (((Probe *)c)->fatal) abort();
    return fmi2OK;
}
fmi2Status fmi2Reset(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean d, fmi2Real e) {
    ((Probe *)c)->reached = start;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Probe *p = c;
    p->real[X] = p->real[START_X];
    return fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Probe *p = c;
    outputs(p);
    return answer(p, p->integer[INITIAL_FAULT]);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean keep) {
    Probe *p = c;
    if (keep && p->states > 0) abort(); /* "never back" and a state to go back to do not go together */
    int fault = time >= p->real[FAULT_TIME] - 1e-12 ? p->integer[FAULT] : 0;
    if (fault == 6) {
        fputs("never\n", stderr);
        for (;;) pause();
    }
    if (fault == 7) raise(SIGSEGV);
    if (fault == 8) exit(3);
    if (fault >= 2 && fault <= 4) {
        p->reached = time + h / 2.0;
        return answer(p, fault);
    }
    double mean = p->real[U] + p->derivative[0] * h / 2.0 + p->derivative[1] * h * h / 6.0;
    p->real[X] = p->real[X] + h * (mean - p->real[K] * p->real[X]);
    if (fault == 5) p->real[X] = NAN;
    p->integer[COUNT] += 1;
    outputs(p);
    return answer(p, fault == 1 ? 1 : 0);
}
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }

#define VALUES(Kind, field, type)                                                                              \
    fmi2Status fmi2Get##Kind(fmi2Component c, const fmi2ValueReference r[], size_t n, type v[]) {              \
        if (!((Probe *)c)->integer[COUNT]) outputs(c);                                                         \
        for (size_t i = 0; i < n; ++i) v[i] = ((Probe *)c)->field[r[i]];                                       \
        return fmi2OK;                                                                                         \
    }                                                                                                          \
    fmi2Status fmi2Set##Kind(fmi2Component c, const fmi2ValueReference r[], size_t n, const type v[]) {        \
        for (size_t i = 0; i < n; ++i) ((Probe *)c)->field[r[i]] = v[i];                                       \
        return fmi2OK;                                                                                         \
    }
VALUES(Real, real, fmi2Real)
VALUES(Integer, integer, fmi2Integer)
VALUES(Boolean, boolean, fmi2Boolean)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[]) {
    for (size_t i = 0; i < n; ++i) v[i] = ((Probe *)c)->label;
    return fmi2OK;
}
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String v[]) {
    for (size_t i = 0; i < n; ++i) snprintf(((Probe *)c)->label, 64, "%s", v[i]);
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) {
    if (!*s) *s = malloc(sizeof(Probe)), ((Probe *)c)->states += 1;
    memcpy(*s, c, sizeof(Probe));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) {
    Probe *p = c, now = *p;
    *p = *(Probe *)s;
    p->callbacks = now.callbacks;
    p->states = now.states;
    return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) {
    free(*s);
    *s = NULL;
    ((Probe *)c)->states -= 1;
    return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) {
    *n = sizeof(Probe);
    return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) {
    memcpy(b, s, n);
    memset(b, 0, sizeof(void *)); /* the callbacks are those of this process */
    return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s) {
    if (n != sizeof(Probe)) return answer(c, fmi2Error);
    *s = memcpy(malloc(n), b, n);
    ((Probe *)c)->states += 1;
    return fmi2OK;
}
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[], size_t n,
                                        const fmi2ValueReference k[], size_t m, const fmi2Real a[], fmi2Real b[]) {
    return fmi2Error;
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
                                       const fmi2Real v[]) {
    Probe *p = c;
    for (size_t i = 0; i < n; ++i) {
        if (r[i] != U || o[i] < 1 || o[i] > 2) return fmi2Error;
        p->derivative[o[i] - 1] = v[i];
    }
    return fmi2OK;
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
                                        fmi2Real v[]) {
    return fmi2Error;
}
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *v) { return fmi2Discard; }
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *v) {
    *v = ((Probe *)c)->reached;
    return fmi2OK;
}
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *v) { return fmi2Discard; }
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *v) {
    *v = fmi2False;
    return fmi2OK;
}
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *v) { return fmi2Discard; }
