#include "life.h"

#include <math.h>

#include "state.h"

/* Importers count time in their own ways, some in whole nanoseconds: times this close are the same. */
static const double NEAR = 1e-9;           /* s, and of the time */
static const double NEAR_OF_A_STEP = 1e-6; /* of a step */

static double tolerance(double time, double step_size)
{
    return NEAR * (1.0 + fabs(time)) + NEAR_OF_A_STEP * step_size;
}

/* Complaints ------------------------------------------------------------------------------------------------------ */

static void add_value(Text *text, const Cell *cell)
{
    if (cell->variable->kind == REAL) {
        text_add(text, "%r", *(const double *)cell->value);
    } else {
        text_add(text, "%i", *(const int64_t *)cell->value);
    }
}

static void add_limit(Text *text, const Variable *variable, double limit)
{
    if (isinf(limit)) {
        text_add(text, limit < 0.0 ? "-infinity" : "infinity");
    } else if (variable->kind == INTEGER) {
        text_add(text, "%i", (int64_t)limit);
    } else {
        text_add(text, "%r", limit);
    }
}

static void add_choices(Text *text, const Variable *variable)
{
    for (size_t i = 0; i < variable->choice_count; i++) {
        text_add(text, i == 0 ? " " : ", ");
        if (variable->choice_names != NULL) {
            text_add(text, "%s = ", variable->choice_names[i]);
        }
        text_add(text, "%i", variable->choices[i]);
    }
}

static bool chosen(const Variable *variable, int64_t value)
{
    for (size_t i = 0; i < variable->choice_count; i++) {
        if (variable->choices[i] == value) {
            return true;
        }
    }
    return variable->choices == NULL;
}

static bool within_range(const Cell *cell)
{
    const Variable *variable = cell->variable;
    double value = variable->kind == REAL ? *(const double *)cell->value : (double)*(const int64_t *)cell->value;
    return value >= variable->minimum && value <= variable->maximum;
}

/* False, with the complaint, where the parameter or input cannot be initialized with. */
static bool acceptable(const Cell *cell, Text *complaint)
{
    const Variable *variable = cell->variable;
    bool parameter = variable->causality == PARAMETER;
    if (variable->kind == BOOLEAN || (!parameter && variable->causality != INPUT)) {
        return true;
    }
    bool finite = variable->kind != REAL || isfinite(*(const double *)cell->value);
    bool listed = variable->kind != INTEGER || chosen(variable, *(const int64_t *)cell->value);
    if (finite && (!parameter || (listed && within_range(cell)))) {
        return true;
    }
    text_add(complaint, parameter ? "parameter " : "input ");
    cell_name(cell, complaint);
    text_add(complaint, " is ");
    add_value(complaint, cell);
    if (!finite) {
        text_add(complaint, "; set a finite value");
    } else if (!listed) {
        text_add(complaint, "; set one of");
        add_choices(complaint, variable);
    } else {
        text_add(complaint, "; set a value from ");
        add_limit(complaint, variable, variable->minimum);
        text_add(complaint, " to ");
        add_limit(complaint, variable, variable->maximum);
        if (variable->unit[0] != '1' || variable->unit[1] != '\0') {
            text_add(complaint, " %s", variable->unit);
        }
    }
    return false;
}

static void add_declared(Text *complaint, int64_t number)
{
    const char *sentence = model.error(number);
    if (sentence != NULL) {
        text_add(complaint, "%s", sentence);
    } else {
        text_add(complaint, "the model reports the undeclared error %i", number);
    }
}

/* FMI passes integers in 32 bits. */
static bool counts_fit(const Instance *instance, Text *complaint)
{
    for (size_t i = 0; i < instance->count_count; i++) {
        int64_t value = *(const int64_t *)instance->counts[i]->value;
        if (value < INT32_MIN || value > INT32_MAX) {
            cell_name(instance->counts[i], complaint);
            text_add(complaint, " is %i, beyond the 32 bits of an FMI integer", value);
            return false;
        }
    }
    return true;
}

/* Initialisation -------------------------------------------------------------------------------------------------- */

static bool initialize(Instance *instance, Text *complaint)
{
    for (size_t i = 0; i < instance->cell_count; i++) {
        if (!acceptable(&instance->cells[i], complaint)) {
            return false;
        }
    }
    int64_t number = model.check(instance->self);
    if (number == 0) {
        number = model.initialize(instance->self);
    }
    if (number != 0) {
        add_declared(complaint, number);
        return false;
    }
    instance->life.stale = !counts_fit(instance, complaint);
    return !instance->life.stale;
}

