/* The values of a model as an image, and the FMU state that importers keep, as an object and as bytes. */
#ifndef THREADPITCH_STATE_H
#define THREADPITCH_STATE_H

#include "instance.h"

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility push(hidden)
#endif

/* An image is the bytes of the model's struct, then the values of its arrays one after the other. */
size_t kind_size(Kind kind);
size_t image_size(void);
void image_save(const Instance *instance, unsigned char *image);
void image_restore(Instance *instance, const unsigned char *image);

typedef struct State State;

/* Copies the FMU state into *state; NULL there asks for a new one. The functions return STATUS_ERROR, say why and let
 * the instance fail where they cannot do it. */
Status state_get(Instance *instance, State **state);
Status state_set(Instance *instance, const State *state);
Status state_free(Instance *instance, State **state);

/* Bytes that do not depend on the machine. They hold a hash of the FMU's token and a checksum. */
size_t state_size(const Instance *instance);
Status state_serialize(Instance *instance, const char *token, const State *state, unsigned char *bytes, size_t size);
Status state_deserialize(Instance *instance, const char *token, const unsigned char *bytes, size_t size,
                         State **state);

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility pop
#endif

#endif
