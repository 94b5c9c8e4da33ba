/* SPDX-License-Identifier: MIT
 *
 * The averaged motor of piezomotor_averaged.c for a program in the same process: runs, and rows of what it records.
 *
 * The memory of a motor is the caller's: session_bytes() of it, its values first.
 */
#include "piezomotor_averaged.h"

#include <math.h>
#include <string.h>

#ifdef __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

#define ONE(...) +1
enum { SHOWN = INPUT_COUNT OUTPUTS(ONE) LOOP_OUTPUTS(ONE) NETWORK_OUTPUTS(ONE) }; /* what may change and outputs are the first values */

EXPORT int session_bytes(void) { return (int)sizeof(struct motor); }
EXPORT int session_columns(void) { return 1 + SHOWN; } /* of a row: time in s, inputs, outputs */
EXPORT int session_slopes(void) { return (int)offsetof(struct motor, slope); }
EXPORT void session_default(struct motor *m) { motor_default(m); }

#if TRACKED
/* Set the parameters of the loop, which are the first fields of the tracker, and the mode that it follows, from 0. */
EXPORT void session_track(struct motor *m, const double *parameters, int count, int followed)
{
    memcpy(&m->tracker, parameters, (size_t)count * sizeof(double));
    m->followed = followed;
}
#endif

#if DRIVEN
/* Set the parameters of the networks of groups A and B, which are the first fields of a network; count of each. */
EXPORT void session_drive(struct motor *m, const double *parameters, int count)
{
    for (int g = 0; g < 2; g++)
        memcpy(&m->network[g], parameters + g * count, (size_t)count * sizeof(double));
}
#endif

/* Begin a run at rest; longest is the longest internal step in s, speed that of a shaft which no torque accelerates. */
EXPORT void session_begin(struct motor *m, double longest, double speed)
{
    m->longest = longest;
    motor_rest(m);
    m->state[SPEED] = m->state[LOAD_SPEED] = speed;
    motor_measure(m);
}

/* Set charge, energy and angle of the rotor to 0, unless the torque of the load depends on the angle. */
EXPORT void session_zero(struct motor *m)
{
    memset(m->state + CHARGE, 0, 4 * sizeof(double));
    memset(m->flux, 0, sizeof m->flux);
    m->energy = 0.0;
    if (m->value.load_spring == 0.0 && m->value.load_gravity == 0.0) {
        m->state[LOAD_POSITION] -= m->state[POSITION];
        m->state[POSITION] = 0.0;
    }
    motor_measure(m);
}

/* Advance; 0, or -1 if the equations have no solution. */
EXPORT int session_advance(struct motor *m, double duration) { return motor_advance(m, duration); }

/* Advance from *time to a later time, and write a row after each internal step; return the number of rows, which is at
   most the capacity, or -1 if the equations have no solution. */
EXPORT int session_record(struct motor *m, double *time, double until, double *rows, int capacity)
{
    int count = 0;

    motor_begin(m);
    while (*time < until && count < capacity) {
        double left = until - *time, step = motor_step(m, left);
        if (step < 0.0)
            return -1;
        *time = left - step > 1e-12 * until ? *time + step : until;
        motor_measure(m);
        rows[0] = *time;
        memcpy(rows + 1, &m->value, SHOWN * sizeof(double));
        rows += 1 + SHOWN;
        count++;
    }
    return count;
}

/* Integrals since the begin of the amplitudes of the currents into the groups, A.s, and of their voltages, V.s, and of the
   electrical power, J. */
EXPORT void session_sums(const struct motor *m, double sums[9])
{
    memcpy(sums, m->state + CHARGE, 4 * sizeof(double));
    memcpy(sums + 4, m->flux, sizeof m->flux);
    sums[8] = m->energy;
}

/* Greatest displacement of a mode's coordinate by its harmonics, all in phase, m. */
EXPORT double session_amplitude(const struct motor *m, int mode)
{
    double total = 0.0;

    for (int h = 0; h < HARMONICS; h++) {
        const double *part = m->state + AMPLITUDE + 2 * (HARMONICS * mode + h);
        total += hypot(part[0], part[1]);
    }
    return total;
}

/* Small signals about the present state: derivatives of the rates by the states and by the inputs. */
EXPORT int session_states(void) { return STATES; }
EXPORT void session_linearise(struct motor *m, double *by_state, double *by_input)
{
    double found[STATES][INPUT_COUNT];

    motor_linearise(m, found);
    memcpy(by_state, m->solver.jacobian, sizeof m->solver.jacobian);
    memcpy(by_input, found, sizeof found);
}