Status life_set_times(Instance *instance, double start, double stop)
{
    if (!isfinite(start) || !(stop >= start)) {
        return instance_fail(instance, "a run from %r s to %r s cannot be; give a finite start time and a stop time "
                                       "that is not before it", start, stop);
    }
    instance->life.start = start;
    instance->life.time = start;
    instance->life.stop = stop;
    return STATUS_OK;
}

void life_settle(Instance *instance)
{
    Text unsaid;
    if (instance->life.phase == INITIALIZING && instance->life.stale) {
        text_clear(&unsaid);
        initialize(instance, &unsaid);
    }
}

void life_unsettle(Instance *instance)
{
    if ((instance->life.phase & (INSTANTIATED | INITIALIZING)) != 0) {
        instance->life.stale = true;
    }
}

Status life_exit_initialization(Instance *instance, Phase next)
{
    Text complaint;
    text_clear(&complaint);
    if (instance->life.stale && !initialize(instance, &complaint)) {
        return instance_fail(instance, "%s", complaint.characters);
    }
    instance->life.phase = next;
    return STATUS_OK;
}

/* Steps ----------------------------------------------------------------------------------------------------------- */

double *life_input_derivative(const Instance *instance, const Variable *input, int order)
{
    if (input->causality != INPUT || input->size != 0 || order < 1 || order > input->derivatives) {
        return NULL;
    }
    return (double *)(void *)((char *)instance->self + input->derivative[order - 1]);
}

/* Input derivatives belong to the step for which they were set (FMI 2.0.5, 4.2.1). */
static void clear_derivatives(const Instance *instance)
{
    for (size_t i = 0; i < instance->input_count; i++) {
        for (int order = 1; order <= instance->inputs[i]->variable->derivatives; order++) {
            double *derivative = life_input_derivative(instance, instance->inputs[i]->variable, order);
            if (derivative != NULL) {
                *derivative = 0.0;
            }
        }
    }
}

static bool inputs_finite(const Instance *instance, Text *complaint)
{
    for (size_t i = 0; i < instance->input_count; i++) {
        const Cell *cell = instance->inputs[i];
        double value = *(const double *)cell->value;
        if (!isfinite(value)) {
            text_add(complaint, "input ");
            cell_name(cell, complaint);
            text_add(complaint, " is %r; connect a finite value", value);
            return false;
        }
        for (int order = 1; order <= cell->variable->derivatives; order++) {
            const double *derivative = life_input_derivative(instance, cell->variable, order);
            if (derivative != NULL && !isfinite(*derivative)) {
                text_add(complaint, "derivative %i of input %s is %r; give a finite one", (int64_t)order,
                         cell->variable->name, *derivative);
                return false;
            }
        }
    }
    return true;
}

Status life_begin_step(Instance *instance, double time, double step_size)
{
    const Life *life = &instance->life;
    if (!isfinite(step_size) || !(step_size > 0.0)) {
        return instance_fail(instance, "the step from %r s of %r s is refused: the step size must be positive and "
                                       "finite", time, step_size);
    }
    if (!(fabs(time - life->time) <= tolerance(life->time, step_size))) {
        return instance_fail(instance, "the step from %r s of %r s is refused: the FMU is at %r s; step on from there",
                             time, step_size, life->time);
    }
    if (time + step_size > life->stop + tolerance(life->stop, step_size)) {
        return instance_fail(instance, "the step from %r s of %r s is refused: it passes the stop time %r s", time,
                             step_size, life->stop);
    }
    image_save(instance, instance->before);
    return STATUS_OK;
}

static bool compute(Instance *instance, double time, double step_size, Text *complaint)
{
    if (!inputs_finite(instance, complaint)) {
        return false;
    }
    int64_t number = model.step(instance->self, time, step_size);
    if (number != 0) {
        add_declared(complaint, number);
        return false;
    }
    return counts_fit(instance, complaint);
}

Status life_compute_step(Instance *instance, double time, double step_size)
{
    Text complaint;
    text_clear(&complaint);
    if (!compute(instance, time, step_size, &complaint)) {
        image_restore(instance, instance->before);
        instance->life.refused = true;
        instance_say(instance, STATUS_DISCARD, "the step from %r s of %r s is refused: %s", time, step_size,
                     complaint.characters);
        return STATUS_DISCARD;
    }
    clear_derivatives(instance);
    instance->life.refused = false;
    instance->life.time = time + step_size;
    instance->life.ticking = model.clock_count > 0;
    return STATUS_OK;
}
