/* What FMI 2.0 and FMI 3.0 share of an instance: memory, variables, the state machine, messages. */
#ifndef THREADPITCH_INSTANCE_H
#define THREADPITCH_INSTANCE_H

#include <stdbool.h>

#include "model.h"
#include "text.h"

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility push(hidden)
#endif

/* The numbers of fmi2Status and fmi3Status. */
typedef enum { STATUS_OK = 0, STATUS_WARNING = 1, STATUS_DISCARD = 2, STATUS_ERROR = 3, STATUS_FATAL = 4 } Status;

/* The states of FMI 2.0.5, section 4.2.4, and FMI 3.0, sections 2.3 and 4.2, one bit each. A discarded step leaves the
 * FMU as it was, as FMI 3 demands, so it needs no state of its own: inputs can be mended and the step repeated. */
typedef enum {
    INSTANTIATED = 1,
    INITIALIZING = 2,
    EVENT = 4,         /* FMI 3 */
    STEPPING = 8,      /* FMI 2: stepComplete */
    INTERMEDIATE = 16, /* FMI 3: inside the importer's intermediate update */
    TERMINATED = 32,
    FAILED = 64 /* a function returned Error */
} Phase;
enum { ANY_PHASE = 127 };

/* The log categories, one bit each, at the place of their status. */
enum {
    LOG_WARNING = 1 << STATUS_WARNING,
    LOG_DISCARD = 1 << STATUS_DISCARD,
    LOG_ERROR = 1 << STATUS_ERROR,
    LOG_FATAL = 1 << STATUS_FATAL,
    LOG_ALL = LOG_WARNING | LOG_DISCARD | LOG_ERROR | LOG_FATAL
};

/* One scalar value of the model: a variable, or an element of an array. */
typedef struct {
    const Variable *variable;
    size_t element;
    void *value; /* double, int64_t or bool */
    Kind kind;   /* of the variable, here for the loops over many values */
    unsigned row; /* of how many cells it is the first that are of its kind and lie one after another in memory */
} Cell;

/* Where the instance is in its life; with the values of the model the whole FMU state. */
typedef struct {
    Phase phase;
    bool stale;    /* something was set since `initialize` was evaluated */
    bool ticking;  /* the clocks show what the last step counted */
    bool refused;  /* the last step was: the same one would be again */
    double start;  /* s */
    double time;   /* s, the last communication point */
    double stop;   /* s, INFINITY where it is not defined */
} Life;

typedef struct Instance {
    char *name;
    void (*pass_on)(const struct Instance *, Status, const char *category, const char *message); /* to the importer */
    unsigned categories; /* enabled ones */
    Life life;
    bool event_mode_used;
    void *self; /* the model's struct */
    size_t cell_count;
    Cell *cells;   /* (cell_count) */
    unsigned *numbers; /* (cell_count) 0, 1, 2, ... as value references of FMI 2 */
    size_t *first; /* (variables + 1) of each variable: its first cell */
    size_t input_count;
    const Cell **inputs; /* (input_count) the REAL ones */
    size_t count_count;
    const Cell **counts; /* (count_count) INTEGER outputs and locals */
    size_t image_size;
    unsigned char *initial; /* (image_size) the values at the start */
    unsigned char *before;  /* (image_size) the values before a step */
} Instance;

/* Makes the instance, with the model at its start values; false where there is no memory, and then nothing is held. */
bool instance_open(Instance *instance, const char *name);
void instance_close(Instance *instance);

/* As after instance_open. */
void instance_reset(Instance *instance);

/* Whether a function may be called now; if not, the reason is said and the instance fails. */
bool instance_allowed(Instance *instance, const char *function, unsigned phases);

/* Whether arguments that must not be NULL are not; if one is, the instance fails. `count` 0 needs no values. */
bool instance_given(Instance *instance, const char *function, const void *place);
bool instance_values_given(Instance *instance, const char *function, size_t count, const void *references,
                           const void *values);

/* Says a message, when its category is enabled; the format is that of text_add. */
void instance_say(const Instance *instance, Status status, const char *format, ...);

/* Says what is wrong and enters the state FAILED; returns STATUS_ERROR. */
Status instance_fail(Instance *instance, const char *format, ...);

/* The bits of some log categories; false where one is unknown, and then the instance fails. */
bool instance_categories(Instance *instance, size_t count, const char *const names[], unsigned *categories);

/* The name of a cell, with its index from 1 where it belongs to an array. */
void cell_name(const Cell *cell, Text *text);

/* Whether the cell may be set now; if not, the reason is said and the instance fails. */
bool instance_settable(Instance *instance, const Cell *cell);

/* The value of an INTEGER cell in the 32 bits of FMI; false where it does not fit, and then the instance fails. */
bool instance_integer(Instance *instance, const Cell *cell, int32_t *value);

const char *kind_name(Kind kind);

/* The derivative of an output (STATUS_OK), 0 where its order is higher than the model gives. */
double cell_derivative(const Instance *instance, const Cell *cell, int order);

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility pop
#endif

#endif
