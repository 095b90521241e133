/* FMI 2.0 for co-simulation: the functions of fmi2Functions.h over an Instance, but for those of values, which
 * stand in fmi2_values.c. Source: FMI 2.0.5, chapters 2 and 4; when which function may be called: section 4.2.4. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "life.h"
#include "state.h"

typedef struct {
    Instance instance; /* first: a fmi2Component points to both */
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
} Component;

/* Messages -------------------------------------------------------------------------------------------------------- */

/* The logger takes a printf format. Importers in Python see only the format, so the message is put into it, with the
 * percent signs in words; FMI reads a number sign as the beginning of a value reference, unless there are two. */
static void log_plainly(const Component *component, const char *name, Status status, const char *category,
                        const char *message)
{
    Text plain;
    text_clear(&plain);
    for (; *message != '\0'; message++) {
        const char character[2] = {*message, '\0'};
        text_add(&plain, "%s", *message == '%' ? "percent" : *message == '#' ? "##" : character);
    }
    if (component->logger != NULL) {
        component->logger(component->environment, name, (fmi2Status)status, category, plain.characters);
    }
}

static void pass_on(const Instance *instance, Status status, const char *category, const char *message)
{
    log_plainly((const Component *)instance, instance->name, status, category, message);
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    Instance *instance = c;
    unsigned bits;
    if (instance == NULL || !instance_categories(instance, nCategories, categories, &bits)) {
        return fmi2Error;
    }
    instance->categories = loggingOn ? bits : instance->categories & ~bits;
    return fmi2OK;
}

/* Creation and destruction ---------------------------------------------------------------------------------------- */

static fmi2Component refuse(const Component *component, const char *name, const Text *reason)
{
    log_plainly(component, name == NULL ? model.name : name, STATUS_ERROR, "logStatusError", reason->characters);
    return NULL;
}

static bool is_blank(const char *name)
{
    return name == NULL || name[strspn(name, " \t\r\n\f\v")] == '\0';
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    Component made = {.logger = functions == NULL ? NULL : functions->logger,
                      .environment = functions == NULL ? NULL : functions->componentEnvironment};
    Text reason;
    (void)fmuResourceLocation; /* the model has no resources */
    (void)visible;
    text_clear(&reason);
    if (is_blank(instanceName)) {
        text_add(&reason, "the instance has no name; give one that is not blank");
    } else if (fmuType != fmi2CoSimulation) {
        text_add(&reason, "this FMU is for co-simulation only; instantiate it with fmi2CoSimulation");
    } else if (fmuGUID == NULL || strcmp(fmuGUID, model.token2) != 0) {
        text_add(&reason, "the GUID is %s, this library's is %s; use the modelDescription.xml that came with it",
                 fmuGUID == NULL ? "NULL" : fmuGUID, model.token2);
    }
    if (reason.length > 0) {
        return refuse(&made, instanceName, &reason);
    }
    Component *component = calloc(1, sizeof *component);
    if (component == NULL || !instance_open(&made.instance, instanceName)) {
        free(component);
        text_add(&reason, "there is no memory for another instance; free others first");
        return refuse(&made, instanceName, &reason);
    }
    made.instance.pass_on = pass_on;
    /* without debug logging only what ends the simulation is said (FMI 2.0.5, section 2.1.3) */
    made.instance.categories = loggingOn ? LOG_ALL : LOG_ERROR | LOG_FATAL;
    *component = made;
    return component;
}

void fmi2FreeInstance(fmi2Component c)
{
    if (c != NULL) {
        instance_close(c);
        free(c);
    }
}

/* Initialization, termination, reset ------------------------------------------------------------------------------ */

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    (void)toleranceDefined; /* the integration steps are fixed */
    (void)tolerance;
    if (c == NULL || !instance_allowed(c, "fmi2SetupExperiment", INSTANTIATED)) {
        return fmi2Error;
    }
    return (fmi2Status)life_set_times(c, startTime, stopTimeDefined ? stopTime : INFINITY);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    Instance *instance = c;
    if (c == NULL || !instance_allowed(c, "fmi2EnterInitializationMode", INSTANTIATED)) {
        return fmi2Error;
    }
    instance->life.phase = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    if (c == NULL || !instance_allowed(c, "fmi2ExitInitializationMode", INITIALIZING)) {
        return fmi2Error;
    }
    return (fmi2Status)life_exit_initialization(c, STEPPING);
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    Instance *instance = c;
    if (c == NULL || !instance_allowed(c, "fmi2Terminate", STEPPING)) {
        return fmi2Error;
    }
    instance->life.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    if (c == NULL) {
        return fmi2Error;
    }
    instance_reset(c);
    return fmi2OK;
}

