/* The set-point and the control law.
 *
 *     v = GAIN (w - x) + FEED_FORWARD w'  proportional, with velocity feed-forward
 *     K_V = v A_out 3600 / (12.95 p_N)    choked exhaust of the outgoing chamber, p_N in bar
 *     opening = K_V,exhaust^-1(K_V)
 *
 * Within the rest zone of a set-point that rests, the valve stays shut as soon as the rod stands: the air is trapped and friction
 * holds it. Numbers of the rig: plant/rig.toml. The law is the paper's (Neugebauer et al. 2011, section 4).
 */
#include "motion.h"

#include <math.h>

#define TWO_PI 6.28318531F
#define GAIN_PER_S 24.0F /* gain and feed-forward of controller/programs/position-p.toml */
#define FEED_FORWARD 1.15F
#define REST_ZONE_M 5e-4F
#define STANDING_M 1e-4F /* a band that a standing rod does not leave */
#define STANDING_MS 50U
#define CHOKED_FLOW 12.95F /* m^3/h for each K_V and bar */
#define NORMAL_PRESSURE_BAR 1.01325F
#define PISTON_AREA_M2 1963.5e-6F
#define ANNULUS_AREA_M2 1649.3e-6F
#define KV_PER_M2_M_PER_S (3600.0F / (CHOKED_FLOW * NORMAL_PRESSURE_BAR))

#define POINTS 5
static const float OPENING[POINTS] = {0.03F, 0.2F, 0.5F, 0.8F, 1.0F};
static const float KV_EXHAUST[POINTS] = {0.0F, 0.095F, 0.30F, 0.52F, 0.58F};

struct motion_point motion_bestehorn(float from_m, float to_m, uint32_t now_ms, uint32_t duration_ms)
{
    if (now_ms >= duration_ms) {
        return (struct motion_point){.position_m = to_m, .velocity_m_per_s = 0.0F, .moves = false};
    }
    const float z = (float)now_ms / (float)duration_ms;
    const float way_m = to_m - from_m;
    return (struct motion_point){
        .position_m = from_m + way_m * (z - sinf(TWO_PI * z) / TWO_PI),
        .velocity_m_per_s = way_m * (1.0F - cosf(TWO_PI * z)) * 1000.0F / (float)duration_ms,
        .moves = true,
    };
}

/* The opening that passes so much at the exhaust; the dead band is jumped over. */
static float opening_for(float kv)
{
    for (int i = 1; i < POINTS; i++) {
        if (kv < KV_EXHAUST[i]) {
            const float share = (kv - KV_EXHAUST[i - 1]) / (KV_EXHAUST[i] - KV_EXHAUST[i - 1]);
            return OPENING[i - 1] + share * (OPENING[i] - OPENING[i - 1]);
        }
    }
    return 1.0F;
}

static bool rests(struct motion_control *control, struct motion_point set_point, float position_m)
{
    if (fabsf(position_m - control->band_m) > STANDING_M) {
        control->band_m = position_m;
        control->stood_ms = 0U;
    }
    if (control->stood_ms < STANDING_MS) {
        control->stood_ms++;
    }
    const float error_m = fabsf(set_point.position_m - position_m);
    const bool within = control->resting ? error_m <= 2.0F * REST_ZONE_M
                                         : error_m < REST_ZONE_M && control->stood_ms >= STANDING_MS;
    control->resting = !set_point.moves && within;
    return control->resting;
}

float motion_step(struct motion_control *control, struct motion_point set_point, float position_m)
{
    if (rests(control, set_point, position_m)) {
        return 0.0F;
    }
    const float velocity =
        GAIN_PER_S * (set_point.position_m - position_m) + FEED_FORWARD * set_point.velocity_m_per_s;
    if (velocity > 0.0F) {
        return opening_for(velocity * ANNULUS_AREA_M2 * KV_PER_M2_M_PER_S);
    }
    return velocity < 0.0F ? -opening_for(-velocity * PISTON_AREA_M2 * KV_PER_M2_M_PER_S) : 0.0F;
}
