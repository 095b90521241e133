/* A program of calls, read from the standard input: what a byte means, the drivers say. When the bytes are at an end all
 * further ones are 0. */
#ifndef PROGRAM_H
#define PROGRAM_H

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

enum { PROGRAM_SIZE = 65536 };

static unsigned char program[PROGRAM_SIZE];
static size_t program_length, program_place;

static void read_program(void)
{
    program_length = fread(program, 1, PROGRAM_SIZE, stdin);
}

static bool more(void)
{
    return program_place < program_length;
}

static unsigned next(void)
{
    return more() ? program[program_place++] : 0u;
}

/* Harmless, huge, tiny, infinite or no number at all. */
static double next_real(void)
{
    static const double REALS[] = {0.0, 1.0, -1.0, 0.5, 1e-3, 0.01, 1e6, -1e300, 1e-300, 5e-324};
    unsigned choice = next() % 16u;
    return choice < 10 ? REALS[choice] : choice == 10 ? NAN : choice == 11 ? INFINITY : choice == 12 ? -INFINITY : 0.1;
}

static void demand(bool held, const char *what)
{
    if (!held) {
        fprintf(stderr, "not held: %s\n", what);
        exit(1);
    }
}

#endif
