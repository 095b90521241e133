/* A small FMI 3.0 co-simulation FMU for the tests: values of every type, arrays, intermediate updates, and failures on
   demand. x' = u - k x by Euler's method with the mean of u over the step; v[i] = v[i]/2 + w[i] + a[i][0] - a[i][2];
   whole numbers: out = 3 in + steps, wrapped; Booleans: the other input, and not the input.

   With its event mode it has an event every `period` seconds, which it announces, or returns early for: `events` counts
   them, and `tick` ticks.

   Value references are the numbers of the fields below. fault: the status to answer with, 5 = NaN in x, 6 = asks to end
   the run. A call with a wrong number of values, or after fmi3Fatal, ends the process: the tests would see it.       */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3FunctionTypes.h"

#define WHOLE(X) X(Int8, int8_t) X(UInt8, uint8_t) X(Int16, int16_t) X(UInt16, uint16_t) X(Int32, int32_t) \
                 X(UInt32, uint32_t) X(Int64, int64_t) X(UInt64, uint64_t)

enum { U, X, K, W, V, A, SINGLE_IN, SINGLE_OUT, FAULT_TIME, FAULT, MODE, TRUTH_IN, TRUTH_OUT, LABEL, TICK, TIME,
       PERIOD, ANNOUNCED, EVENTS, FIRST_WHOLE = 20,
       FIELDS = FIRST_WHOLE + 16 };

typedef struct {
    double u, x, k, w[3], v[3], a[3][3];
    float single_in, single_out;
    double fault_time, time, period;
    int32_t fault, events;
    bool announced, event_mode, early_return;
    int64_t mode;
    bool truth_in[2], truth_out[2];
    char label[64];
#define FIELD(Name, type) type in_##Name, out_##Name;
    WHOLE(FIELD)
    void *at[FIELDS];
    size_t size[FIELDS];
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update;
    fmi3InstanceEnvironment environment;
    size_t followed;
    uint64_t steps;
    int fatal, states;
} Probe;

static fmi3Status answer(Probe *p, int status) {
    static const char *category[] = {"logStatusOK", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                     "logStatusFatal"};
    char text[128];
    snprintf(text, sizeof text, "%s answers %d\nas it was told", p->label, status);
    if (status > 0 && p->log) p->log(p->environment, (fmi3Status)status, category[status], text);
    p->fatal |= status == fmi3Fatal;
    return (fmi3Status)status;
}

static void place(Probe *p, int field, void *at, size_t size) {
    p->at[field] = at;
    p->size[field] = size;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference required[], size_t count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    if (strcmp(token, "probe3")) {
        log(environment, fmi3Error, "logStatusError", "wrong token");
        return NULL;
    }
    Probe *p = calloc(1, sizeof(Probe));
    p->log = log;
    p->update = update;
    p->environment = environment;
    p->followed = count;
    p->event_mode = event_mode;
    p->early_return = early_return;
    p->k = 1.0;
    p->fault_time = -1.0;
    p->mode = 1;
    p->w[1] = 0.5;
    p->w[2] = 1.0;
    strcpy(p->label, "probe3");
    for (int i = 0; i < 9; ++i) p->a[i / 3][i % 3] = 0.125 * i;
    place(p, U, &p->u, 1);
    place(p, X, &p->x, 1);
    place(p, K, &p->k, 1);
    place(p, W, p->w, 3);
    place(p, V, p->v, 3);
    place(p, A, p->a, 9);
    place(p, SINGLE_IN, &p->single_in, 1);
    place(p, SINGLE_OUT, &p->single_out, 1);
    place(p, FAULT_TIME, &p->fault_time, 1);
    place(p, FAULT, &p->fault, 1);
    place(p, MODE, &p->mode, 1);
    place(p, TRUTH_IN, p->truth_in, 2);
    place(p, TRUTH_OUT, p->truth_out, 2);
    place(p, TIME, &p->time, 1);
    place(p, PERIOD, &p->period, 1);
    place(p, ANNOUNCED, &p->announced, 1);
    place(p, EVENTS, &p->events, 1);
    int field = FIRST_WHOLE;
#define PLACE(Name, type) p->in_##Name = 1, place(p, field++, &p->in_##Name, 1), place(p, field++, &p->out_##Name, 1);
    WHOLE(PLACE)
    return p;
}

#define ACCESS(Name, type)                                                                                       \
    fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference r[], size_t n, type v[], size_t values) {  \
        Probe *p = c;                                                                                            \
        size_t used = 0;                                                                                         \
        for (size_t i = 0; i < n; used += p->size[r[i++]]) memcpy(v + used, p->at[r[i]], p->size[r[i]] * sizeof *v); \
        if (used != values || p->fatal) abort();                                                                 \
        return fmi3OK;                                                                                           \
    }                                                                                                            \
    fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference r[], size_t n, const type v[], size_t values) { \
        Probe *p = c;                                                                                            \
        size_t used = 0;                                                                                         \
        for (size_t i = 0; i < n; used += p->size[r[i++]]) memcpy(p->at[r[i]], v + used, p->size[r[i]] * sizeof *v); \
        if (used != values || p->fatal) abort();                                                                 \
        return fmi3OK;                                                                                           \
    }
WHOLE(ACCESS)
ACCESS(Float64, double)
ACCESS(Float32, float)
ACCESS(Boolean, bool)

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3String v[], size_t values) {
    for (size_t i = 0; i < n; ++i) snprintf(((Probe *)c)->label, 64, "%s", v[i]);
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean t, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean s, fmi3Float64 stop) {
    return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String names[]) { return fmi3OK; }

