/* FMI 2.0 functions in any order with any arguments that C allows: nothing may crash or leak, a step that is discarded
 * changes nothing, and states restore every bit. */
#include <string.h>

#include "fmi2Functions.h"
#include "program.h"

enum { REFERENCES = 26, STATES = 3, LARGEST_STATE = 1024 };

static void silent(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    (void)environment;
    demand(name != NULL && status != fmi2OK && category != NULL && strlen(message) > 0, "messages are complete");
}

static fmi2Component instance;
static fmi2FMUstate states[STATES];
static double now;

static size_t serialized(char bytes[LARGEST_STATE])
{
    fmi2FMUstate state = NULL;
    size_t size = 0;
    demand(fmi2GetFMUstate(instance, &state) == fmi2OK, "a state can always be got");
    demand(fmi2SerializedFMUstateSize(instance, state, &size) == fmi2OK && size <= LARGEST_STATE, "it has a size");
    demand(fmi2SerializeFMUstate(instance, state, bytes, size) == fmi2OK, "it can be serialized");
    demand(fmi2FreeFMUstate(instance, &state) == fmi2OK && state == NULL, "it can be freed");
    return size;
}

static void step(void)
{
    const fmi2ValueReference force[] = {0};
    const fmi2Real pushed[] = {next_real()};
    if (next() % 2u == 0) {
        fmi2SetReal(instance, force, 1, pushed);
    }
    char before[LARGEST_STATE], after[LARGEST_STATE];
    size_t size = serialized(before);
    double size_of_step = next_real(), from = next() % 8u == 0 ? next_real() : now;
    fmi2Status status = fmi2DoStep(instance, from, size_of_step, (fmi2Boolean)(next() % 2u));
    if (status == fmi2OK) {
        now = from + size_of_step;
    } else if (status == fmi2Discard) {
        demand(serialized(after) == size && memcmp(before, after, size) == 0, "a discarded step changes nothing");
    } else {
        demand(status == fmi2Error, "a step is OK, Discard or Error");
    }
}

static void restore(fmi2FMUstate state)
{
    char bytes[LARGEST_STATE];
    if (state != NULL) {
        demand(fmi2SetFMUstate(instance, state) == fmi2OK, "a state can be set");
        fmi2FMUstate read = NULL;
        size_t size = serialized(bytes);
        demand(fmi2DeSerializeFMUstate(instance, bytes, size, &read) == fmi2OK, "bytes can be read");
        char again[LARGEST_STATE];
        demand(fmi2SerializeFMUstate(instance, read, again, size) == fmi2OK && memcmp(bytes, again, size) == 0,
               "bytes are exact");
        demand(fmi2FreeFMUstate(instance, &read) == fmi2OK, "a read state can be freed");
        if (fmi2GetRealStatus(instance, fmi2LastSuccessfulTime, &now) != fmi2OK) {
            now = 0.0;
        }
    } else {
        fmi2SetFMUstate(instance, NULL);
    }
}

static void bad_bytes(void)
{
    char bytes[LARGEST_STATE];
    fmi2FMUstate read = NULL;
    size_t size = serialized(bytes);
    size_t place = next() * 4u % size;
    unsigned change = next();
    bytes[place] = (char)(bytes[place] ^ (char)change);
    if (change % 256u != 0) {
        demand(fmi2DeSerializeFMUstate(instance, bytes, size, &read) == fmi2Error && read == NULL,
               "damaged bytes are refused");
    } else {
        demand(fmi2DeSerializeFMUstate(instance, bytes, next() % size, &read) == fmi2Error, "short bytes are refused");
    }
}

static void call(void)
{
    fmi2ValueReference reference[] = {next() % REFERENCES};
    fmi2Integer number[] = {(fmi2Integer)(next() % 12u) - 1};
    fmi2Real real[] = {0.0};
    fmi2Boolean truth[] = {(fmi2Boolean)(next() % 3u)};
    fmi2String text[] = {next() % 2u == 0 ? "logStatusError" : "logEverything"};
    size_t count = next() % 8u == 0 ? 0 : 1;
    fmi2Status status;
    switch (next() % 28u) {
    case 0: fmi2EnterInitializationMode(instance); break;
    case 1: fmi2ExitInitializationMode(instance); break;
    case 2: fmi2Terminate(instance); break;
    case 3: fmi2Reset(instance), now = 0.0; break;
    case 4: fmi2GetReal(instance, reference, count, real); break;
    case 5: fmi2GetInteger(instance, reference, count, number); break;
    case 6: fmi2GetBoolean(instance, reference, count, truth); break;
    case 7: fmi2GetString(instance, reference, count, text); break;
    case 8: real[0] = next_real(), fmi2SetReal(instance, reference, count, real); break;
    case 9: fmi2SetInteger(instance, reference, count, number); break;
    case 10: fmi2SetBoolean(instance, reference, count, truth); break;
    case 11: fmi2SetString(instance, reference, count, text); break;
    case 12: real[0] = next_real(), fmi2SetRealInputDerivatives(instance, reference, count, number, real); break;
    case 13: fmi2GetRealOutputDerivatives(instance, reference, count, number, real); break;
    case 14: fmi2GetFMUstate(instance, &states[next() % STATES]); break;
    case 15: restore(states[next() % STATES]); break;
    case 16: fmi2FreeFMUstate(instance, &states[next() % STATES]); break;
    case 17: bad_bytes(); break;
    case 18: fmi2SetDebugLogging(instance, truth[0], count, text); break;
    case 19: fmi2GetStatus(instance, fmi2DoStepStatus, &status); break;
    case 20: fmi2GetBooleanStatus(instance, fmi2Terminated, truth); break;
    case 21: fmi2SetupExperiment(instance, 0, 0.0, next_real(), truth[0], next_real()); break;
    case 22: fmi2GetReal(instance, NULL, count, NULL), fmi2SetReal(instance, NULL, count, NULL); break;
    default: step(); break;
    }
}

/* Back to where steps are possible: without it most programs would end in the state error. */
static void revive(void)
{
    fmi2Reset(instance);
    fmi2EnterInitializationMode(instance);
    fmi2ExitInitializationMode(instance);
    now = 0.0;
}

int main(void)
{
    const fmi2CallbackFunctions functions = {.logger = silent};
    read_program();
    instance = fmi2Instantiate("any order", fmi2CoSimulation, "{guid-2}", NULL, &functions, fmi2False, fmi2True);
    demand(instance != NULL, "the FMU can be instantiated");
    while (more()) {
        if (next() % 4u == 0) {
            revive();
        }
        call();
    }
    for (int i = 0; i < STATES; i++) {
        fmi2FreeFMUstate(instance, &states[i]);
    }
    fmi2FreeInstance(instance);
    fmi2FreeInstance(NULL);
    return 0;
}
