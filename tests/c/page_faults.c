/* Position: proportional with feed-forward, by somebody who does not know real time. From its 2000th step on, for 1500 steps, it
 * maps fresh memory in each and touches every page of it: a storm of page faults in the thread that answers the rig. */
#define _GNU_SOURCE
#include "airbench_algorithm.h"

#include <stdlib.h>
#include <sys/mman.h>

enum { FROM = 2000, TO = 3500, PAGES = 300, PAGE = 4096 };

static void *create(const struct airbench_rig *rig)
{
    (void)rig;
    return calloc(1, sizeof(long));
}

static void destroy(void *self)
{
    free(self);
}

static void reset(void *self, const struct airbench_ready *ready, const double *parameters)
{
    (void)self, (void)ready, (void)parameters; /* the count goes on: a repetition is no new start */
}

static double step(void *self, const struct airbench_ready *ready, const double *parameters)
{
    const long count = ++*(long *)self;
    if (count >= FROM && count < TO) {
        volatile char *fresh = mmap(NULL, PAGES * PAGE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (fresh != MAP_FAILED) {
            for (long page = 0; page < PAGES; page++)
                fresh[page * PAGE] = 1;
            munmap((void *)fresh, PAGES * PAGE);
        }
    }
    return parameters[0] * (ready->set_position_m - ready->position_m) + ready->set_velocity_m_per_s;
}

AIRBENCH_EXPORT const struct airbench_algorithm *airbench_algorithm_entry(uint32_t version)
{
    static const struct airbench_parameter parameters[] = {{"gain_per_s", "1/s", 0.0, 100.0, 20.0, "gain"}};
    static const struct airbench_algorithm algorithm = {
        AIRBENCH_INTERFACE_VERSION, sizeof(struct airbench_algorithm), "faults", "faults pages", AIRBENCH_POSITION, 1,
        parameters, create, destroy, reset, step,
    };
    (void)version;
    return &algorithm;
}
