/* FMI 3.0 for co-simulation: getting and setting variables, clocks and derivatives. Source: FMI 3.0.2, sections 2.2.5,
 * 2.2.9 and 4.1.2. A value reference is the index of a variable; behind them come time and the clocks. */
#include <string.h>

#include "fmi3_component.h"
#include "state.h"

enum {
    READABLE = ANY_PHASE,
    SETTABLE = INSTANTIATED | INITIALIZING | EVENT | STEPPING | INTERMEDIATE
};

static bool begin_get(Instance *instance, const char *function, const fmi3ValueReference references[], size_t count,
                      const void *values)
{
    if (instance == NULL || !instance_values_given(instance, function, count, references, values)) {
        return false;
    }
    life_settle(instance);
    return true;
}

static bool begin_set(Instance *instance, const char *function, const fmi3ValueReference references[], size_t count,
                      const void *values)
{
    if (instance == NULL || !instance_allowed(instance, function, SETTABLE) ||
        !instance_values_given(instance, function, count, references, values)) {
        return false;
    }
    life_unsettle(instance);
    return true;
}

/* The cells of a variable, and how many of the importer's values were dealt with before it. */
typedef struct {
    const Cell *cells;
    size_t count;
    size_t used;
} Span;

/* In an intermediate update only what the importer named, and what the update is for. */
static bool within_update(Instance *instance, fmi3ValueReference reference, bool permitted)
{
    const Component *component = (const Component *)instance;
    if (instance->life.phase != INTERMEDIATE || (permitted && component->intermediate[reference])) {
        return true;
    }
    instance_fail(instance, "%s cannot be accessed in this intermediate update; name it when the FMU is instantiated, "
                            "set inputs before the step and get outputs after it", model.variables[reference].name);
    return false;
}

/* Moves the span on to the next variable; false, and the instance fails, where there is none or no room for it. */
static bool move_to(Instance *instance, fmi3ValueReference reference, Kind kind, size_t value_count, Span *span)
{
    span->used += span->count;
    if (reference >= model.variable_count || model.variables[reference].kind != kind) {
        instance_fail(instance, "value reference %z is not of type %s in this FMU", (size_t)reference,
                      kind_name(kind));
        return false;
    }
    span->cells = &instance->cells[instance->first[reference]];
    span->count = instance->first[reference + 1] - instance->first[reference];
    if (span->used + span->count > value_count) {
        instance_fail(instance, "%z values are not enough for %s; give room for all elements of arrays", value_count,
                      model.variables[reference].name);
        return false;
    }
    return true;
}

static bool move_to_get(Instance *instance, fmi3ValueReference reference, Kind kind, size_t value_count, Span *span)
{
    return move_to(instance, reference, kind, value_count, span) &&
           within_update(instance, reference, ((const Component *)instance)->get_allowed);
}

static bool move_to_set(Instance *instance, fmi3ValueReference reference, Kind kind, size_t value_count, Span *span)
{
    return move_to(instance, reference, kind, value_count, span) && instance_settable(instance, span->cells) &&
           within_update(instance, reference, ((const Component *)instance)->set_requested);
}

static fmi3Status end(Instance *instance, const char *function, const Span *span, size_t value_count)
{
    if (span->used + span->count != value_count) {
        return (fmi3Status)instance_fail(instance, "%s has variables of %z values and room for %z; make them equal",
                                         function, span->used + span->count, value_count);
    }
    return fmi3OK;
}

