/* The same steps three ways: through an FMU's fmi2DoStep, and FeedDrive's equations without an FMU around them.
 * All give the seconds that the steps took; between them one input moves, outside of what is timed by a hundredth. */
#include <string.h>
#include <time.h>

#include "equations.h"
#include "fmi2Functions.h"

static double clock_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* One input (value reference) of the FMU rises by `rise` before each step. -1: the FMU refused. */
double fmu_loop(fmi2SetRealTYPE *set_real, fmi2DoStepTYPE *do_step, fmi2Component component, unsigned reference,
                double rise, int first, int steps, double step_size) {
    double seconds = clock_seconds();
    for (int i = first; i < first + steps; i++) {
        double value = rise * (i + 1);
        if (set_real(component, &reference, 1, &value) != fmi2OK ||
            do_step(component, i * step_size, step_size, fmi2True) != fmi2OK) {
            return -1.0;
        }
    }
    return clock_seconds() - seconds;
}

static struct FeedDriveModel drive;

/* A new drive, its motion integrated in steps of at most `internal_step`. */
void bare_begin(double internal_step) {
    memset(&drive, 0, sizeof drive);
    FeedDriveModel__init__(&drive);
    drive.internal_step = internal_step;
    FeedDriveModel__initialize(&drive);
}

void bare_end(void) {
    FeedDriveModel__del__(&drive);
}

double bare_position(void) {
    return drive.position;
}

double bare_loop(double rise, int first, int steps, double step_size) {
    double seconds = clock_seconds();
    for (int i = first; i < first + steps; i++) {
        drive.position_command = rise * (i + 1);
        if (FeedDriveModel__step(&drive, i * step_size, step_size) != 0) {
            return -1.0;
        }
    }
    return clock_seconds() - seconds;
}
