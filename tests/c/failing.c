/* A position controller that works, until what -DWHEN names holds: from then on it returns -DRESULT, no number without it. */
#include "airbench_algorithm.h"
#include <math.h>
#include <stdlib.h>
#ifndef VERSION
#define VERSION AIRBENCH_INTERFACE_VERSION
#endif
#ifndef RESULT
#define RESULT NAN
#endif
static void *create(const struct airbench_rig *rig) { (void)rig; return calloc(1, sizeof(long)); }
static void destroy(void *self) { free(self); }
static void reset(void *self, const struct airbench_ready *ready, const double *parameters)
{
    (void)ready, (void)parameters;
    *(long *)self = 0;
}
static double step(void *self, const struct airbench_ready *ready, const double *parameters)
{
    const long count = ++*(long *)self;
    (void)count;
    if (WHEN) return RESULT;
    return parameters[0] * (ready->set_position_m - ready->position_m) + ready->set_velocity_m_per_s;
}
AIRBENCH_EXPORT const struct airbench_algorithm *airbench_algorithm_entry(uint32_t version)
{
    static const struct airbench_parameter parameters[] = {{"gain_per_s", "1/s", 0.0, 100.0, 20.0, "gain"}};
    static const struct airbench_algorithm algorithm = {
        VERSION, sizeof(struct airbench_algorithm), "fails", "works until it does not", AIRBENCH_POSITION, 1,
        parameters, create, destroy, reset, step,
    };
    (void)version;
    return &algorithm;
}