/* Types that models have ------------------------------------------------------------------------------------------ */

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float64 values[], size_t nValues)
{
    Instance *self = instance;
    Span span = {NULL, 0, 0};
    if (!begin_get(self, "fmi3GetFloat64", valueReferences, nValueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (valueReferences[i] == model.variable_count && span.used + span.count < nValues) { /* time */
            span.used += span.count;
            span.count = 1;
            values[span.used] = self->life.time;
            continue;
        }
        if (!move_to_get(self, valueReferences[i], REAL, nValues, &span)) {
            return fmi3Error;
        }
        memcpy(values + span.used, span.cells->value, span.count * sizeof(double));
    }
    return end(self, "fmi3GetFloat64", &span, nValues);
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Int32 values[], size_t nValues)
{
    Span span = {NULL, 0, 0};
    if (!begin_get(instance, "fmi3GetInt32", valueReferences, nValueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (!move_to_get(instance, valueReferences[i], INTEGER, nValues, &span)) {
            return fmi3Error;
        }
        for (size_t element = 0; element < span.count; element++) {
            if (!instance_integer(instance, &span.cells[element], &values[span.used + element])) {
                return fmi3Error;
            }
        }
    }
    return end(instance, "fmi3GetInt32", &span, nValues);
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Boolean values[], size_t nValues)
{
    Span span = {NULL, 0, 0};
    if (!begin_get(instance, "fmi3GetBoolean", valueReferences, nValueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (!move_to_get(instance, valueReferences[i], BOOLEAN, nValues, &span)) {
            return fmi3Error;
        }
        memcpy(values + span.used, span.cells->value, span.count * sizeof(bool));
    }
    return end(instance, "fmi3GetBoolean", &span, nValues);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues)
{
    Span span = {NULL, 0, 0};
    if (!begin_set(instance, "fmi3SetFloat64", valueReferences, nValueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (!move_to_set(instance, valueReferences[i], REAL, nValues, &span)) {
            return fmi3Error;
        }
        memcpy(span.cells->value, values + span.used, span.count * sizeof(double));
    }
    return end(instance, "fmi3SetFloat64", &span, nValues);
}

fmi3Status fmi3SetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Int32 values[], size_t nValues)
{
    Span span = {NULL, 0, 0};
    if (!begin_set(instance, "fmi3SetInt32", valueReferences, nValueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (!move_to_set(instance, valueReferences[i], INTEGER, nValues, &span)) {
            return fmi3Error;
        }
        for (size_t element = 0; element < span.count; element++) {
            *(int64_t *)span.cells[element].value = values[span.used + element];
        }
    }
    return end(instance, "fmi3SetInt32", &span, nValues);
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Boolean values[], size_t nValues)
{
    Span span = {NULL, 0, 0};
    if (!begin_set(instance, "fmi3SetBoolean", valueReferences, nValueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (!move_to_set(instance, valueReferences[i], BOOLEAN, nValues, &span)) {
            return fmi3Error;
        }
        for (size_t element = 0; element < span.count; element++) {
            *(bool *)span.cells[element].value = values[span.used + element];
        }
    }
    return end(instance, "fmi3SetBoolean", &span, nValues);
}

/* Clocks and derivatives ------------------------------------------------------------------------------------------ */

/* Active from the end of the step that counted until fmi3UpdateDiscreteStates. */
fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[])
{
    Instance *self = instance;
    if (self == NULL || !instance_allowed(self, "fmi3GetClock", EVENT) ||
        !instance_values_given(self, "fmi3GetClock", nValueReferences, valueReferences, values)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        size_t number = valueReferences[i] - model.variable_count - 1; /* wraps to a large one below the clocks */
        if (valueReferences[i] <= model.variable_count || number >= model.clock_count) {
            return (fmi3Status)instance_fail(self, "value reference %z is not a clock of this FMU",
                                             (size_t)valueReferences[i]);
        }
        const Cell *cell = &self->cells[self->first[model.clocks[number].variable] + model.clocks[number].element];
        values[i] = self->life.ticking && *(const int64_t *)cell->value != 0;
    }
    return fmi3OK;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t nValues)
{
    static const char NAME[] = "fmi3GetOutputDerivatives";
    Span span = {NULL, 0, 0};
    if (instance == NULL || !instance_allowed(instance, NAME, STEPPING | INTERMEDIATE | TERMINATED | FAILED) ||
        !instance_values_given(instance, NAME, nValueReferences, valueReferences, values) ||
        !instance_values_given(instance, NAME, nValueReferences, valueReferences, orders)) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValueReferences; i++) {
        if (!move_to_get(instance, valueReferences[i], REAL, nValues, &span)) {
            return fmi3Error;
        }
        if (span.cells->variable->causality != OUTPUT || orders[i] < 1) {
            return (fmi3Status)instance_fail(instance, "%s has no derivative of order %i to be got; name outputs, and "
                                                       "orders from 1", span.cells->variable->name,
                                             (int64_t)orders[i]);
        }
        for (size_t element = 0; element < span.count; element++) {
            values[span.used + element] = cell_derivative(instance, &span.cells[element], orders[i]);
        }
    }
    return end(instance, NAME, &span, nValues);
}
