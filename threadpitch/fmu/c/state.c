#include "state.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct State {
    const Model *owner; /* of this library: a state of another FMU is refused */
    Life life;
    unsigned char image[]; /* (image_size) */
};

/* Images ---------------------------------------------------------------------------------------------------------- */

size_t kind_size(Kind kind)
{
    return kind == REAL ? sizeof(double) : kind == INTEGER ? sizeof(int64_t) : sizeof(bool);
}

size_t image_size(void)
{
    size_t size = model.size;
    for (size_t i = 0; i < model.variable_count; i++) {
        size += model.variables[i].size * kind_size(model.variables[i].kind);
    }
    return size;
}

void image_save(const Instance *instance, unsigned char *image)
{
    unsigned char *values = image + model.size;
    memcpy(image, instance->self, model.size);
    for (size_t i = 0; i < model.variable_count; i++) {
        size_t size = model.variables[i].size * kind_size(model.variables[i].kind);
        if (size != 0) {
            memcpy(values, instance->cells[instance->first[i]].value, size);
            values += size;
        }
    }
}

/* Variable by variable: the struct holds pointers too, and those of another instance must not come in. */
void image_restore(Instance *instance, const unsigned char *image)
{
    const unsigned char *values = image + model.size;
    for (size_t i = 0; i < model.variable_count; i++) {
        const Variable *variable = &model.variables[i];
        void *to = instance->cells[instance->first[i]].value;
        if (variable->size == 0) {
            memcpy(to, image + variable->offset, kind_size(variable->kind));
        } else {
            memcpy(to, values, variable->size * kind_size(variable->kind));
            values += variable->size * kind_size(variable->kind);
        }
    }
}

/* States ---------------------------------------------------------------------------------------------------------- */

static bool owned(Instance *instance, const State *state)
{
    if (state == NULL) {
        instance_fail(instance, "the FMU state is NULL; get it from this FMU first");
        return false;
    }
    if (state->owner != &model) {
        instance_fail(instance, "this FMU state belongs to another model, or to another build of this one");
        return false;
    }
    return true;
}

static State *new_state(Instance *instance)
{
    State *state = calloc(1, sizeof *state + instance->image_size);
    if (state == NULL) {
        instance_fail(instance, "there is no memory for an FMU state; free others first");
        return NULL;
    }
    state->owner = &model;
    return state;
}

Status state_get(Instance *instance, State **state)
{
    if (*state == NULL) {
        *state = new_state(instance);
        if (*state == NULL) {
            return STATUS_ERROR;
        }
    } else if (!owned(instance, *state)) {
        return STATUS_ERROR;
    }
    (*state)->life = instance->life;
    image_save(instance, (*state)->image);
    return STATUS_OK;
}

Status state_set(Instance *instance, const State *state)
{
    if (!owned(instance, state)) {
        return STATUS_ERROR;
    }
    image_restore(instance, state->image);
    instance->life = state->life;
    instance->life.refused = false; /* the importer goes another way */
    return STATUS_OK;
}

Status state_free(Instance *instance, State **state)
{
    if (*state == NULL) {
        return STATUS_OK;
    }
    if (!owned(instance, *state)) {
        return STATUS_ERROR;
    }
    free(*state);
    *state = NULL;
    return STATUS_OK;
}

/* Bytes: magic, hash of the token, checksum of all that follows, life, values. Numbers stand in 8 bytes, the least
 * significant first, doubles as their IEEE bits; booleans stand in one byte. --------------------------------------- */

static const char MAGIC[8] = {'t', 'p', 's', 't', 'a', 't', 'e', '1'}; /* the last one is the version of the layout */
enum { WORD = 8, HEADER = 3 * WORD, FLAGS = 3, LIFE = FLAGS + 3 * WORD };

/* FNV-1a, 64 bits (Fowler, Noll, Vo; RFC 9923). */
static uint64_t hash(const unsigned char *bytes, size_t size)
{
    uint64_t value = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++) {
        value = (value ^ bytes[i]) * 0x100000001b3u;
    }
    return value;
}

static unsigned char *put_word(unsigned char *to, uint64_t word)
{
    for (int i = 0; i < WORD; i++) {
        *to++ = (unsigned char)(word >> (8 * i));
    }
    return to;
}

static uint64_t take_word(const unsigned char *from)
{
    uint64_t word = 0;
    for (int i = 0; i < WORD; i++) {
        word |= (uint64_t)from[i] << (8 * i);
    }
    return word;
}

static unsigned char *put_double(unsigned char *to, double value)
{
    uint64_t word;
    memcpy(&word, &value, sizeof word);
    return put_word(to, word);
}

