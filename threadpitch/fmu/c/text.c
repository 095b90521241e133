#include "text.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    NUMBER_SIZE = 64, /* of any number that is written here */
    MOST_DIGITS = 17, /* a double needs no more to read back to the same bits */
    FIRST_LARGE = 16  /* Python writes an exponent from 1e16 on, */
};
static const long LAST_SMALL = -5; /* and down from 9e-5 */

void text_clear(Text *text)
{
    text->characters[0] = '\0';
    text->length = 0;
}

static void add_string(Text *text, const char *string)
{
    size_t room = TEXT_SIZE - 1 - text->length;
    size_t length = strlen(string);
    if (length > room) {
        length = room;
        while (length > 0 && ((unsigned char)string[length] & 0xC0u) == 0x80u) { /* not within a character of UTF-8 */
            length--;
        }
    }
    memcpy(text->characters + text->length, string, length);
    text->length += length;
    text->characters[text->length] = '\0';
}

static void add_unsigned(Text *text, uint64_t value)
{
    char digits[NUMBER_SIZE]; /* by hand: printf has no portable length for size_t and int64_t on old Windows */
    char *first = digits + sizeof digits - 1;
    *first = '\0';
    do {
        *--first = (char)('0' + value % 10u);
        value /= 10u;
    } while (value > 0);
    add_string(text, first);
}

static void add_integer(Text *text, int64_t value)
{
    if (value < 0) {
        add_string(text, "-");
    }
    add_unsigned(text, value < 0 ? 0u - (uint64_t)value : (uint64_t)value);
}

/* The number that %e wrote, one more in its last digit; false where that would need another digit. */
static bool increment(char *number)
{
    for (char *digit = strchr(number, 'e') - 1; digit >= number; digit--) {
        if (*digit == '9') {
            *digit = '0';
        } else if (*digit >= '0' && *digit < '9') {
            (*digit)++;
            return true;
        }
    }
    return false;
}

/* The shortest number, as %e writes it, that reads back to the value. Of the two decimals beside a value the nearer one
 * reads back if any does, except at powers of two, where doubles lie denser below than above. */
static void shortest(double value, char number[NUMBER_SIZE])
{
    for (int digits = 1; digits <= MOST_DIGITS; digits++) {
        snprintf(number, NUMBER_SIZE, "%.*e", digits - 1, value);
        if (strtod(number, NULL) == value || (increment(number) && strtod(number, NULL) == value)) {
            return;
        }
    }
}

static void add_zeros(Text *text, long count)
{
    for (long i = 0; i < count; i++) {
        add_string(text, "0");
    }
}

/* Digits d.ddd times ten to the exponent, placed as Python places them. */
static void add_digits(Text *text, char *digits, long exponent)
{
    const long count = (long)strlen(digits);
    const bool scientific = exponent <= LAST_SMALL || exponent >= FIRST_LARGE;
    const long whole = scientific ? 1 : exponent + 1; /* digits before the point */
    if (whole <= 0) {
        add_string(text, "0.");
        add_zeros(text, -whole);
        add_string(text, digits);
        return;
    }
    if (count > whole) {
        const char rest = digits[whole];
        digits[whole] = '\0';
        add_string(text, digits);
        digits[whole] = rest;
        add_string(text, ".");
        add_string(text, digits + whole);
    } else {
        add_string(text, digits);
        add_zeros(text, whole - count);
        add_string(text, scientific ? "" : ".0");
    }
    if (scientific) {
        add_string(text, exponent < 0 ? "e-" : "e+");
        add_string(text, labs(exponent) < 10 ? "0" : "");
        add_unsigned(text, (uint64_t)labs(exponent));
    }
}

static void add_real(Text *text, double value)
{
    char number[NUMBER_SIZE], digits[NUMBER_SIZE];
    size_t count = 0;
    if (isnan(value)) {
        add_string(text, "nan");
        return;
    }
    add_string(text, signbit(value) ? "-" : "");
    if (isinf(value)) {
        add_string(text, "inf");
        return;
    }
    shortest(fabs(value), number);
    for (const char *from = number; *from != 'e'; from++) {
        if (*from >= '0' && *from <= '9') { /* not the decimal point, which the importer's locale chooses */
            digits[count++] = *from;
        }
    }
    digits[count] = '\0';
    add_digits(text, digits, strtol(strchr(number, 'e') + 1, NULL, 10));
}

void text_add_list(Text *text, const char *format, va_list arguments)
{
    char character[2] = {'\0', '\0'};
    for (; *format != '\0'; format++) {
        if (*format != '%') {
            character[0] = *format;
            add_string(text, character);
            continue;
        }
        format++;
        if (*format == 's') {
            add_string(text, va_arg(arguments, const char *));
        } else if (*format == 'i') {
            add_integer(text, va_arg(arguments, int64_t));
        } else if (*format == 'z') {
            add_unsigned(text, (uint64_t)va_arg(arguments, size_t));
        } else if (*format == 'r') {
            add_real(text, va_arg(arguments, double));
        } else {
            add_string(text, "%");
        }
    }
}

void text_add(Text *text, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    text_add_list(text, format, arguments);
    va_end(arguments);
}
