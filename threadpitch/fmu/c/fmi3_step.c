/* FMI 3.0 for co-simulation: the step, with its intermediate updates, and the FMU state. Source: FMI 3.0.2, sections
 * 2.2.6 and 4.2.
 *
 * A step of the model is one piece, so it neither pauses nor returns early. What an importer gains from intermediate
 * updates is the extrapolation of inputs: before the step is computed the importer is asked for the inputs that the
 * model can follow inside it, at the beginning, in the middle and at the end of the step (tentatively:
 * intermediateStepFinished = false). The polynomial of order 1 or 2 through these samples is what an importer of FMI
 * 2.0 would give with fmi2SetRealInputDerivatives. When the step is done, outputs may be got once, at its end. */
#include "fmi3_component.h"
#include "state.h"

/* Intermediate updates -------------------------------------------------------------------------------------------- */

/* Calls the importer at `time`; false where it made the FMU fail. */
static bool update_at(Component *component, double time, bool finished)
{
    fmi3Boolean early_return_requested = false; /* has no meaning: canReturnEarly is false */
    fmi3Float64 early_return_time = 0.0;
    Life *life = &component->instance.life;
    life->phase = INTERMEDIATE;
    component->set_requested = !finished;
    component->get_allowed = finished;
    component->update(component->environment, time, !finished, finished, finished, false, &early_return_requested,
                      &early_return_time);
    component->set_requested = false;
    component->get_allowed = false;
    if (life->phase != INTERMEDIATE) {
        return false;
    }
    life->phase = STEPPING;
    return true;
}

static double *value_of(const Component *component, size_t variable)
{
    return component->instance.cells[component->instance.first[variable]].value;
}

/* The highest order that the model takes of an input which the importer extrapolates; 0: it does not. */
static int order_of(const Component *component, size_t variable)
{
    const Variable *input = &model.variables[variable];
    int order = component->intermediate[variable] && input->causality == INPUT ? input->derivatives : 0;
    return life_input_derivative(&component->instance, input, order) == NULL ? 0 : order;
}

static int highest_order(const Component *component)
{
    int highest = 0;
    for (size_t i = 0; i < model.variable_count; i++) {
        int order = order_of(component, i);
        highest = order > highest ? order : highest;
    }
    return highest;
}

/* u(t + tau) = u0 + u' tau + u''/2 tau^2 through the samples u0 at 0, u1 at h/2 and u2 at h (of order 1: u0 and u2).
 * In differences, so that an input that is held gives exact zeros. */
static void follow(const Component *component, size_t variable, double step_size)
{
    const double *samples = component->samples + SAMPLES * variable;
    const double to_middle = samples[1] - samples[0];
    const double to_end = samples[2] - samples[0];
    double *first = life_input_derivative(&component->instance, &model.variables[variable], 1);
    double *second = life_input_derivative(&component->instance, &model.variables[variable], 2);
    *first = to_end / step_size;
    if (second != NULL) {
        *first = (4.0 * to_middle - to_end) / step_size;
        *second = 4.0 * (to_end - 2.0 * to_middle) / (step_size * step_size);
    }
    *value_of(component, variable) = samples[0];
}

/* Asks for the inputs over the step and gives them to the model; false where the importer made the FMU fail. */
static bool sample_inputs(Component *component, double time, double step_size)
{
    const double instants[SAMPLES] = {time, time + 0.5 * step_size, time + step_size};
    int order = highest_order(component);
    for (size_t i = 0; i < SAMPLES && order > 0; i++) {
        if (i == 1 && order == 1) {
            continue; /* a line needs no middle */
        }
        if (!update_at(component, instants[i], false)) {
            return false;
        }
        for (size_t variable = 0; variable < model.variable_count; variable++) {
            if (order_of(component, variable) > 0) {
                component->samples[SAMPLES * variable + i] = *value_of(component, variable);
            }
        }
    }
    for (size_t variable = 0; variable < model.variable_count; variable++) {
        if (order_of(component, variable) > 0) {
            follow(component, variable, step_size);
        }
    }
    return true;
}

/* The value that was set last remains, which is the one at the end of the step. */
static void keep_last_inputs(const Component *component)
{
    for (size_t variable = 0; variable < model.variable_count; variable++) {
        if (order_of(component, variable) > 0) {
            *value_of(component, variable) = component->samples[SAMPLES * variable + SAMPLES - 1];
        }
    }
}

