/* Libraries that do one thing wrong each: -D picks it, and nothing picked is a good library.
 *
 * Plain C without the care of the example, because being wrong is their purpose.
 */
#define _DEFAULT_SOURCE
#include "airbench_algorithm.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#ifndef NAME
#define NAME "hostile"
#endif
#ifndef LEAST
#define LEAST 0.0
#endif
#ifndef DEFAULT
#define DEFAULT 1.0
#endif
#ifndef SECOND
#define SECOND "second"
#endif
#ifndef COUNT
#define COUNT 2
#endif
#ifndef VERSION
#define VERSION AIRBENCH_INTERFACE_VERSION
#endif
#ifndef SIZE
#define SIZE sizeof(struct airbench_algorithm)
#endif
#ifndef CONTROLS
#define CONTROLS AIRBENCH_FORCE
#endif
#ifndef STEP
#define STEP step
#endif
#ifndef AT_ENTRY
#define AT_ENTRY
#endif
#ifndef AT_CREATE
#define AT_CREATE
#endif
#ifndef AT_DESTROY
#define AT_DESTROY
#endif
#ifndef STEP_NUMBER
#define STEP_NUMBER 1
#endif
#ifndef AT_STEP
#define AT_STEP
#endif
#ifndef AT_END
#define AT_END
#endif

/* Ways to be wrong, for AT_… */
#define CRASH *(volatile int *)(volatile size_t)0 = 1;
#define SAY_AND_EXIT { puts("no licence"); exit(0); }
#define HANG for (;;) sleep(1);
#define FLOOD for (int i = 0; i < 100000; i++) puts("a line that nobody wants to read");

static void *create(const struct airbench_rig *rig)
{
    (void)rig;
    AT_CREATE
    return calloc(1, sizeof(long));
}

static void destroy(void *self)
{
    AT_DESTROY
    free(self);
}

static void reset(void *self, const struct airbench_ready *ready, const double *parameters)
{
    (void)ready, (void)parameters;
    *(long *)self = 0;
}

static double step(void *self, const struct airbench_ready *ready, const double *parameters)
{
    long *count = self;
    (void)ready, (void)parameters;
    if (++*count == STEP_NUMBER) {
        AT_STEP
    }
    return 0.1;
}

static __attribute__((destructor)) void end(void)
{
    AT_END
}

#ifdef ENTRY_NAME
#define airbench_algorithm_entry ENTRY_NAME
#endif

const struct airbench_algorithm *airbench_algorithm_entry(uint32_t interface_version)
{
    static const struct airbench_parameter parameters[] = {
        {"first", "", LEAST, 2.0, DEFAULT, "the first"},
        {SECOND, "", 0.0, 2.0, 1.0, "the second"},
    };
    static const struct airbench_algorithm algorithm = {
        VERSION, SIZE, NAME, "one thing wrong", CONTROLS, COUNT, parameters, create, destroy, reset, STEP,
    };
    (void)interface_version, (void)step;
    AT_ENTRY
    return &algorithm;
}
