/* FMI 3.0 functions in any order with any arguments that C allows, inside intermediate updates too. */
#include <string.h>

#include "fmi3Functions.h"
#include "program.h"

enum { REFERENCES = 21, ROOM = 8, STATES = 3, LARGEST_STATE = 1024 };

static void silent(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment;
    demand(status != fmi3OK && category != NULL && strlen(message) > 0, "messages are complete");
}

static fmi3Instance instance;
static fmi3FMUState states[STATES];
static double now;
static bool updating, event_mode;

static size_t serialized(fmi3Byte bytes[LARGEST_STATE])
{
    fmi3FMUState state = NULL;
    size_t size = 0;
    demand(fmi3GetFMUState(instance, &state) == fmi3OK, "a state can always be got");
    demand(fmi3SerializedFMUStateSize(instance, state, &size) == fmi3OK && size <= LARGEST_STATE, "it has a size");
    demand(fmi3SerializeFMUState(instance, state, bytes, size) == fmi3OK, "it can be serialized");
    demand(fmi3FreeFMUState(instance, &state) == fmi3OK && state == NULL, "it can be freed");
    return size;
}

static void step(void)
{
    fmi3Byte before[LARGEST_STATE], after[LARGEST_STATE];
    fmi3Boolean event, end, early;
    fmi3Float64 reached;
    if (updating) {
        demand(fmi3DoStep(instance, 0.0, 1.0, false, &event, &end, &early, &reached) == fmi3Error, "no step in a step");
        return;
    }
    const fmi3ValueReference force[] = {0};
    const fmi3Float64 pushed[] = {next_real()};
    if (next() % 2u == 0) {
        fmi3SetFloat64(instance, force, 1, pushed, 1);
    }
    size_t size = serialized(before);
    double size_of_step = next_real(), from = next() % 8u == 0 ? next_real() : now;
    fmi3Status status = fmi3DoStep(instance, from, size_of_step, true, &event, &end, &early, &reached);
    if (status == fmi3OK) {
        now = reached;
    } else if (status == fmi3Discard) {
        demand(serialized(after) == size && memcmp(before, after, size) == 0, "a discarded step changes nothing");
    } else {
        demand(status == fmi3Error, "a step is OK, Discard or Error");
    }
}

static void mode(void)
{
    fmi3Boolean truth;
    double time;
    switch (next() % 7u) {
    case 0: fmi3EnterInitializationMode(instance, false, 0.0, next_real(), next() % 2u == 0, next_real()); break;
    case 1: fmi3ExitInitializationMode(instance); break;
    case 2: fmi3EnterEventMode(instance); break;
    case 3: fmi3UpdateDiscreteStates(instance, &truth, &truth, &truth, &truth, &truth, &time); break;
    case 4: fmi3EnterStepMode(instance); break;
    case 5: fmi3Terminate(instance); break;
    default:
        if (fmi3Reset(instance) == fmi3OK) {
            now = 0.0;
        }
    }
}

static void state(void)
{
    unsigned place = next() % STATES;
    switch (next() % 3u) {
    case 0: fmi3GetFMUState(instance, &states[place]); break;
    case 1: fmi3SetFMUState(instance, states[place]); break;
    default: fmi3FreeFMUState(instance, &states[place]); break;
    }
}

/* A block of exactly the size that the FMU is told, so that a byte beyond it is noticed. */
static void *block(size_t count, size_t size)
{
    void *made = calloc(count + 1, size); /* and not less than one value */
    demand(made != NULL, "there is memory");
    return made;
}

static void values(void)
{
    size_t count = next() % 4u, room = next() % ROOM;
    fmi3ValueReference *reference = block(count, sizeof *reference);
    fmi3Float64 *reals = block(room, sizeof *reals);
    fmi3Int32 *numbers = block(room, sizeof *numbers), *orders = block(count, sizeof *orders);
    fmi3Int64 *long_numbers = block(room, sizeof *long_numbers);
    fmi3Boolean *truths = block(room, sizeof *truths);
    fmi3Clock *ticks = block(count, sizeof *ticks);
    for (size_t i = 0; i < count; i++) {
        reference[i] = next() % REFERENCES;
        orders[i] = (fmi3Int32)(next() % 4u);
    }
    for (size_t i = 0; i <= room; i++) {
        reals[i] = next_real();
        numbers[i] = (fmi3Int32)(next() % 12u) - 1;
        truths[i] = next() % 2u == 0;
    }
    room++;
    switch (next() % 10u) {
    case 0: fmi3GetFloat64(instance, reference, count, reals, room); break;
    case 1: fmi3GetInt32(instance, reference, count, numbers, room); break;
    case 2: fmi3GetBoolean(instance, reference, count, truths, room); break;
    case 3: fmi3SetFloat64(instance, reference, count, reals, room); break;
    case 4: fmi3SetInt32(instance, reference, count, numbers, room); break;
    case 5: fmi3SetBoolean(instance, reference, count, truths, room); break;
    case 6: fmi3GetClock(instance, reference, count, ticks); break;
    case 7: fmi3GetOutputDerivatives(instance, reference, count, orders, reals, room); break;
    case 8: fmi3SetInt64(instance, reference, count, long_numbers, room); break;
    default: fmi3SetTime(instance, reals[0]); break;
    }
    free(reference);
    free(reals);
    free(numbers);
    free(long_numbers);
    free(truths);
    free(orders);
    free(ticks);
}

static void call(void)
{
    unsigned choice = next() % 16u;
    if (choice < 8) {
        values();
    } else if (choice < 10) {
        mode();
    } else if (choice < 11) {
        state();
    } else {
        step();
    }
}

/* Back to where steps are possible: without it most programs would end in the state error. */
static void revive(void)
{
    fmi3Reset(instance);
    fmi3EnterInitializationMode(instance, false, 0.0, 0.0, false, 0.0);
    fmi3ExitInitializationMode(instance);
    if (event_mode) {
        fmi3EnterStepMode(instance);
    }
    now = 0.0;
}

static void update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set_requested,
                   fmi3Boolean get_allowed, fmi3Boolean finished, fmi3Boolean can_return_early,
                   fmi3Boolean *early_return_requested, fmi3Float64 *early_return_time)
{
    (void)environment, (void)early_return_time;
    demand(isfinite(time) && set_requested != get_allowed && finished == get_allowed && !can_return_early &&
               !*early_return_requested, "updates are what the documentation says");
    updating = true;
    if (next() % 2u == 0) {
        const fmi3ValueReference force[] = {0};
        const fmi3Float64 value[] = {next_real()};
        demand(fmi3SetFloat64(instance, force, 1, value, 1) == (set_requested ? fmi3OK : fmi3Error),
               "inputs are set when they are asked for");
    } else if (next() % 4u == 0) {
        call();
    }
    updating = false;
}

int main(void)
{
    const fmi3ValueReference required[] = {0, 4, 8};
    read_program();
    unsigned choice = next();
    event_mode = choice % 2u == 0;
    instance = fmi3InstantiateCoSimulation("any order", "{token-3}", NULL, false, true, event_mode, false,
                                           required, choice / 2u % 4u, NULL, silent, choice / 8u % 2u ? update : NULL);
    demand(instance != NULL, "the FMU can be instantiated");
    while (more()) {
        if (next() % 4u == 0) {
            revive();
        }
        call();
    }
    for (int i = 0; i < STATES; i++) {
        fmi3FreeFMUState(instance, &states[i]);
    }
    fmi3FreeInstance(instance);
    fmi3FreeInstance(NULL);
    return 0;
}