static double take_double(const unsigned char *from)
{
    uint64_t word = take_word(from);
    double value;
    memcpy(&value, &word, sizeof value);
    return value;
}

static size_t byte_count(Kind kind)
{
    return kind == BOOLEAN ? 1 : WORD;
}

size_t state_size(const Instance *instance)
{
    size_t size = HEADER + LIFE;
    for (size_t i = 0; i < instance->cell_count; i++) {
        size += byte_count(instance->cells[i].variable->kind);
    }
    return size;
}

/* Calls `each` for every cell, with the place of its value in the image and in the bytes. */
typedef void (*Copier)(Kind kind, unsigned char *in_image, unsigned char *in_bytes);

static void for_each_cell(const Instance *instance, unsigned char *image, unsigned char *bytes, Copier each)
{
    unsigned char *values = image + model.size;
    for (size_t i = 0; i < instance->cell_count; i++) {
        const Variable *variable = instance->cells[i].variable;
        if (variable->size == 0) {
            each(variable->kind, image + variable->offset, bytes);
        } else {
            each(variable->kind, values, bytes);
            values += kind_size(variable->kind);
        }
        bytes += byte_count(variable->kind);
    }
}

static void to_bytes(Kind kind, unsigned char *in_image, unsigned char *in_bytes)
{
    if (kind == BOOLEAN) {
        bool value;
        memcpy(&value, in_image, sizeof value);
        *in_bytes = value ? 1 : 0;
    } else { /* double and int64_t have their 64 bits in the same order as uint64_t on all platforms */
        uint64_t word;
        memcpy(&word, in_image, sizeof word);
        put_word(in_bytes, word);
    }
}

static void to_image(Kind kind, unsigned char *in_image, unsigned char *in_bytes)
{
    if (kind == BOOLEAN) {
        bool value = *in_bytes != 0;
        memcpy(in_image, &value, sizeof value);
    } else {
        uint64_t word = take_word(in_bytes);
        memcpy(in_image, &word, sizeof word);
    }
}

Status state_serialize(Instance *instance, const char *token, const State *state, unsigned char *bytes, size_t size)
{
    if (!owned(instance, state)) {
        return STATUS_ERROR;
    }
    if (size < state_size(instance)) {
        return instance_fail(instance, "the FMU state needs %z bytes and gets %z; ask for its size first",
                             state_size(instance), size);
    }
    size = state_size(instance);
    unsigned char *life = bytes + HEADER;
    *life++ = (unsigned char)state->life.phase;
    *life++ = state->life.stale;
    *life++ = state->life.ticking;
    life = put_double(life, state->life.start);
    life = put_double(life, state->life.time);
    life = put_double(life, state->life.stop);
    /* `to_bytes` does not write into the image */
    for_each_cell(instance, (unsigned char *)state->image, life, to_bytes);
    memcpy(bytes, MAGIC, sizeof MAGIC);
    put_word(bytes + WORD, hash((const unsigned char *)token, strlen(token)));
    put_word(bytes + 2 * WORD, hash(bytes + HEADER, size - HEADER));
    return STATUS_OK;
}

static bool readable(Instance *instance, const char *token, const unsigned char *bytes, size_t size)
{
    if (size < sizeof MAGIC || memcmp(bytes, MAGIC, sizeof MAGIC) != 0) {
        instance_fail(instance, "these bytes are not an FMU state of this kind of FMU; give what it serialized");
        return false;
    }
    if (size < state_size(instance) || take_word(bytes + WORD) != hash((const unsigned char *)token, strlen(token))) {
        instance_fail(instance, "this FMU state belongs to another model, or to another build of this one");
        return false;
    }
    if (take_word(bytes + 2 * WORD) != hash(bytes + HEADER, state_size(instance) - HEADER)) {
        instance_fail(instance, "the serialized FMU state is damaged; serialize it again");
        return false;
    }
    return true;
}

Status state_deserialize(Instance *instance, const char *token, const unsigned char *bytes, size_t size, State **state)
{
    if (!readable(instance, token, bytes, size)) {
        return STATUS_ERROR;
    }
    State *read = new_state(instance);
    if (read == NULL) {
        return STATUS_ERROR;
    }
    const unsigned char *life = bytes + HEADER;
    read->life.phase = (Phase)life[0];
    read->life.stale = life[1] != 0;
    read->life.ticking = life[2] != 0;
    read->life.start = take_double(life + FLAGS);
    read->life.time = take_double(life + FLAGS + WORD);
    read->life.stop = take_double(life + FLAGS + 2 * WORD);
    /* `to_image` does not write into the bytes */
    for_each_cell(instance, read->image, (unsigned char *)bytes + HEADER + LIFE, to_image);
    *state = read;
    return STATUS_OK;
}
