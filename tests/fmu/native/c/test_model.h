/* Sizes of the test model's arrays. */
#ifndef TEST_MODEL_H
#define TEST_MODEL_H

enum { LOADS = 2, HISTORY = 4, COMPLETED = 2, SEEN = 2, WEIGHTS = 2 };

#ifndef CLOCK_COUNT
#define CLOCK_COUNT 1 /* 0 makes an FMU without event mode */
#endif

#endif
