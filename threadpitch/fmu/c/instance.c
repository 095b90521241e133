#include "instance.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "state.h"

static const char *const CATEGORIES[] = {"", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                         "logStatusFatal"}; /* at the place of their status */

/* Memory and variables -------------------------------------------------------------------------------------------- */

static size_t scalar_count(const Variable *variable)
{
    return variable->size == 0 ? 1 : variable->size;
}

/* Of element 0; the others follow it. */
static void *values_of(void *self, const Variable *variable)
{
    char *member = (char *)self + variable->offset;
    if (variable->size == 0) {
        return member;
    }
    void *values;
    memcpy(&values, member, sizeof values); /* the span's first member, whatever it points to */
    return values;
}

static void add_cells(Instance *instance, const Variable *variable)
{
    char *values = values_of(instance->self, variable);
    for (size_t element = 0; element < scalar_count(variable); element++) {
        instance->numbers[instance->cell_count] = (unsigned)instance->cell_count;
        Cell *cell = &instance->cells[instance->cell_count++];
        cell->variable = variable;
        cell->element = element;
        cell->kind = variable->kind;
        cell->value = values + element * kind_size(variable->kind);
        if (variable->kind == REAL && variable->causality == INPUT) {
            instance->inputs[instance->input_count++] = cell;
        }
        if (variable->kind == INTEGER && (variable->causality == OUTPUT || variable->causality == LOCAL)) {
            instance->counts[instance->count_count++] = cell;
        }
    }
}

static void count_rows(Instance *instance)
{
    for (size_t i = instance->cell_count; i-- > 0;) {
        Cell *cell = &instance->cells[i];
        const Cell *next = cell + 1;
        bool joined = i + 1 < instance->cell_count && next->kind == cell->kind &&
                      (char *)next->value == (char *)cell->value + kind_size(cell->kind) && next->row < UINT_MAX;
        cell->row = joined ? next->row + 1 : 1;
    }
}

static bool allocate(Instance *instance, const char *name)
{
    size_t total = 1; /* never nothing: calloc(0) may return NULL */
    for (size_t i = 0; i < model.variable_count; i++) {
        total += scalar_count(&model.variables[i]);
    }
    instance->image_size = image_size();
    instance->name = calloc(strlen(name) + 1, 1);
    instance->self = calloc(1, model.size + 1);
    instance->cells = calloc(total, sizeof *instance->cells);
    instance->numbers = calloc(total, sizeof *instance->numbers);
    instance->first = calloc(model.variable_count + 1, sizeof *instance->first);
    instance->inputs = calloc(total, sizeof *instance->inputs);
    instance->counts = calloc(total, sizeof *instance->counts);
    instance->initial = calloc(instance->image_size + 1, 1);
    instance->before = calloc(instance->image_size + 1, 1);
    return instance->name != NULL && instance->self != NULL && instance->cells != NULL &&
           instance->numbers != NULL && instance->first != NULL && instance->inputs != NULL &&
           instance->counts != NULL && instance->initial != NULL && instance->before != NULL;
}

static void release(Instance *instance)
{
    free(instance->name);
    free(instance->self);
    free(instance->cells);
    free(instance->numbers);
    free(instance->first);
    free((void *)instance->inputs);
    free((void *)instance->counts);
    free(instance->initial);
    free(instance->before);
}

static void begin_life(Instance *instance)
{
    instance->life.phase = INSTANTIATED;
    instance->life.stale = true;
    instance->life.ticking = false;
    instance->life.refused = false;
    instance->life.start = 0.0;
    instance->life.time = 0.0;
    instance->life.stop = INFINITY;
}

bool instance_open(Instance *instance, const char *name)
{
    if (!allocate(instance, name)) {
        release(instance);
        return false;
    }
    memcpy(instance->name, name, strlen(name));
    model.create(instance->self);
    for (size_t i = 0; i < model.variable_count; i++) {
        if (values_of(instance->self, &model.variables[i]) == NULL) { /* the model had no memory for an array */
            instance_close(instance);
            return false;
        }
        instance->first[i] = instance->cell_count;
        add_cells(instance, &model.variables[i]);
    }
    instance->first[model.variable_count] = instance->cell_count;
    count_rows(instance);
    image_save(instance, instance->initial);
    begin_life(instance);
    return true;
}

void instance_close(Instance *instance)
{
    model.destroy(instance->self);
    release(instance);
}

void instance_reset(Instance *instance)
{
    image_restore(instance, instance->initial);
    begin_life(instance);
}

/* Messages -------------------------------------------------------------------------------------------------------- */

static void say(const Instance *instance, Status status, const char *format, va_list arguments)
{
    Text text;
    if ((instance->categories & (1u << status)) != 0) {
        text_clear(&text);
        text_add_list(&text, format, arguments);
        instance->pass_on(instance, status, CATEGORIES[status], text.characters);
    }
}

