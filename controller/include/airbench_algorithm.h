/* An own control algorithm as a shared library: the whole interface between airbench's controller and a foreign algorithm.
 *
 *     sensors, set-points --> pre-controller --> airbench_ready --> step() --> wanted rod velocity --> post-controller --> valve
 *
 * A library exports one function, airbench_algorithm_entry, that returns a descriptor: name, parameters, four functions.
 * Build it with
 *
 *     gcc -std=c11 -O2 -Wall -Wextra -fPIC -shared -I controller/include my_algorithm.c -o my_algorithm.so
 *
 * try it with `controller check-library my_algorithm.so`, and name it in an axis's program file:
 *
 *     [algorithm]
 *     library = "my_algorithm.so"       # relative to the program file
 *     gain_per_s = 25.0                 # its parameters, by the names of its table
 *
 * Rules
 *  - Units are SI, angles do not occur, pressures are absolute. Everything is in the axis's own extension: positions grow as the
 *    rod comes out, a positive result extends it and raises the force reading when something is in the way.
 *  - reset and step run inside a cycle of 1 ms: they must not allocate, lock, wait, print or open files. A step that takes more
 *    than 20 ms once, or more than 1 ms ten times running, is a latched fault with the valve shut (in real time only).
 *  - The result must be a finite number; NaN or infinity is a latched fault with the valve shut. It need not be limited: the
 *    post-controller limits it and says in applied_velocity_m_per_s what became of it.
 *  - All state stands behind the pointer that create returns. No variables of the file that change: both axes may use the
 *    library in one process. One instance is never used by two threads at a time, but not always by the same one.
 *  - No exception, longjmp or exit may leave a function. Do not build with -ffast-math: it changes how the whole process
 *    rounds, and is refused.
 *  - Before a library is loaded, a child process tries it: entry, create, reset, 100 steps, destroy. What crashes, ends or
 *    hangs there is refused. This guards against mistakes; a library has all rights of the controller.
 */
#ifndef AIRBENCH_ALGORITHM_H
#define AIRBENCH_ALGORITHM_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Grows with every change of anything below; a library speaks exactly one version. */
#define AIRBENCH_INTERFACE_VERSION 1u

/* What an algorithm controls. */
#define AIRBENCH_POSITION 1u /* the extension */
#define AIRBENCH_FORCE 2u    /* the force between rod and carriage */

/* Put it before airbench_algorithm_entry, so that -fvisibility=hidden does not hide it. */
#define AIRBENCH_EXPORT __attribute__((visibility("default")))

/* What the pre-controller has made ready for a step. */
struct airbench_ready {
    double period_s;                 /* time between two steps of the algorithm */
    double position_m;               /* extension of the axis's rod */
    double velocity_m_per_s;         /* its rate, filtered */
    double acceleration_m_per_s2;    /* the rate of that, filtered */
    double force_n;                  /* force sensor of the axis, filtered, compression positive */
    double pressure_a_pa;            /* cap-side chamber, filtered */
    double pressure_b_pa;            /* rod-side chamber, filtered */
    double supply_pressure_pa;       /* supply, as the rig tells it */
    double set_position_m;           /* set-point of the extension */
    double set_velocity_m_per_s;     /* its rate */
    double set_acceleration_m_per_s2; /* the rate of that */
    double set_force_n;              /* set-point of the force */
    double set_force_rate_n_per_s;   /* its rate */
    double applied_velocity_m_per_s; /* what the valve could do of the last result; differs from it when it was limited */
};

/* Nominal numbers of the rig, from its rig file; the real rig differs from them. */
struct airbench_rig {
    double stroke_m;                /* the extension lies in 0 to stroke_m */
    double piston_area_m2;          /* cap side */
    double annulus_area_m2;         /* rod side */
    double dead_volume_m3;          /* of each chamber with its hose */
    double drive_mass_kg;           /* moving mass of the drive with the carriage, without weights */
    double carriage_mass_kg;        /* share of the carriage in it */
    double load_mass_kg;            /* moving mass of the load */
    double added_mass_limit_kg;     /* most weights on the carriage */
    double break_away_force_n;      /* friction at rest */
    double sliding_force_n;         /* friction when moving */
    double viscous_n_s_per_m;       /* and its part that grows with the speed */
    double supply_pressure_pa;      /* supply */
    double exhaust_pressure_pa;     /* behind the valve's exhaust edges */
    double atmospheric_pressure_pa; /* on the rod's cross-section */
    double normal_pressure_pa;      /* to which normal volume flows refer */
    double gas_temperature_k;       /* of the air */
};

/* A parameter. Its name is a key of program files: letters, digits, '_' and '-', ending in its unit as gain_per_s does;
 * "name", "library" and "every_cycles" are taken. Values that lie outside the range are refused before they get here. */
struct airbench_parameter {
    const char *name;
    const char *unit;     /* for people; "" when it has none */
    double least;         /* smallest allowed value, finite */
    double most;          /* largest allowed value, finite, above least */
    double default_value; /* within the range */
    const char *meaning;  /* one sentence */
};

#define AIRBENCH_MOST_PARAMETERS 64u
#define AIRBENCH_LONGEST_TEXT 255u /* bytes of each text, without its closing zero; texts are UTF-8 */

/* What a library offers. It stays where it is, unchanged, as long as the process lives. */
struct airbench_algorithm {
    uint32_t interface_version; /* AIRBENCH_INTERFACE_VERSION */
    uint32_t struct_size;       /* sizeof(struct airbench_algorithm) */
    const char *name;           /* for people and records */
    const char *about;          /* one sentence */
    uint32_t controls;          /* AIRBENCH_POSITION or AIRBENCH_FORCE */
    uint32_t parameter_count;   /* 0 to AIRBENCH_MOST_PARAMETERS */
    const struct airbench_parameter *parameters; /* may be NULL when there are none */

    /* Makes an instance for a rig; may allocate and take its time. NULL: refused. An algorithm without state returns any
     * pointer that is not NULL. The rig's numbers are gone when create returns. */
    void *(*create)(const struct airbench_rig *rig);
    /* Ends an instance. */
    void (*destroy)(void *self);
    /* Begins anew from what is: no integral, no memory. The axis has been without control before. */
    void (*reset)(void *self, const struct airbench_ready *ready, const double *parameters);
    /* The velocity that the rod shall have, m/s. parameters: values in the order of the table; they may change between two
     * steps. Neither pointer may be kept. */
    double (*step)(void *self, const struct airbench_ready *ready, const double *parameters);
};

/* The one symbol that a library exports. It gets the version that airbench speaks and returns the descriptor, or NULL if it
 * does not speak that version. */
AIRBENCH_EXPORT const struct airbench_algorithm *airbench_algorithm_entry(uint32_t interface_version);

#ifdef __cplusplus
}
#endif

#endif
