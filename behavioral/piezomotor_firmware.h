/* SPDX-License-Identifier: MIT
 *
 * What a controller in C has to define to run in simulate_controlled, and in the same file on a microcontroller.
 *
 *   cc -std=c11 -O2 -ffp-contract=off -shared -fPIC -I BEHAVIORAL -o speed_loop.so speed_loop.c
 *   pr.simulate_controlled(motor, drive, "speed_loop.so", duration=50e-3, sample_time=0.5e-3)
 *
 * All values are of single precision, for which microcontrollers have a unit. If it uses +, -, *, /, comparisons and
 * sqrtf only, and the compiler does not contract expressions, the results are the same bit by bit on every processor.
 */
#ifndef PIEZOMOTOR_FIRMWARE_H
#define PIEZOMOTOR_FIRMWARE_H

/* a sample, in the order of pyspice_runner.Sample */
struct firmware_in {
    float time;               /* s */
    float speed;              /* rad/s, mean since the last sample */
    float position;           /* rad */
    float current_a;          /* A, amplitude, mean since the last sample */
    float current_phase_a;    /* deg, ahead of the commanded voltage of group A */
    float temperature;        /* K, above that of the parameters */
    float reference;          /* in the controller's own unit */
    float current_b;          /* A */
    float current_phase_b;    /* deg, ahead of the commanded voltage of group A */
    float voltage_a;          /* V, amplitude, mean since the last sample */
    float voltage_b;          /* V */
};

/* the commands; on entry they have their present values */
struct firmware_out {
    float voltage_a;          /* V, amplitude */
    float voltage_b;          /* V */
    float phase;              /* deg, of group B ahead of group A */
    float frequency;          /* Hz */
};

/* Begin; sample_time is in s. */
void firmware_init(float sample_time, struct firmware_out *out);

/* One sample. */
void firmware_step(const struct firmware_in *in, struct firmware_out *out);

/* What the last step logs: firmware_logs values, and their names. */
extern const int firmware_logs;
extern const char *const firmware_log_names[];
void firmware_log(float *values);

#endif
