/* FMI 3.0 for co-simulation: creation and modes of an Instance. Source: FMI 3.0.2, sections 2.3 and 4.2. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3_component.h"
#include "state.h"

/* Messages -------------------------------------------------------------------------------------------------------- */

/* FMI reads a number sign as the beginning of a value reference, unless there are two. */
static void log_plainly(const Component *component, Status status, const char *category, const char *message)
{
    Text plain;
    text_clear(&plain);
    for (; *message != '\0'; message++) {
        const char character[2] = {*message, '\0'};
        text_add(&plain, "%s", *message == '#' ? "##" : character);
    }
    if (component->logger != NULL) {
        component->logger(component->environment, (fmi3Status)status, category, plain.characters);
    }
}

static void pass_on(const Instance *instance, Status status, const char *category, const char *message)
{
    log_plainly((const Component *)instance, status, category, message);
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[])
{
    Instance *self = instance;
    unsigned bits;
    if (self == NULL || !instance_categories(self, nCategories, categories, &bits)) {
        return fmi3Error;
    }
    self->categories = loggingOn ? self->categories | bits : self->categories & ~bits;
    return fmi3OK;
}

/* Creation and destruction ---------------------------------------------------------------------------------------- */

static fmi3Instance refuse(const Component *component, const char *reason)
{
    log_plainly(component, STATUS_ERROR, "logStatusError", reason);
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage)
{
    const Component component = {.logger = logMessage, .environment = instanceEnvironment};
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    return refuse(&component, "this FMU is for co-simulation only; call fmi3InstantiateCoSimulation");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage,
                                               fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption)
{
    (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    return fmi3InstantiateModelExchange(instanceName, instantiationToken, resourcePath, visible, loggingOn,
                                        instanceEnvironment, logMessage);
}

static bool is_blank(const char *name)
{
    return name == NULL || name[strspn(name, " \t\r\n\f\v")] == '\0';
}

/* Which variables have intermediateUpdate="true" in the model description. */
static bool may_be_intermediate(fmi3ValueReference reference)
{
    if (reference >= model.variable_count) {
        return false;
    }
    const Variable *variable = &model.variables[reference];
    return variable->causality == OUTPUT || (variable->causality == INPUT && variable->derivatives > 0);
}

static bool open_component(Component *component, const char *name)
{
    component->intermediate = calloc(model.variable_count + 1, sizeof *component->intermediate);
    component->samples = calloc(model.variable_count + 1, SAMPLES * sizeof *component->samples);
    if (component->intermediate == NULL || component->samples == NULL || !instance_open(&component->instance, name)) {
        free(component->intermediate);
        free(component->samples);
        return false;
    }
    component->instance.pass_on = pass_on;
    return true;
}

/* Takes the variables of the intermediate updates, of which there are `count`. */
static void require(Component *component, const fmi3ValueReference references[], size_t count,
                    fmi3IntermediateUpdateCallback update)
{
    component->update = count > 0 ? update : NULL;
    for (size_t i = 0; i < count; i++) {
        component->intermediate[references[i]] = true;
    }
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
    fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
    const fmi3ValueReference requiredIntermediateVariables[], size_t nRequiredIntermediateVariables,
    fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3IntermediateUpdateCallback intermediateUpdate)
{
    Component made = {.logger = logMessage, .environment = instanceEnvironment};
    Text reason;
    (void)resourcePath; /* the model has no resources */
    (void)visible;
    (void)earlyReturnAllowed; /* a step is always computed to its end */
    text_clear(&reason);
    if (is_blank(instanceName)) {
        text_add(&reason, "the instance has no name; give one that is not blank");
    } else if (instantiationToken == NULL || strcmp(instantiationToken, model.token3) != 0) {
        text_add(&reason, "the instantiation token is %s, this library's is %s; use the modelDescription.xml that came "
                          "with it", instantiationToken == NULL ? "NULL" : instantiationToken, model.token3);
    } else if (eventModeUsed && model.clock_count == 0) {
        text_add(&reason, "this FMU has no event mode; instantiate it without, see hasEventMode");
    } else if (nRequiredIntermediateVariables > 0 && requiredIntermediateVariables == NULL) {
        text_add(&reason, "the required intermediate variables are NULL; give their value references");
    }
    for (size_t i = 0; i < nRequiredIntermediateVariables && reason.length == 0; i++) {
        if (!may_be_intermediate(requiredIntermediateVariables[i])) {
            text_add(&reason, "value reference %z has no intermediate updates; see intermediateUpdate in the model "
                              "description", (size_t)requiredIntermediateVariables[i]);
        }
    }
    if (reason.length > 0) {
        return refuse(&made, reason.characters);
    }
    Component *component = calloc(1, sizeof *component);
    if (component == NULL || !open_component(&made, instanceName)) {
        free(component);
        return refuse(&made, "there is no memory for another instance; free others first");
    }
    made.instance.categories = loggingOn ? LOG_ALL : 0;
    made.instance.event_mode_used = eventModeUsed;
    require(&made, requiredIntermediateVariables, nRequiredIntermediateVariables, intermediateUpdate);
    *component = made;
    return component;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    Component *component = instance;
    /* inside an intermediate update the step still needs the memory */
    if (component != NULL && instance_allowed(instance, "fmi3FreeInstance", ANY_PHASE & ~INTERMEDIATE)) {
        free(component->intermediate);
        free(component->samples);
        instance_close(instance);
        free(component);
    }
}

/* Modes ----------------------------------------------------------------------------------------------------------- */

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    Instance *self = instance;
    (void)toleranceDefined; /* the integration steps are fixed */
    (void)tolerance;
    if (self == NULL || !instance_allowed(self, "fmi3EnterInitializationMode", INSTANTIATED) ||
        life_set_times(self, startTime, stopTimeDefined ? stopTime : INFINITY) != STATUS_OK) {
        return fmi3Error;
    }
    self->life.phase = INITIALIZING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    Instance *self = instance;
    if (self == NULL || !instance_allowed(self, "fmi3ExitInitializationMode", INITIALIZING)) {
        return fmi3Error;
    }
    return (fmi3Status)life_exit_initialization(self, self->event_mode_used ? EVENT : STEPPING);
}

