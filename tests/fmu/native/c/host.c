/* An importer in C, for Linux and Windows: loads an FMI 2.0 library and does what the lines of standard input say.
 *   host LIBRARY GUID
 *   r|i|b REFERENCE BITS   set a Real (its 64 bits in hexadecimal), Integer or Boolean
 *   R|I|B REFERENCE        a value that is printed from now on
 *   x                      leave initialization mode and print
 *   s TIME STEP            (bits) do a step and print
 *   g                      save the state, serialise it, and restore it from those bytes */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

#include "fmi2FunctionTypes.h"

enum { MOST = 4096 };

static void *library;

static void *function(const char *name) {
#ifdef _WIN32
    void *found = (void *)GetProcAddress((HMODULE)library, name);
#else
    void *found = dlsym(library, name);
#endif
    if (found == NULL) {
        fprintf(stderr, "no %s\n", name);
        exit(3);
    }
    return found;
}

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment, (void)instance, (void)category;
    fprintf(stderr, "%d %s\n", (int)status, message);
}

static double number(uint64_t bits) {
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint64_t bits_of(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static char kinds[MOST];
static fmi2ValueReference references[MOST];
static size_t shown;

static void print_values(fmi2Component instance) {
    size_t i;
    for (i = 0; i < shown; ++i) {
        fmi2Real real = 0.0;
        fmi2Integer integer = 0;
        if (kinds[i] == 'R') {
            ((fmi2GetRealTYPE *)function("fmi2GetReal"))(instance, &references[i], 1, &real);
            printf("%" PRIx64 " ", bits_of(real));
        } else if (kinds[i] == 'I') {
            ((fmi2GetIntegerTYPE *)function("fmi2GetInteger"))(instance, &references[i], 1, &integer);
            printf("%d ", integer);
        } else {
            ((fmi2GetBooleanTYPE *)function("fmi2GetBoolean"))(instance, &references[i], 1, &integer);
            printf("%d ", integer);
        }
    }
    printf("\n");
}

static void set_value(fmi2Component instance, char kind, fmi2ValueReference reference, uint64_t bits) {
    fmi2Real real = number(bits);
    fmi2Integer integer = (fmi2Integer)(int64_t)bits;
    if (kind == 'r') {
        ((fmi2SetRealTYPE *)function("fmi2SetReal"))(instance, &reference, 1, &real);
    } else if (kind == 'i') {
        ((fmi2SetIntegerTYPE *)function("fmi2SetInteger"))(instance, &reference, 1, &integer);
    } else {
        ((fmi2SetBooleanTYPE *)function("fmi2SetBoolean"))(instance, &reference, 1, &integer);
    }
}

static fmi2Status save_and_restore(fmi2Component instance) {
    fmi2FMUstate state = NULL, copy = NULL;
    size_t size = 0;
    char *bytes;
    fmi2Status status = ((fmi2GetFMUstateTYPE *)function("fmi2GetFMUstate"))(instance, &state);
    if (status != fmi2OK) {
        return status;
    }
    ((fmi2SerializedFMUstateSizeTYPE *)function("fmi2SerializedFMUstateSize"))(instance, state, &size);
    bytes = malloc(size);
    ((fmi2SerializeFMUstateTYPE *)function("fmi2SerializeFMUstate"))(instance, state, bytes, size);
    ((fmi2FreeFMUstateTYPE *)function("fmi2FreeFMUstate"))(instance, &state);
    ((fmi2ResetTYPE *)function("fmi2Reset"))(instance);
    status = ((fmi2DeSerializeFMUstateTYPE *)function("fmi2DeSerializeFMUstate"))(instance, bytes, size, &copy);
    free(bytes);
    if (status == fmi2OK) {
        status = ((fmi2SetFMUstateTYPE *)function("fmi2SetFMUstate"))(instance, copy);
        ((fmi2FreeFMUstateTYPE *)function("fmi2FreeFMUstate"))(instance, &copy);
    }
    return status;
}

int main(int count, char **arguments) {
    fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    fmi2Component instance;
    char kind;
    uint64_t first, second;
    if (count != 3) {
        return 1;
    }
#ifdef _WIN32
    library = (void *)LoadLibraryA(arguments[1]);
#else
    library = dlopen(arguments[1], RTLD_NOW);
#endif
    if (library == NULL) {
        fprintf(stderr, "cannot load %s\n", arguments[1]);
        return 2;
    }
    instance = ((fmi2InstantiateTYPE *)function("fmi2Instantiate"))("host", fmi2CoSimulation, arguments[2], "",
                                                                      &callbacks, fmi2False, fmi2True);
    if (instance == NULL) {
        return 4;
    }
    ((fmi2SetupExperimentTYPE *)function("fmi2SetupExperiment"))(instance, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    ((fmi2EnterInitializationModeTYPE *)function("fmi2EnterInitializationMode"))(instance);
    while (scanf(" %c", &kind) == 1) {
        fmi2Status status = fmi2OK;
        if (kind == 'x') {
            status = ((fmi2ExitInitializationModeTYPE *)function("fmi2ExitInitializationMode"))(instance);
            print_values(instance);
        } else if (kind == 'g') {
            status = save_and_restore(instance);
        } else if (kind == 's' && scanf("%" SCNx64 " %" SCNx64, &first, &second) == 2) {
            status = ((fmi2DoStepTYPE *)function("fmi2DoStep"))(instance, number(first), number(second), fmi2True);
            print_values(instance);
        } else if ((kind == 'R' || kind == 'I' || kind == 'B') && shown < MOST && scanf("%" SCNu64, &first) == 1) {
            kinds[shown] = kind;
            references[shown++] = (fmi2ValueReference)first;
        } else if (scanf("%" SCNu64 " %" SCNx64, &first, &second) == 2) {
            set_value(instance, kind, (fmi2ValueReference)first, second);
        } else {
            return 5;
        }
        if (status > fmi2Discard) {
            return 6;
        }
    }
    ((fmi2FreeInstanceTYPE *)function("fmi2FreeInstance"))(instance);
    return 0;
}
