/* Messages, built piece by piece in a buffer of fixed size. */
#ifndef THREADPITCH_TEXT_H
#define THREADPITCH_TEXT_H

#include <stdarg.h>
#include <stddef.h>

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility push(hidden)
#endif

enum { TEXT_SIZE = 1024 };

typedef struct {
    char characters[TEXT_SIZE]; /* UTF-8, with a final 0 */
    size_t length;
} Text;

void text_clear(Text *text);

/* Adds what the format says: %s a string, %i an int64_t, %z a size_t, %r a double in the shortest form that reads back
 * to the same bits, written as Python writes it, %% a percent sign. What does not fit is left out. */
void text_add(Text *text, const char *format, ...);
void text_add_list(Text *text, const char *format, va_list arguments);

#if defined(__GNUC__) && !defined(_WIN32)
#pragma GCC visibility pop
#endif

#endif
