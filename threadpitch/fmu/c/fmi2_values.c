/* FMI 2.0 for co-simulation: values and derivatives got and set. Source: FMI 2.0.5, sections 2.1.7 and 4.2.1. */
#include <string.h>

#include "fmi2Functions.h"
#include "life.h"

/* When values may be got and set: the table in FMI 2.0.5, section 4.2.4. */
enum {
    READABLE = INITIALIZING | STEPPING | TERMINATED | FAILED,
    SETTABLE = INSTANTIATED | INITIALIZING | STEPPING
};


static bool begin_get(Instance *instance, const char *function, const fmi2ValueReference vr[], size_t nvr,
                      const void *value)
{
    if (instance == NULL || !instance_allowed(instance, function, READABLE) ||
        !instance_values_given(instance, function, nvr, vr, value)) {
        return false;
    }
    life_settle(instance);
    return true;
}

static bool begin_set(Instance *instance, const char *function, const fmi2ValueReference vr[], size_t nvr,
                      const void *value)
{
    if (instance == NULL || !instance_allowed(instance, function, SETTABLE) ||
        !instance_values_given(instance, function, nvr, vr, value)) {
        return false;
    }
    life_unsettle(instance);
    return true;
}

static const Cell *cell_of(Instance *instance, fmi2ValueReference reference, Kind kind)
{
    if (reference < instance->cell_count && instance->cells[reference].kind == kind) {
        return &instance->cells[reference];
    }
    instance_fail(instance, "value reference %z is not of type %s in this FMU", (size_t)reference, kind_name(kind));
    return NULL;
}

/* The value of a variable that may be set, or NULL. */
static void *target_of(Instance *instance, fmi2ValueReference reference, Kind kind)
{
    const Cell *cell = cell_of(instance, reference, kind);
    return cell != NULL && instance_settable(instance, cell) ? cell->value : NULL;
}

/* Importers that record everything get thousands of values in every step: where the references count up and their
 * values lie one after another, they are copied together. */
enum { WORTH_A_CALL = 16 }; /* values: fewer are compared and copied sooner than a library function is called */

/* How many of the references count up one by one from the first. */
static size_t counting_up(const Instance *instance, const fmi2ValueReference vr[], size_t most)
{
    if (most >= WORTH_A_CALL && memcmp(vr, instance->numbers + vr[0], most * sizeof *vr) == 0) {
        return most;
    }
    size_t count = 1;
    while (count < most && vr[count] == vr[0] + count) {
        count++;
    }
    return count;
}

static void copy_reals(double *to, const double *from, size_t count)
{
    if (count >= WORTH_A_CALL) {
        memcpy(to, from, count * sizeof *to);
        return;
    }
    for (size_t i = 0; i < count; i++) {
        to[i] = from[i];
    }
}

