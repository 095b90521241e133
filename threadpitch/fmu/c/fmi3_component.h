/* What the files of the FMI 3.0 functions share. */
#ifndef THREADPITCH_FMI3_COMPONENT_H
#define THREADPITCH_FMI3_COMPONENT_H

#include "fmi3Functions.h"
#include "life.h"

enum { SAMPLES = 3 }; /* of an input in a step: at its beginning, in the middle, at its end */

typedef struct {
    Instance instance; /* first: a fmi3Instance points to both */
    fmi3LogMessageCallback logger;
    fmi3IntermediateUpdateCallback update; /* NULL where the importer wants none */
    fmi3InstanceEnvironment environment;
    bool *intermediate; /* (variables) what the importer sets or gets in intermediate updates */
    double *samples;    /* (variables, SAMPLES) */
    bool set_requested; /* by the intermediate update that runs */
    bool get_allowed;
} Component;

#endif