/* The mean of u over the step by Simpson's rule, and w at its end, where an importer lets inputs follow polynomials. */
static double follow(Probe *p, double time, double h) {
    double sample[3] = {p->u, p->u, p->u};
    bool early = false;
    double early_time = 0.0;
    for (int i = 0; p->update && p->followed && i < 3; ++i) {
        p->update(p->environment, time + 0.5 * i * h, true, false, false, false, &early, &early_time);
        sample[i] = p->u;
    }
    return (sample[0] + 4.0 * sample[1] + sample[2]) / 6.0;
}

static double next_event(const Probe *p) { return (p->events + 1) * p->period; }
static bool has_event(const Probe *p) { return p->period > 0.0 && p->time >= next_event(p) - 1e-12; }

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *reached) {
    Probe *p = c;
    if ((keep && p->states > 0) || p->fatal) abort();
    int fault = time >= p->fault_time - 1e-12 ? p->fault : 0;
    *event = *early = false;
    *end = fault == 6;
    if (p->event_mode && p->period > 0.0 && !p->announced && next_event(p) <= time + h + 1e-12) {
        *event = true;
        *early = next_event(p) < time + h - 1e-12;
        if (*early && !p->early_return) abort();
        if (*early) h = next_event(p) - time;
    }
    *reached = time + (fault == 2 || fault == 6 ? 0.5 * h : h);
    if (fault >= 2 && fault <= 4) return answer(p, fault);
    p->x = fault == 5 ? NAN : p->x + h * (follow(p, time, h) - p->k * p->x);
    for (int i = 0; i < 3; ++i) p->v[i] = 0.5 * p->v[i] + p->w[i] + p->a[i][0] - p->a[i][2];
    p->single_out = 0.5f * p->single_out + p->single_in;
    p->truth_out[0] = p->truth_in[1];
    p->truth_out[1] = !p->truth_in[0];
    p->time = time + h;
    p->steps += 1;
#define COUNT(Name, type) p->out_##Name = (type)(3u * (uint64_t)p->in_##Name + p->steps);
    WHOLE(COUNT)
    return answer(p, fault == 1 ? 1 : 0);
}

fmi3Status fmi3Terminate(fmi3Instance c) {
    if (((Probe *)c)->fatal) abort();
    return fmi3OK;
}
void fmi3FreeInstance(fmi3Instance c) {
    if (((Probe *)c)->fatal) abort();
    free(c);
}
const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *s) {
    if (!*s) *s = malloc(sizeof(Probe)), ((Probe *)c)->states += 1;
    memcpy(*s, c, sizeof(Probe));
    return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState s) {
    Probe *p = c, now = *p; /* pointers are those of this instance */
    memcpy(p, s, sizeof(Probe));
    memcpy(p->at, now.at, sizeof now.at);
    p->log = now.log;
    p->update = now.update;
    p->environment = now.environment;
    p->states = now.states;
    return fmi3OK;
}
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *s) {
    free(*s);
    *s = NULL;
    ((Probe *)c)->states -= 1;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState s, size_t *n) {
    *n = sizeof(Probe);
    return fmi3OK;
}
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState s, fmi3Byte b[], size_t n) {
    memcpy(b, s, n);
    return fmi3OK;
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte b[], size_t n, fmi3FMUState *s) {
    if (n != sizeof(Probe)) return fmi3Error;
    *s = memcpy(malloc(n), b, n);
    ((Probe *)c)->states += 1;
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3EnterStepMode(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Clock v[]) {
    if (n != 1 || r[0] != TICK) abort();
    v[0] = has_event(c);
    return fmi3OK;
}
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *known, fmi3Float64 *next) {
    Probe *p = c;
    if (!p->event_mode) abort();
    *again = has_event(p);
    p->events += has_event(p);
    *end = *nominals = *values = false;
    *known = p->announced && p->period > 0.0;
    *next = next_event(p);
    return fmi3OK;
}

/* What the tests do not need: a host finds the names. */
#define ABSENT(name) int name(void) { return fmi3Error; }
ABSENT(fmi3InstantiateModelExchange) ABSENT(fmi3InstantiateScheduledExecution) ABSENT(fmi3Reset)
ABSENT(fmi3ActivateModelPartition) ABSENT(fmi3CompletedIntegratorStep) ABSENT(fmi3EnterConfigurationMode)
ABSENT(fmi3EnterContinuousTimeMode)
ABSENT(fmi3EvaluateDiscreteStates) ABSENT(fmi3ExitConfigurationMode)
ABSENT(fmi3GetAdjointDerivative)
ABSENT(fmi3GetDirectionalDerivative) ABSENT(fmi3GetOutputDerivatives) ABSENT(fmi3GetBinary) ABSENT(fmi3SetBinary)
ABSENT(fmi3GetString) ABSENT(fmi3SetClock) ABSENT(fmi3GetContinuousStateDerivatives)
ABSENT(fmi3GetContinuousStates) ABSENT(fmi3SetContinuousStates) ABSENT(fmi3GetNominalsOfContinuousStates)
ABSENT(fmi3GetNumberOfContinuousStates) ABSENT(fmi3GetEventIndicators) ABSENT(fmi3GetNumberOfEventIndicators)
ABSENT(fmi3GetNumberOfVariableDependencies) ABSENT(fmi3GetVariableDependencies) ABSENT(fmi3SetTime)
ABSENT(fmi3GetIntervalDecimal) ABSENT(fmi3GetIntervalFraction) ABSENT(fmi3SetIntervalDecimal)
ABSENT(fmi3SetIntervalFraction) ABSENT(fmi3GetShiftDecimal) ABSENT(fmi3GetShiftFraction) ABSENT(fmi3SetShiftDecimal)
ABSENT(fmi3SetShiftFraction)
