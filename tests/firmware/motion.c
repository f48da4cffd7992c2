/* The set-point and the control law.
 *
 *     v = GAIN (w - x) + FEED_FORWARD w'  proportional, with velocity feed-forward
 *     K_V = v A_out 3600 / (12.95 p_N)    choked exhaust of the outgoing chamber, p_N in bar
 *     opening = K_V,exhaust^-1(K_V)
 *
 * Within the rest zone of a set-point that rests, the valve stays shut as soon as the rod stands: the air is trapped and friction
 * holds it. Numbers of the rig: plant/rig.toml. The law is the paper's (Neugebauer et al. 2011, section 4).
 *
 * Written for a core without floating point, where a quotient costs as much as four products (docs/elf.md).
 */
#include "motion.h"

#include <math.h>

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

/* The inverse of the exhaust's characteristic, from each of its points on: opening = from + slope (K_V - kv). */
#define POINTS 4
#define PIECE(opening, kv, next_opening, next_kv) {opening, kv, ((next_opening) - (opening)) / ((next_kv) - (kv)), next_kv}
static const struct {
    float opening, kv, slope, end_kv;
} PIECES[POINTS] = {
    PIECE(0.03F, 0.0F, 0.2F, 0.095F),
    PIECE(0.2F, 0.095F, 0.5F, 0.30F),
    PIECE(0.5F, 0.30F, 0.8F, 0.52F),
    PIECE(0.8F, 0.52F, 1.0F, 0.58F),
};

/* An angle in 2^20ths of a turn: its quadrant is found in whole numbers, without floating point. */
#define TURN_BITS 20U
#define QUADRANT_BITS (TURN_BITS - 2U)
#define TURN (1U << TURN_BITS)
#define TWO_PI 6.28318531F

/* Taylor's series up to x^7 and x^6, in an eighth of a turn to both sides: wrong by 4e-7 and 4e-6 at most. */
static void sine_and_cosine(uint32_t angle, float *sine, float *cosine)
{
    const uint32_t quadrant = (angle + (1U << (QUADRANT_BITS - 1U))) >> QUADRANT_BITS;
    const int32_t rest = (int32_t)(angle - (quadrant << QUADRANT_BITS));
    const float x = (float)rest * (TWO_PI / (float)TURN);
    const float x2 = x * x;
    const float s = x + x * x2 * (-1.0F / 6.0F + x2 * (1.0F / 120.0F + x2 * (-1.0F / 5040.0F)));
    const float c = 1.0F + x2 * (-0.5F + x2 * (1.0F / 24.0F + x2 * (-1.0F / 720.0F)));
    switch (quadrant & 3U) {
    case 0U:
        *sine = s;
        *cosine = c;
        break;
    case 1U:
        *sine = c;
        *cosine = -s;
        break;
    case 2U:
        *sine = -s;
        *cosine = -c;
        break;
    default:
        *sine = -c;
        *cosine = s;
        break;
    }
}

struct motion_point motion_bestehorn(float from_m, float to_m, uint32_t now_ms, uint32_t duration_ms)
{
    if (now_ms >= duration_ms) {
        return (struct motion_point){.position_m = to_m, .velocity_m_per_s = 0.0F, .moves = false};
    }
    const uint32_t angle = (now_ms << TURN_BITS) / duration_ms;
    const float z = (float)angle * (1.0F / (float)TURN);
    const float way_m = to_m - from_m;
    float sine, cosine;
    sine_and_cosine(angle, &sine, &cosine);
    return (struct motion_point){
        .position_m = from_m + way_m * (z - sine * (1.0F / TWO_PI)),
        .velocity_m_per_s = way_m * (1.0F - cosine) * 1000.0F / (float)duration_ms,
        .moves = true,
    };
}

/* The opening that passes so much at the exhaust; the dead band is jumped over. */
static float opening_for(float kv)
{
    for (int i = 0; i < POINTS; i++) {
        if (kv < PIECES[i].end_kv) {
            return PIECES[i].opening + PIECES[i].slope * (kv - PIECES[i].kv);
        }
    }
    return 1.0F;
}

static bool rests(struct motion_control *control, bool moves, float error_m, float position_m)
{
    if (fabsf(position_m - control->band_m) > STANDING_M) {
        control->band_m = position_m;
        control->stood_ms = 0U;
    }
    if (control->stood_ms < STANDING_MS) {
        control->stood_ms++;
    }
    if (moves) {
        control->resting = false;
    } else if (control->resting) {
        control->resting = fabsf(error_m) <= 2.0F * REST_ZONE_M;
    } else {
        control->resting = control->stood_ms >= STANDING_MS && fabsf(error_m) < REST_ZONE_M;
    }
    return control->resting;
}

float motion_step(struct motion_control *control, struct motion_point set_point, float position_m)
{
    const float error_m = set_point.position_m - position_m;
    if (rests(control, set_point.moves, error_m, position_m)) {
        return 0.0F;
    }
    const float velocity = GAIN_PER_S * error_m + FEED_FORWARD * set_point.velocity_m_per_s;
    if (velocity > 0.0F) {
        return opening_for(velocity * (ANNULUS_AREA_M2 * KV_PER_M2_M_PER_S));
    }
    return velocity < 0.0F ? -opening_for(-velocity * (PISTON_AREA_M2 * KV_PER_M2_M_PER_S)) : 0.0F;
}