/* FMU state ------------------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    if (!instance_given(c, "fmi2GetFMUstate", FMUstate)) {
        return fmi2Error;
    }
    State *state = *FMUstate;
    Status status = state_get(c, &state);
    *FMUstate = state;
    return (fmi2Status)status;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    return c == NULL ? fmi2Error : (fmi2Status)state_set(c, FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    if (c == NULL) {
        return fmi2Error;
    }
    if (FMUstate == NULL) {
        return fmi2OK; /* FMI 2.0.5, section 2.1.8: the call is ignored */
    }
    State *state = *FMUstate;
    Status status = state_free(c, &state);
    *FMUstate = state;
    return (fmi2Status)status;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    (void)FMUstate; /* all have the same size */
    if (!instance_given(c, "fmi2SerializedFMUstateSize", size)) {
        return fmi2Error;
    }
    *size = state_size(c);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size)
{
    if (!instance_given(c, "fmi2SerializeFMUstate", serializedState)) {
        return fmi2Error;
    }
    return (fmi2Status)state_serialize(c, model.token2, FMUstate, (unsigned char *)serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    if (!instance_given(c, "fmi2DeSerializeFMUstate", FMUstate) ||
        !instance_given(c, "fmi2DeSerializeFMUstate", serializedState)) {
        return fmi2Error;
    }
    State *state = NULL;
    Status status = state_deserialize(c, model.token2, (const unsigned char *)serializedState, size, &state);
    if (status == STATUS_OK) {
        *FMUstate = state;
    }
    return (fmi2Status)status;
}

/* Steps ----------------------------------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    (void)noSetFMUStatePriorToCurrentPoint; /* there is no result buffer to flush */
    if (c == NULL || !instance_allowed(c, "fmi2DoStep", STEPPING) ||
        life_begin_step(c, currentCommunicationPoint, communicationStepSize) != STATUS_OK) {
        return fmi2Error;
    }
    return (fmi2Status)life_compute_step(c, currentCommunicationPoint, communicationStepSize);
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    if (c == NULL) {
        return fmi2Error;
    }
    return (fmi2Status)instance_fail(c, "there is no step to cancel: fmi2DoStep never returns fmi2Pending");
}

static bool begin_status(Instance *instance, const char *function, const void *value)
{
    return instance_given(instance, function, value) && instance_allowed(instance, function, STEPPING | TERMINATED);
}

static fmi2Status no_such_status(const Instance *instance, const char *function)
{
    instance_say(instance, STATUS_DISCARD, "%s cannot tell this status: steps are never pending; ask for "
                                           "fmi2LastSuccessfulTime or fmi2Terminated", function);
    return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    (void)s;
    return begin_status(c, "fmi2GetStatus", value) ? no_such_status(c, "fmi2GetStatus") : fmi2Error;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    const Instance *instance = c;
    if (!begin_status(c, "fmi2GetRealStatus", value)) {
        return fmi2Error;
    }
    if (s != fmi2LastSuccessfulTime) {
        return no_such_status(instance, "fmi2GetRealStatus");
    }
    *value = instance->life.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    (void)s;
    return begin_status(c, "fmi2GetIntegerStatus", value) ? no_such_status(c, "fmi2GetIntegerStatus") : fmi2Error;
}

/* After a discarded step an importer may mend the inputs and repeat it, or set a state and go another way. One that does
 * neither would be refused for ever: to it the FMU says that it wants to end (FMI 2.0.5, section 4.2.3). */
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    if (!begin_status(c, "fmi2GetBooleanStatus", value)) {
        return fmi2Error;
    }
    if (s != fmi2Terminated) {
        return no_such_status(c, "fmi2GetBooleanStatus");
    }
    *value = ((const Instance *)c)->life.refused;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    (void)s;
    return begin_status(c, "fmi2GetStringStatus", value) ? no_such_status(c, "fmi2GetStringStatus") : fmi2Error;
}
