/* Position: proportional-integral with velocity feed-forward, an example of an own algorithm.
 *
 * Build, from the checkout's root:
 * gcc -std=c11 -O2 -Wall -Wextra -Werror -fPIC -shared -I controller/include controller/examples-c/position_pi.c -o position_pi.so
 *
 *     e = set_position - position
 *     v = gain e + I + feed_forward set_velocity
 *     dI/dt = gain / integral_time e + (v_applied - v) / tracking_time
 *
 * The last term is the anti-wind-up: while the post-controller limits the result, the valve does v_applied and not v, and the
 * integral is led back to what the valve does; otherwise both are the same and the term is 0.
 * Within dead_zone of the set-point the error does not enter the integral: the piston sticks there, and an integral
 * that goes on collects until it breaks away and overshoots.
 */
#include "airbench_algorithm.h"

#include <math.h>
#include <stdlib.h>

/* Several times what any valve of this rig gives. */
static const double LARGEST_M_PER_S = 5.0;

enum { GAIN, INTEGRAL_TIME, TRACKING_TIME, FEED_FORWARD, DEAD_ZONE, COUNT };

static const struct airbench_parameter PARAMETERS[COUNT] = {
    [GAIN] = {"gain_per_s", "1/s", 0.0, 100.0, 20.0, "velocity for each error"},
    [INTEGRAL_TIME] = {"integral_time_s", "s", 0.05, 1000.0, 2.0, "time in which the integral does what the gain does at once"},
    [TRACKING_TIME] = {"tracking_time_s", "s", 0.005, 10.0, 0.05, "time in which the integral follows a limited valve"},
    [FEED_FORWARD] = {"velocity_feed_forward", "", 0.0, 2.0, 1.0, "share of the set-point's rate that is fed forward"},
    [DEAD_ZONE] = {"dead_zone_m", "m", 0.0, 0.01, 0.001, "error that the integral leaves alone"},
};

struct position_pi {
    double integral_m_per_s;
    double last_result_m_per_s;
};

static void *create(const struct airbench_rig *rig)
{
    (void)rig; /* no model in it */
    return calloc(1, sizeof(struct position_pi));
}

static void destroy(void *self)
{
    free(self);
}

static void reset(void *self, const struct airbench_ready *ready, const double *parameters)
{
    struct position_pi *pi = self;
    (void)parameters;
    pi->integral_m_per_s = 0.0;
    pi->last_result_m_per_s = ready->applied_velocity_m_per_s;
}

static double within_largest(double velocity_m_per_s)
{
    if (velocity_m_per_s > LARGEST_M_PER_S)
        return LARGEST_M_PER_S;
    return velocity_m_per_s < -LARGEST_M_PER_S ? -LARGEST_M_PER_S : velocity_m_per_s;
}

static double step(void *self, const struct airbench_ready *ready, const double *parameters)
{
    struct position_pi *pi = self;
    const double error = ready->set_position_m - ready->position_m;
    const double entering = fabs(error) > parameters[DEAD_ZONE] ? error : 0.0;
    const double limited = ready->applied_velocity_m_per_s - pi->last_result_m_per_s;
    const double rate = parameters[GAIN] / parameters[INTEGRAL_TIME] * entering + limited / parameters[TRACKING_TIME];

    pi->integral_m_per_s = within_largest(pi->integral_m_per_s + ready->period_s * rate);
    pi->last_result_m_per_s = within_largest(parameters[GAIN] * error + pi->integral_m_per_s
                                             + parameters[FEED_FORWARD] * ready->set_velocity_m_per_s);
    return pi->last_result_m_per_s;
}

static const struct airbench_algorithm ALGORITHM = {
    .interface_version = AIRBENCH_INTERFACE_VERSION,
    .struct_size = sizeof(struct airbench_algorithm),
    .name = "position-pi",
    .about = "position: proportional-integral with velocity feed-forward and anti-wind-up",
    .controls = AIRBENCH_POSITION,
    .parameter_count = COUNT,
    .parameters = PARAMETERS,
    .create = create,
    .destroy = destroy,
    .reset = reset,
    .step = step,
};

const struct airbench_algorithm *airbench_algorithm_entry(uint32_t interface_version)
{
    return interface_version == AIRBENCH_INTERFACE_VERSION ? &ALGORITHM : NULL;
}
