/* A mass under a force: a model with every kind of variable, written by hand as the translation would write it. */
#include "test_model.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "model.h"

typedef struct {
    double *data;
    int64_t size;
} Reals;
typedef struct {
    int64_t *data;
    int64_t size;
} Integers;
typedef struct {
    bool *data;
    int64_t size;
} Booleans;

typedef struct {
    double force;
    Reals loads;
    bool enabled;
    int64_t command;
    double position;
    Reals history;
    int64_t steps;
    Integers completed;
    Booleans seen;
    double velocity;
    double mass;
    int64_t kind;
    Reals weights;
    bool guided;
    int64_t limit;
    double force_rate;
    double force_curvature;
} Self;

static void create(void *memory)
{
    Self *self = memory;
    self->loads.data = calloc(LOADS, sizeof(double));
    self->history.data = calloc(HISTORY, sizeof(double));
    self->completed.data = calloc(COMPLETED, sizeof(int64_t));
    self->seen.data = calloc(SEEN, sizeof(bool));
    self->weights.data = calloc(WEIGHTS, sizeof(double));
    self->enabled = true;
    self->mass = 1.0;
    self->kind = 1;
    self->limit = 10;
    for (int i = 0; i < WEIGHTS && self->weights.data != NULL; i++) {
        self->weights.data[i] = 1.0;
    }
}

static void destroy(void *memory)
{
    Self *self = memory;
    free(self->loads.data);
    free(self->history.data);
    free(self->completed.data);
    free(self->seen.data);
    free(self->weights.data);
}

static int64_t check(void *memory)
{
    const Self *self = memory;
    return self->weights.data[0] + self->weights.data[1] == 0.0 ? 2 : 0;
}

static int64_t initialize(void *memory)
{
    Self *self = memory;
    self->position = 0.5 * self->force;
    self->velocity = 0.0;
    self->steps = self->command == 6 ? INT64_C(4294967296) : 0;
    for (int i = 0; i < HISTORY; i++) {
        self->history.data[i] = self->position;
    }
    return 0;
}

/* x'' m = u + u' t + u''/2 t^2 + w loads, exactly */
static int64_t step(void *memory, double time, double step_size)
{
    Self *self = memory;
    const double h = step_size;
    const double held = self->force + self->weights.data[0] * self->loads.data[0] +
                        self->weights.data[1] * self->loads.data[1];
    if (self->enabled) {
        self->position += self->velocity * h + (held * h * h / 2.0 + self->force_rate * h * h * h / 6.0 +
                                                self->force_curvature * h * h * h * h / 24.0) / self->mass;
        self->velocity += (held * h + self->force_rate * h * h / 2.0 + self->force_curvature * h * h * h / 6.0) /
                          self->mass;
    }
    for (int i = HISTORY - 1; i > 0; i--) {
        self->history.data[i] = self->history.data[i - 1];
    }
    self->history.data[0] = time + h;
    self->steps += self->command == 8 ? INT64_C(2147483648) : 1;
    self->completed.data[0] = self->steps;
    self->completed.data[1] = self->steps % 3 == 0 ? 1 : 0;
    self->seen.data[0] = true;
    self->seen.data[1] = self->steps > 1;
    return fabs(self->position) > 100.0 ? 1 : self->command == 7 ? 7 : 0;
}

static const char *error(int64_t number)
{
    return number == 1   ? "the mass left 100 % of its guide #1: choose a smaller force"
           : number == 2 ? "weights must not all be zero: set one of them"
                         : NULL;
}

static const int64_t CHOICES[] = {1, 2};
static const char *const CHOICE_NAMES[] = {"spring", "rubber"};

#define OF(member) .name = #member, .offset = offsetof(Self, member)
#define FREE .minimum = -INFINITY, .maximum = INFINITY
static const Variable VARIABLES[] = {
    {OF(force), .kind = REAL, .causality = INPUT, FREE, .unit = "N", .derivatives = 2,
     .derivative = {offsetof(Self, force_rate), offsetof(Self, force_curvature)}, .output_derivative = -1},
    {OF(loads), .kind = REAL, .causality = INPUT, .size = LOADS, FREE, .unit = "N", .output_derivative = -1},
    {OF(enabled), .kind = BOOLEAN, .causality = INPUT, FREE, .unit = "1", .output_derivative = -1},
    {OF(command), .kind = INTEGER, .causality = INPUT, .minimum = 0, .maximum = 10, .unit = "1",
     .output_derivative = -1},
    {OF(position), .kind = REAL, .causality = OUTPUT, FREE, .unit = "m", .output_derivative = 9},
    {OF(history), .kind = REAL, .causality = OUTPUT, .size = HISTORY, FREE, .unit = "s", .output_derivative = -1},
    {OF(steps), .kind = INTEGER, .causality = OUTPUT, .maximum = 1e6, .unit = "1", .output_derivative = -1},
    {OF(completed), .kind = INTEGER, .causality = OUTPUT, .size = COMPLETED, FREE, .unit = "1",
     .output_derivative = -1},
    {OF(seen), .kind = BOOLEAN, .causality = OUTPUT, .size = SEEN, FREE, .unit = "1", .output_derivative = -1},
    {OF(velocity), .kind = REAL, .causality = LOCAL, FREE, .unit = "m/s", .output_derivative = -1},
    {OF(mass), .kind = REAL, .causality = PARAMETER, .minimum = 0.1, .maximum = 2.0, .unit = "kg",
     .output_derivative = -1},
    {OF(kind), .kind = INTEGER, .causality = PARAMETER, .minimum = 1, .maximum = 2, .choices = CHOICES,
     .choice_count = 2, .choice_names = CHOICE_NAMES, .unit = "1", .output_derivative = -1},
    {OF(weights), .kind = REAL, .causality = PARAMETER, .size = WEIGHTS, .minimum = 0.0, .maximum = INFINITY,
     .unit = "1", .output_derivative = -1},
    {OF(guided), .kind = BOOLEAN, .causality = PARAMETER, FREE, .unit = "1", .output_derivative = -1},
    {OF(limit), .kind = INTEGER, .causality = PARAMETER, .minimum = 1, .maximum = 1000, .unit = "1",
     .output_derivative = -1},
    {OF(force_rate), .kind = REAL, .causality = LOCAL, FREE, .unit = "N/s", .output_derivative = -1},
    {OF(force_curvature), .kind = REAL, .causality = LOCAL, FREE, .unit = "N/s2", .output_derivative = -1},
};
static const Clock CLOCKS[] = {{.name = "third_step_clock", .variable = 7, .element = 1}};

const Model model = {
    .name = "test_model",
    .token2 = "{guid-2}",
    .token3 = "{token-3}",
    .size = sizeof(Self),
    .variables = VARIABLES,
    .variable_count = sizeof VARIABLES / sizeof VARIABLES[0],
    .clocks = CLOCKS,
    .clock_count = CLOCK_COUNT,
    .create = create,
    .destroy = destroy,
    .check = check,
    .initialize = initialize,
    .step = step,
    .error = error,
};