void instance_say(const Instance *instance, Status status, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say(instance, status, format, arguments);
    va_end(arguments);
}

Status instance_fail(Instance *instance, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say(instance, STATUS_ERROR, format, arguments);
    va_end(arguments);
    instance->life.phase = FAILED;
    return STATUS_ERROR;
}

static unsigned category_bits(const char *name)
{
    if (name == NULL) {
        return 0;
    }
    for (int status = STATUS_WARNING; status <= STATUS_FATAL; status++) {
        if (strcmp(name, CATEGORIES[status]) == 0) {
            return 1u << status;
        }
    }
    return strcmp(name, "logAll") == 0 ? LOG_ALL : 0;
}

bool instance_categories(Instance *instance, size_t count, const char *const names[], unsigned *categories)
{
    *categories = count == 0 ? LOG_ALL : 0;
    for (size_t i = 0; i < count; i++) {
        unsigned bits = names == NULL ? 0 : category_bits(names[i]);
        if (bits == 0) {
            instance_fail(instance, "log category %s is not known; choose logStatusWarning, logStatusDiscard, "
                                    "logStatusError, logStatusFatal or logAll",
                          names == NULL || names[i] == NULL ? "NULL" : names[i]);
            return false;
        }
        *categories |= bits;
    }
    return true;
}

/* State machine --------------------------------------------------------------------------------------------------- */

static const char *phase_name(Phase phase)
{
    switch (phase) {
    case INSTANTIATED: return "the state instantiated";
    case INITIALIZING: return "initialization mode";
    case EVENT: return "event mode";
    case STEPPING: return "step mode";
    case INTERMEDIATE: return "an intermediate update";
    case TERMINATED: return "the state terminated";
    default: return "the state error";
    }
}

bool instance_allowed(Instance *instance, const char *function, unsigned phases)
{
    if ((instance->life.phase & phases) != 0) {
        return true;
    }
    const char *mend = "exit initialization mode first";
    Phase phase = instance->life.phase;
    if (phase == FAILED || phase == TERMINATED) {
        mend = "reset the FMU or free it";
    } else if ((phases & STEPPING) == 0 || (phase & (INSTANTIATED | INITIALIZING)) == 0) {
        mend = "keep to the order of calls of the FMI standard";
    }
    instance_fail(instance, "%s is not allowed: the FMU is in %s; %s", function, phase_name(phase), mend);
    return false;
}

bool instance_given(Instance *instance, const char *function, const void *place)
{
    if (instance == NULL) {
        return false;
    }
    if (place == NULL) {
        instance_fail(instance, "%s gets a NULL pointer; give the address of a variable", function);
        return false;
    }
    return true;
}

bool instance_values_given(Instance *instance, const char *function, size_t count, const void *references,
                           const void *values)
{
    return count == 0 || (instance_given(instance, function, references) && instance_given(instance, function, values));
}

/* Cells ----------------------------------------------------------------------------------------------------------- */

const char *kind_name(Kind kind)
{
    return kind == REAL ? "float" : kind == INTEGER ? "int" : "bool";
}

void cell_name(const Cell *cell, Text *text)
{
    text_add(text, cell->variable->size == 0 ? "%s" : "%s[%z]", cell->variable->name, cell->element + 1);
}

bool instance_settable(Instance *instance, const Cell *cell)
{
    Causality causality = cell->variable->causality;
    bool initialized = (instance->life.phase & (INSTANTIATED | INITIALIZING)) == 0;
    if (causality == INPUT || (causality == PARAMETER && !initialized)) {
        return true;
    }
    Text name;
    text_clear(&name);
    cell_name(cell, &name);
    if (causality == PARAMETER) {
        instance_fail(instance, "parameter %s is fixed in %s; set it before initialization ends, or reset the FMU",
                      name.characters, phase_name(instance->life.phase));
    } else {
        instance_fail(instance, "%s is calculated by the model and cannot be set; set parameters and inputs",
                      name.characters);
    }
    return false;
}

bool instance_integer(Instance *instance, const Cell *cell, int32_t *value)
{
    int64_t number = *(const int64_t *)cell->value;
    if (number < INT32_MIN || number > INT32_MAX) {
        Text name;
        text_clear(&name);
        cell_name(cell, &name);
        instance_fail(instance, "%s is %i, beyond the 32 bits of an FMI integer", name.characters, number);
        return false;
    }
    *value = (int32_t)number;
    return true;
}

double cell_derivative(const Instance *instance, const Cell *cell, int order)
{
    int variable = cell->variable->output_derivative;
    if (order > 1 || variable < 0 || model.variables[variable].size != cell->variable->size) {
        return 0.0;
    }
    return *(const double *)instance->cells[instance->first[variable] + cell->element].value;
}
