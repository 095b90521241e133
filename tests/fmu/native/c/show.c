/* What text_add makes of a number, for the tests in Python. */
#include <string.h>

#include "text.h"

#if defined(_WIN32)
#define SHOWN __declspec(dllexport)
#else
#define SHOWN __attribute__((visibility("default")))
#endif

SHOWN void show_real(double value, char shown[TEXT_SIZE]);
SHOWN void show_twice(const char *string, char shown[TEXT_SIZE]);

void show_real(double value, char shown[TEXT_SIZE])
{
    Text text;
    text_clear(&text);
    text_add(&text, "%r", value);
    memcpy(shown, text.characters, text.length + 1);
}

void show_twice(const char *string, char shown[TEXT_SIZE])
{
    Text text;
    text_clear(&text);
    text_add(&text, "%s%s", string, string);
    memcpy(shown, text.characters, text.length + 1);
}