/* Steps ----------------------------------------------------------------------------------------------------------- */

static bool has_ticked(const Instance *instance)
{
    for (size_t i = 0; i < model.clock_count; i++) {
        const Clock *clock = &model.clocks[i];
        const Cell *cell = &instance->cells[instance->first[clock->variable] + clock->element];
        if (*(const int64_t *)cell->value != 0) {
            return instance->event_mode_used;
        }
    }
    return false;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                      fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    Component *component = instance;
    Instance *self = instance;
    (void)noSetFMUStatePriorToCurrentPoint; /* there is no result buffer to flush */
    if (self == NULL || !instance_allowed(self, "fmi3DoStep", STEPPING) ||
        !instance_given(self, "fmi3DoStep", eventHandlingNeeded) ||
        !instance_given(self, "fmi3DoStep", terminateSimulation) || !instance_given(self, "fmi3DoStep", earlyReturn) ||
        !instance_given(self, "fmi3DoStep", lastSuccessfulTime)) {
        return fmi3Error;
    }
    *eventHandlingNeeded = false;
    *terminateSimulation = false;
    *earlyReturn = false;
    *lastSuccessfulTime = self->life.time;
    if (life_begin_step(self, currentCommunicationPoint, communicationStepSize) != STATUS_OK ||
        (component->update != NULL &&
         !sample_inputs(component, currentCommunicationPoint, communicationStepSize))) {
        return fmi3Error;
    }
    Status status = life_compute_step(self, currentCommunicationPoint, communicationStepSize);
    if (status != STATUS_OK) {
        /* FMI 3.0.2, section 2.2.4: an importer that does not try another way treats fmi3Discard as an error and ends the
         * simulation. An early return must not stand for it (section 4.2.1). */
        return (fmi3Status)status;
    }
    *eventHandlingNeeded = has_ticked(self);
    *lastSuccessfulTime = self->life.time;
    if (component->update != NULL) {
        keep_last_inputs(component);
        return update_at(component, self->life.time, true) ? fmi3OK : fmi3Error;
    }
    return fmi3OK;
}

/* FMU state ------------------------------------------------------------------------------------------------------- */

static bool state_allowed(Instance *instance, const char *function)
{
    return instance != NULL && instance_allowed(instance, function, ANY_PHASE & ~INTERMEDIATE);
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    if (!state_allowed(instance, "fmi3GetFMUState") || !instance_given(instance, "fmi3GetFMUState", FMUState)) {
        return fmi3Error;
    }
    State *state = *FMUState;
    Status status = state_get(instance, &state);
    *FMUState = state;
    return (fmi3Status)status;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    return state_allowed(instance, "fmi3SetFMUState") ? (fmi3Status)state_set(instance, FMUState) : fmi3Error;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    if (!state_allowed(instance, "fmi3FreeFMUState")) {
        return fmi3Error;
    }
    if (FMUState == NULL) {
        return fmi3OK; /* FMI 3.0.2, section 2.2.6.4: the call is ignored */
    }
    State *state = *FMUState;
    Status status = state_free(instance, &state);
    *FMUState = state;
    return (fmi3Status)status;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    (void)FMUState; /* all have the same size */
    if (!state_allowed(instance, "fmi3SerializedFMUStateSize") ||
        !instance_given(instance, "fmi3SerializedFMUStateSize", size)) {
        return fmi3Error;
    }
    *size = state_size(instance);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[],
                                 size_t size)
{
    if (!state_allowed(instance, "fmi3SerializeFMUState") ||
        !instance_given(instance, "fmi3SerializeFMUState", serializedState)) {
        return fmi3Error;
    }
    return (fmi3Status)state_serialize(instance, model.token3, FMUState, serializedState, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size,
                                   fmi3FMUState *FMUState)
{
    if (!state_allowed(instance, "fmi3DeserializeFMUState") ||
        !instance_given(instance, "fmi3DeserializeFMUState", serializedState) ||
        !instance_given(instance, "fmi3DeserializeFMUState", FMUState)) {
        return fmi3Error;
    }
    State *state = NULL;
    Status status = state_deserialize(instance, model.token3, serializedState, size, &state);
    if (status == STATUS_OK) {
        *FMUState = state;
    }
    return (fmi3Status)status;
}