static fmi3Status change_mode(Instance *self, const char *function, unsigned from, Phase to)
{
    if (self == NULL || !instance_allowed(self, function, from)) {
        return fmi3Error;
    }
    self->life.phase = to;
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    const Instance *self = instance;
    if (self != NULL && !self->event_mode_used) {
        return (fmi3Status)instance_fail(instance, "fmi3EnterEventMode is not allowed: the FMU was instantiated "
                                                   "without event mode; set eventModeUsed");
    }
    return change_mode(instance, "fmi3EnterEventMode", STEPPING, EVENT);
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return change_mode(instance, "fmi3EnterStepMode", EVENT, STEPPING);
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    return change_mode(instance, "fmi3Terminate", EVENT | STEPPING, TERMINATED);
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    if (instance == NULL || !instance_allowed(instance, "fmi3Reset", ANY_PHASE & ~INTERMEDIATE)) {
        return fmi3Error;
    }
    instance_reset(instance);
    return fmi3OK;
}

/* All outputs were computed by the step: there is nothing to iterate. */
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return change_mode(instance, "fmi3EvaluateDiscreteStates", EVENT, EVENT);
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime)
{
    static const char NAME[] = "fmi3UpdateDiscreteStates";
    Instance *self = instance;
    if (self == NULL || !instance_allowed(self, NAME, EVENT) || !instance_given(self, NAME, discreteStatesNeedUpdate) ||
        !instance_given(self, NAME, terminateSimulation) ||
        !instance_given(self, NAME, nominalsOfContinuousStatesChanged) ||
        !instance_given(self, NAME, valuesOfContinuousStatesChanged) ||
        !instance_given(self, NAME, nextEventTimeDefined) || !instance_given(self, NAME, nextEventTime)) {
        return fmi3Error;
    }
    /* A clock is active until here, however often it is asked: FMI 3.0.2, section 2.3.5, "Any Clock active during
     * fmi3UpdateDiscreteStates must be deactivated by the FMU itself". That the first fmi3GetClock ends the activation
     * holds in Scheduled Execution only (section 5.2.2). */
    self->life.ticking = false;
    *discreteStatesNeedUpdate = false;
    *terminateSimulation = false;
    *nominalsOfContinuousStatesChanged = false;
    *valuesOfContinuousStatesChanged = false;
    *nextEventTimeDefined = false;
    *nextEventTime = 0.0;
    return fmi3OK;
}
