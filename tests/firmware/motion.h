/* The set-point and the control law, in float32 and SI units. Knows no bus. */
#ifndef MOTION_H
#define MOTION_H

#include <stdbool.h>
#include <stdint.h>

/* A set-point. */
struct motion_point {
    float position_m;
    float velocity_m_per_s;
    bool moves;
};

/* The Bestehorn sinoid from one place to another, now_ms after its start; at its end place after duration_ms, 4095 at most. */
struct motion_point motion_bestehorn(float from_m, float to_m, uint32_t now_ms, uint32_t duration_ms);

/* Memory of the control law. */
struct motion_control {
    float band_m;
    uint32_t stood_ms;
    bool resting;
};

/* Valve opening, -1 to 1, for one millisecond. */
float motion_step(struct motion_control *control, struct motion_point set_point, float position_m);

#endif
