/* What the C code that Pyccel makes of a model calls: arrays, minima and maxima, division of integers.
 * Nothing here stops the host: an index outside its array is noted in *outside and reads or writes the first value. */
#ifndef THREADPITCH_TRANSLATED_H
#define THREADPITCH_TRANSLATED_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

/* a * b + c is rounded twice, as in Python */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#elif defined(__GNUC__) && defined(__FP_FAST_FMA)
#pragma GCC optimize("fp-contract=off")
#endif

/* Pyccel declares what it then does not use */
#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic ignored "-Wunused-variable"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

/* Arrays ------------------------------------------------------------------------------------------------------- */

#define DECLARE_ARRAY(array, type)                                                                                     \
    typedef struct {                                                                                                   \
        type *data;                                                                                                    \
        int64_t size;                                                                                                  \
        int64_t *outside;                                                                                              \
    } array;                                                                                                           \
    typedef struct {                                                                                                   \
        type *ref;                                                                                                     \
        type *end;                                                                                                     \
    } array##_iter;

DECLARE_ARRAY(array_double_1d, double)
DECLARE_ARRAY(array_int64_t_1d, int64_t)
DECLARE_ARRAY(array_bool_1d, bool)

/* array a = (array)cspan_md_layout(c_ROWMAJOR, values, count); */
#define cspan_md_layout(layout, values, count) {(values), (count), NULL}

/* for (c_each(i, array, a)) *(i.ref) = ...; */
#define c_each(iterator, array, a)                                                                                     \
    array##_iter iterator = {(a).data, (a).data == NULL ? NULL : (a).data + (a).size}; iterator.ref != iterator.end;   \
    ++iterator.ref

/* *cspan_at(&a, index) */
#define cspan_at(a, index) ((a)->data + array_place((index), (a)->size, (a)->outside))

static inline int64_t array_place(int64_t index, int64_t size, int64_t *outside) {
    if ((uint64_t)index < (uint64_t)size) {
        return index;
    }
    if (outside != NULL) {
        *outside = 1;
    }
    return 0;
}

/* Minimum and maximum: the first of equal values, as in Python. double_min(3, a, b, c) ------------------------------ */

#define DECLARE_EXTREMA(type)                                                                                          \
    static inline type type##_lower(type a, type b) { return b < a ? b : a; }                                          \
    static inline type type##_upper(type a, type b) { return b > a ? b : a; }
DECLARE_EXTREMA(double)
DECLARE_EXTREMA(int64_t)

#define FOLD_2(f, a, b) f(a, b)
#define FOLD_3(f, a, b, c) f(f(a, b), c)
#define FOLD_4(f, a, b, c, d) f(FOLD_3(f, a, b, c), d)
#define FOLD_5(f, a, b, c, d, e) f(FOLD_4(f, a, b, c, d), e)
#define FOLD_6(f, a, b, c, d, e, g) f(FOLD_5(f, a, b, c, d, e), g)
#define double_min(count, ...) FOLD_##count(double_lower, __VA_ARGS__)
#define double_max(count, ...) FOLD_##count(double_upper, __VA_ARGS__)
#define int64_t_min(count, ...) FOLD_##count(int64_t_lower, __VA_ARGS__)
#define int64_t_max(count, ...) FOLD_##count(int64_t_upper, __VA_ARGS__)

/* Division of integers, rounded down as in Python; by 0 it gives 0 --------------------------------------------------- */

static inline int64_t pyc_modulo(int64_t a, int64_t b) {
    int64_t rest = b == 0 || b == -1 ? 0 : a % b;
    return rest != 0 && (rest < 0) != (b < 0) ? rest + b : rest;
}

static inline int64_t py_floor_div_int64_t(int64_t a, int64_t b) {
    if (b == 0) {
        return 0;
    }
    if (b == -1) {
        return (int64_t)(0 - (uint64_t)a);
    }
    return a / b - (a % b != 0 && (a < 0) != (b < 0) ? 1 : 0);
}

#endif
