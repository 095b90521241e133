/* Initialisation and steps: what is checked, what the model does, and what is said when it cannot. */
#ifndef THREADPITCH_LIFE_H
#define THREADPITCH_LIFE_H

#include "instance.h"

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility push(hidden)
#endif

/* Sets the times of a run; `stop` is INFINITY where it is not defined. */
Status life_set_times(Instance *instance, double start, double stop);

/* Before values are got: in initialization mode `initialize` is evaluated again when something was set since. What
 * prevents it is said when initialization mode is left. */
void life_settle(Instance *instance);

/* Before values are set: from then on `initialize` is out of date, as long as initialization lasts. */
void life_unsettle(Instance *instance);

/* Parameters within their range, `check` content, `initialize` evaluated; else the instance fails with the reason. */
Status life_exit_initialization(Instance *instance, Phase next);

/* The step's times are right (else the instance fails), and the values before it are kept. */
Status life_begin_step(Instance *instance, double time, double step_size);

/* The step that was begun. STATUS_DISCARD: it could not be computed, and all values are as before it. */
Status life_compute_step(Instance *instance, double time, double step_size);

/* Where the model takes derivative `order` (1 or 2) of an input; NULL where it does not. */
double *life_input_derivative(const Instance *instance, const Variable *input, int order);

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility pop
#endif

#endif
