/* SPDX-License-Identifier: MIT
 *
 * Speed control with dead-band compensation: the controller of speed.py as firmware.
 *
 *     cc -shared -fPIC -o speed.so speed.c
 *     pr.simulate_controlled(motor, drive, "speed.so", duration=50e-3, sample_time=0.5e-3)
 *
 * in:  speed (rad/s), position (rad), current amplitude (A), current phase (deg), temperature (K)
 * out: amplitude of both groups (V), phase of group B ahead of group A (deg), frequency (Hz)
 */
#include <math.h>

static const double dead_band = 37.0, highest = 120.0; /* V */
static const double phase = 90.0;                      /* deg */
static const double speed = 10.0, reversal = 25e-3;    /* rad/s, s */
static const double proportional = 2.0;                /* V s/rad */
static const double integral = 0.4;                    /* V s/rad for each sample */

static double sum;

void step(double t, const double *in, double *out)
{
    double error = (t < reversal ? speed : -speed) - in[0];
    double span = highest - dead_band;
    double output;

    if (fabs(proportional * error + sum) < span) /* no windup */
        sum += integral * error;
    output = proportional * error + sum;
    out[0] = dead_band + fmin(fabs(output), span);
    out[1] = copysign(phase, output);
}
