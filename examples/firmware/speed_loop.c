/* SPDX-License-Identifier: MIT
 *
 * Speed control with dead-band compensation, as firmware in single precision.
 *
 * The amplitude of both groups controls the speed; its sign is that of the phase. The greater of both currents is
 * limited; the apparent power of both groups is logged.
 */
#include "piezomotor_firmware.h"

static const float dead_band = 37.0f, highest = 90.0f;       /* V */
static const float phase = 90.0f;                            /* deg, of the recommended drive */
static const float proportional = 1.0f;                      /* V s/rad */
static const float integral_rate = 435.0f;                   /* V/rad */
static const float most_current = 80e-3f;                    /* A, amplitude of a group */

static float sample_time, integral, error, power;

const int firmware_logs = 3;
const char *const firmware_log_names[] = {"error", "integral", "power"};

static float limited(float value, float low, float high) { return value < low ? low : value > high ? high : value; }

void firmware_init(float time, struct firmware_out *out)
{
    sample_time = time;
    integral = error = power = 0.0f;
    out->voltage_a = out->voltage_b = 0.0f;
    out->phase = phase;
}

void firmware_step(const struct firmware_in *in, struct firmware_out *out)
{
    float span = highest - dead_band, output, size;
    float current = in->current_a > in->current_b ? in->current_a : in->current_b;

    error = in->reference - in->speed;
    output = proportional * error + integral;
    if (output < span && output > -span) { /* no windup */
        integral += integral_rate * sample_time * error;
        output = proportional * error + integral;
    }
    size = limited(output < 0.0f ? -output : output, 0.0f, span);
    size += dead_band;
    if (current > most_current)
        size *= most_current / current;
    out->voltage_a = out->voltage_b = size;
    out->phase = output < 0.0f ? -phase : phase;
    power = 0.5f * (in->voltage_a * in->current_a + in->voltage_b * in->current_b); /* VA */
}

void firmware_log(float *values)
{
    values[0] = error;
    values[1] = integral;
    values[2] = power;
}