/* False where one does not fit into an fmi2Integer, and then the instance fails. */
static bool copy_integers(Instance *instance, fmi2Integer *to, const Cell *cells, size_t count)
{
    const int64_t *from = cells->value;
    int64_t lost = 0;
    for (size_t i = 0; i < count; i++) {
        to[i] = (fmi2Integer)from[i];
        lost |= from[i] ^ to[i];
    }
    for (size_t i = 0; lost != 0 && i < count; i++) {
        if (!instance_integer(instance, cells + i, to + i)) {
            return false;
        }
    }
    return true;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    if (!begin_get(c, "fmi2GetReal", vr, nvr, value)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr;) {
        const Cell *cell = cell_of(c, vr[i], REAL);
        if (cell == NULL) {
            return fmi2Error;
        }
        size_t count = counting_up(c, vr + i, cell->row < nvr - i ? cell->row : nvr - i);
        copy_reals(value + i, cell->value, count);
        i += count;
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    if (!begin_get(c, "fmi2GetInteger", vr, nvr, value)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr;) {
        const Cell *cell = cell_of(c, vr[i], INTEGER);
        if (cell == NULL) {
            return fmi2Error;
        }
        size_t count = counting_up(c, vr + i, cell->row < nvr - i ? cell->row : nvr - i);
        if (!copy_integers(c, value + i, cell, count)) {
            return fmi2Error;
        }
        i += count;
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    if (!begin_get(c, "fmi2GetBoolean", vr, nvr, value)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr; i++) {
        const Cell *cell = cell_of(c, vr[i], BOOLEAN);
        if (cell == NULL) {
            return fmi2Error;
        }
        value[i] = *(const bool *)cell->value ? fmi2True : fmi2False;
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    if (!begin_set(c, "fmi2SetReal", vr, nvr, value)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr; i++) {
        double *target = target_of(c, vr[i], REAL);
        if (target == NULL) {
            return fmi2Error;
        }
        *target = value[i];
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    if (!begin_set(c, "fmi2SetInteger", vr, nvr, value)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr; i++) {
        int64_t *target = target_of(c, vr[i], INTEGER);
        if (target == NULL) {
            return fmi2Error;
        }
        *target = value[i];
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    if (!begin_set(c, "fmi2SetBoolean", vr, nvr, value)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr; i++) {
        bool *target = target_of(c, vr[i], BOOLEAN);
        if (target == NULL) {
            return fmi2Error;
        }
        *target = value[i] != fmi2False;
    }
    return fmi2OK;
}

static fmi2Status no_strings(Instance *instance, size_t nvr)
{
    return nvr == 0 ? fmi2OK
                    : (fmi2Status)instance_fail(instance, "this FMU has no variables of type string; use its "
                                                          "model description");
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    return begin_get(c, "fmi2GetString", vr, nvr, value) ? no_strings(c, nvr) : fmi2Error;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    return begin_set(c, "fmi2SetString", vr, nvr, value) ? no_strings(c, nvr) : fmi2Error;
}

/* Derivatives ----------------------------------------------------------------------------------------------------- */

static bool interpolates(void)
{
    for (size_t i = 0; i < model.variable_count; i++) {
        if (model.variables[i].derivatives > 0) {
            return true;
        }
    }
    return false;
}

static const Cell *cell_of_order(Instance *instance, fmi2ValueReference reference, Causality causality, int order)
{
    const Cell *cell = cell_of(instance, reference, REAL);
    if (cell == NULL) {
        return NULL;
    }
    if (cell->variable->causality != causality || order < 1) {
        instance_fail(instance, "%s has no derivative of order %i to be %s; name %s, and orders from 1",
                      cell->variable->name, (int64_t)order, causality == INPUT ? "set" : "got",
                      causality == INPUT ? "inputs" : "outputs");
        return NULL;
    }
    return cell;
}

/* An order above those that the model takes is left out: the input is then interpolated with the lower order. */
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    if (!begin_set(c, "fmi2SetRealInputDerivatives", vr, nvr, value) ||
        !instance_values_given(c, "fmi2SetRealInputDerivatives", nvr, vr, order)) {
        return fmi2Error;
    }
    if (!interpolates()) {
        return (fmi2Status)instance_fail(c, "this FMU takes no input derivatives; see canInterpolateInputs");
    }
    for (size_t i = 0; i < nvr; i++) {
        const Cell *cell = cell_of_order(c, vr[i], INPUT, order[i]);
        if (cell == NULL) {
            return fmi2Error;
        }
        double *derivative = life_input_derivative(c, cell->variable, order[i]);
        if (derivative != NULL) {
            *derivative = value[i];
        }
    }
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    if (c == NULL || !instance_allowed(c, "fmi2GetRealOutputDerivatives", STEPPING | TERMINATED | FAILED) ||
        !instance_values_given(c, "fmi2GetRealOutputDerivatives", nvr, vr, value) ||
        !instance_values_given(c, "fmi2GetRealOutputDerivatives", nvr, vr, order)) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr; i++) {
        const Cell *cell = cell_of_order(c, vr[i], OUTPUT, order[i]);
        if (cell == NULL) {
            return fmi2Error;
        }
        value[i] = cell_derivative(c, cell, order[i]);
    }
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
    if (c == NULL) {
        return fmi2Error;
    }
    return (fmi2Status)instance_fail(c, "this FMU provides no directional derivatives; difference its outputs");
}
