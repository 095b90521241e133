/* What the FMI wrapper must know of a model. The wrapper (fmi2.c, fmi3.c, instance.c) is written by hand and the same
 * for all models; each model's own file defines the one constant `model`, made from the model's declaration. */
#ifndef THREADPITCH_MODEL_H
#define THREADPITCH_MODEL_H

#include <stddef.h>
#include <stdint.h>

/* A library shows nothing but the functions of FMI, whatever flags it is compiled with: two FMUs of one process have
 * many names in common. (Windows shows only what asks for it.) */
#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility push(hidden)
#endif

typedef enum { REAL = 0, INTEGER = 1, BOOLEAN = 2 } Kind; /* members: double, int64_t, bool */
typedef enum { PARAMETER = 0, INPUT = 1, OUTPUT = 2, LOCAL = 3 } Causality;

/* One declared variable: a scalar, or an array. */
typedef struct {
    const char *name; /* without index */
    Kind kind;
    Causality causality;
    size_t offset;  /* of the member in the model's struct */
    size_t size;    /* 0: the member is the value itself; n: it is a span whose first member points to n values */
    double minimum; /* -INFINITY where there is none */
    double maximum;
    const int64_t *choices; /* allowed values of an INTEGER, or NULL */
    size_t choice_count;
    const char *const *choice_names; /* of the choices, in the same order; NULL where there are none */
    const char *unit;      /* "1" where there is none */
    int derivatives;       /* of a scalar REAL input: how many of its time derivatives the model takes, 0 to 2 */
    size_t derivative[2];  /* offsets of the members (double) that take them; they are declared LOCAL variables too */
    int output_derivative; /* of an output: the index of the variable that is its time derivative, -1: none */
} Variable;

/* A triggered output clock of FMI 3: ticks at the end of a step in which the counted variable is not 0. */
typedef struct {
    const char *name;
    size_t variable; /* index of an INTEGER variable */
    size_t element;  /* of it, where it is an array */
} Clock;

typedef struct {
    const char *name;
    const char *token2; /* guid of FMI 2 */
    const char *token3; /* instantiationToken of FMI 3 */
    size_t size;        /* of the struct */
    const Variable *variables;
    size_t variable_count;
    const Clock *clocks;
    size_t clock_count;
    void (*create)(void *self);     /* start values; allocates the arrays */
    void (*destroy)(void *self);    /* frees the arrays */
    int64_t (*check)(void *self);   /* 0, or a declared error */
    int64_t (*initialize)(void *self); /* 0, or a declared error; may be called several times */
    int64_t (*step)(void *self, double time, double step_size); /* 0, or a declared error */
    const char *(*error)(int64_t number); /* its sentence */
} Model;

extern const Model model;

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility pop
#endif

/* Value references. FMI 2: scalars, in the order of the variables, arrays element by element, from 0.
 * FMI 3: the index of the variable; the independent variable time is variable_count, clock i variable_count + 1 + i. */

#endif
