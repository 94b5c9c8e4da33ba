/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * What the Functional Mock-up Units of FMI 2.0 and 3.0 have in common: an instance of the averaged motor of
 * piezomotor_averaged.c with its phases, the access to its variables, steps and states.
 *
 * A value reference is the place of the variable in struct values; the states and their rates follow. Invalid input is an
 * error with a message that gives the value and the range; after it the instance must be reset. There are no variables
 * outside of the instances. A file that includes this one defines report().
 */
#ifndef PIEZOMOTOR_UNIT_H
#define PIEZOMOTOR_UNIT_H

#include "piezomotor_averaged.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

enum phase { INSTANTIATED, INITIALIZING, RUNNING, TERMINATED, FAILED };
static const char *const PHASE[] = {"instantiated", "in initialization", "running", "terminated", "in error; reset it"};

struct kept { /* what a reset sets back, and the state of a unit holds */
    struct motor motor;
    enum phase phase;
    double time; /* s */
    int measured;
};

struct instance {
    struct kept kept;
    int exchange; /* model exchange: another program integrates */
    int early;    /* whether a step may end early */
    char name[256];
    void *environment;
    void (*log)(void);    /* of the importing program, as its version of FMI declares it */
    void (*between)(void); /* likewise, called after each internal step */
};

enum unit_status { UNIT_OK, UNIT_ERROR };

static void report(struct instance *c, const char *message);

struct variable { const char *name, *unit; double least, greatest; };
#define RANGE(name, unit, least, greatest, meaning) {#name, unit, least, greatest},
#define ONE(...) +1
static const struct variable INPUT[] = {INPUTS(RANGE) TUNABLE(RANGE)};
static const struct variable PARAMETER[] = {PARAMETERS(RANGE) MOUNT_PARAMETERS(RANGE) MOUNT_X_PARAMETERS(RANGE)};
static const struct variable OF_MODE[] = {MODE_PARAMETERS(RANGE)};
enum {
    FIRST_PARAMETER = INPUT_COUNT OUTPUTS(ONE),
    FIRST_OF_MODES = FIRST_PARAMETER PARAMETERS(ONE) MOUNT_PARAMETERS(ONE) MOUNT_X_PARAMETERS(ONE),
    COUNT_OF_MODE = 0 MODE_PARAMETERS(ONE),
    FIRST_STATE = FIRST_OF_MODES + MODES * COUNT_OF_MODE,
    FIRST_RATE = FIRST_STATE + STATES,
    TIME = FIRST_RATE + STATES, /* s */
    COUNT
};
#ifdef STATE_COUNT
_Static_assert(STATES == STATE_COUNT, "the model description has another number of states");
#endif

#define LONGEST 1e6 /* s, of one step between two communication points */

static enum unit_status fail(struct instance *c, const char *format, ...)
{
    char message[512];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    c->kept.phase = FAILED;
    report(c, message);
    return UNIT_ERROR;
}

/* Check that a call is allowed now. */
static enum unit_status allowed(struct instance *c, const char *call, int now)
{
    if (!now)
        return fail(c, "%s is not valid now: the instance is %s.", call, PHASE[c->kept.phase]);
    return UNIT_OK;
}

/* Check name and token of a new instance. */
static enum unit_status unit_begin(struct instance *c, const char *call, const char *name, const char *token)
{
    snprintf(c->name, sizeof c->name, "%s", name ? name : "");
    if (!name || !*name)
        return fail(c, "%s: the instance needs a name.", call);
    if (!token || strcmp(token, GUID) != 0)
        return fail(c, "%s: the guid is %.80s, it must be %s: take binary and model description from one file.", call,
            token ? token : "missing", GUID);
    return UNIT_OK;
}

static void unit_reset(struct instance *c)
{
    memset(&c->kept, 0, sizeof c->kept);
    motor_default(&c->kept.motor);
}

static enum unit_status unit_times(struct instance *c, const char *call, double start, int stop_defined, double stop)
{
    if (allowed(c, call, c->kept.phase == INSTANTIATED) != UNIT_OK)
        return UNIT_ERROR;
    if (!isfinite(start) || (stop_defined && !(stop >= start)))
        return fail(c, "%s: start = %g s and stop = %g s are not valid: start must be finite, and stop not before it.", call,
            start, stop);
    c->kept.time = start;
    return UNIT_OK;
}

/* Change the phase. */
static enum unit_status unit_enter(struct instance *c, const char *call, enum phase from, enum phase to)
{
    if (!c || allowed(c, call, c->kept.phase == from) != UNIT_OK)
        return UNIT_ERROR;
    if (from == INITIALIZING) {
        motor_rest(&c->kept.motor);
        c->kept.measured = 1;
    }
    c->kept.phase = to;
    return UNIT_OK;
}

/* Bring outputs and rates up to the inputs, parameters and states that are set until now. */
static void unit_measure(struct instance *c)
{
    if (!c->kept.measured && c->kept.phase == INITIALIZING)
        motor_rest(&c->kept.motor);
    else if (!c->kept.measured && c->kept.phase == RUNNING)
        motor_measure(&c->kept.motor);
    if (!c->kept.measured && c->exchange)
        motor_begin(&c->kept.motor);
    c->kept.measured = 1;
}

static enum unit_status unit_get(struct instance *c, const char *call, const unsigned reference[], size_t count, double value[])
{
    const struct motor *m;

    if (!c || (count && (!reference || !value)))
        return UNIT_ERROR;
    m = &c->kept.motor;
    for (size_t i = 0; i < count; i++)
        if (reference[i] >= COUNT)
            return fail(c, "%s: the value reference %u is not valid: it must be below %d.", call, reference[i], COUNT);
    unit_measure(c);
    for (size_t i = 0; i < count; i++) {
        unsigned r = reference[i];
        if (r < FIRST_STATE)
            value[i] = ((const double *)&m->value)[r];
        else if (r < FIRST_RATE)
            value[i] = m->state[r - FIRST_STATE];
        else
            value[i] = r < TIME ? m->rate[r - FIRST_RATE] : c->kept.time;
    }
    return UNIT_OK;
}

static enum unit_status unit_set(struct instance *c, const char *call, const unsigned reference[], size_t count,
    const double value[])
{
    if (!c || (count && (!reference || !value)))
        return UNIT_ERROR;
    if (allowed(c, call, c->kept.phase <= RUNNING) != UNIT_OK)
        return UNIT_ERROR;
    for (size_t i = 0; i < count; i++) {
        unsigned r = reference[i];
        const struct variable *v = NULL;
        if (r < INPUT_COUNT)
            v = &INPUT[r];
        else if (r >= FIRST_PARAMETER && r < FIRST_OF_MODES)
            v = &PARAMETER[r - FIRST_PARAMETER];
        else if (r >= FIRST_OF_MODES && r < FIRST_STATE)
            v = &OF_MODE[(r - FIRST_OF_MODES) % COUNT_OF_MODE];
        if (!v)
            return fail(c, "%s: the value reference %u is not that of an input or a parameter.", call, r);
        if (r >= FIRST_PARAMETER && c->kept.phase == RUNNING)
            return fail(c, "%s: the parameter %s cannot change during a run. Reset the instance first.", call, v->name);
        if (!(value[i] >= v->least && value[i] <= v->greatest))
            return fail(c, "%s: %s = %g %s is not valid: it must be between %g and %g.", call, v->name, value[i], v->unit,
                v->least, v->greatest);
    }
    for (size_t i = 0; i < count; i++)
        ((double *)&c->kept.motor.value)[reference[i]] = value[i];
    if (count)
        c->kept.measured = 0;
    return UNIT_OK;
}

/* Check a step from a communication point. */
static enum unit_status unit_step_allowed(struct instance *c, const char *call, double time, double step)
{
    if (!c || allowed(c, call, c->kept.phase == RUNNING && !c->exchange) != UNIT_OK)
        return UNIT_ERROR;
    if (!(step > 0.0 && step <= LONGEST))
        return fail(c, "%s: the step size %g s is not valid: it must be more than 0 and at most %g s.", call, step, LONGEST);
    if (!(fabs(time - c->kept.time) <= 1e-6 * step + 1e-9 * fabs(c->kept.time)))
        return fail(c, "%s: the communication point %.9g s is not valid: the instance is at %.9g s.", call, time,
            c->kept.time);
    return UNIT_OK;
}

static enum unit_status unit_unsolved(struct instance *c, const char *call)
{
    return fail(c, "%s: the equations have no solution after %.9g s. Check the parameters of the motor.", call, c->kept.time);
}

/* --- model exchange: the other program has the time and the states --- */

static enum unit_status unit_exchange(struct instance *c, const char *call, int count_is_right)
{
    if (!c || allowed(c, call, c->exchange && (c->kept.phase == RUNNING || c->kept.phase == INITIALIZING)) != UNIT_OK)
        return UNIT_ERROR;
    if (!count_is_right)
        return fail(c, "%s: the number of values is not valid: it must be %d for the states.", call, STATES);
    return UNIT_OK;
}

static enum unit_status unit_set_states(struct instance *c, const char *call, const double states[], size_t count)
{
    if (unit_exchange(c, call, states && count == STATES) != UNIT_OK)
        return UNIT_ERROR;
    for (size_t s = 0; s < STATES; s++)
        if (!isfinite(states[s]))
            return fail(c, "%s: state %zu = %g is not valid: it must be a finite number.", call, s + 1, states[s]);
    memcpy(c->kept.motor.state, states, sizeof c->kept.motor.state);
    c->kept.measured = 0;
    return UNIT_OK;
}

static enum unit_status unit_get_states(struct instance *c, const char *call, double states[], size_t count)
{
    if (unit_exchange(c, call, states && count == STATES) != UNIT_OK)
        return UNIT_ERROR;
    unit_measure(c);
    memcpy(states, c->kept.motor.state, sizeof c->kept.motor.state);
    return UNIT_OK;
}

static enum unit_status unit_get_rates(struct instance *c, const char *call, double rates[], size_t count)
{
    if (unit_exchange(c, call, rates && count == STATES) != UNIT_OK)
        return UNIT_ERROR;
    unit_measure(c);
    memcpy(rates, c->kept.motor.rate, sizeof c->kept.motor.rate);
    return UNIT_OK;
}

/* Sizes of the states, for the tolerance of the program that integrates. */
static enum unit_status unit_nominals(struct instance *c, const char *call, double nominals[], size_t count)
{
    if (unit_exchange(c, call, nominals && count == STATES) != UNIT_OK)
        return UNIT_ERROR;
    motor_scales(&c->kept.motor, nominals);
    return UNIT_OK;
}

/* --- state of a unit as bytes --- */

static enum unit_status unit_copy_of(struct instance *c, const char *call, const void *content, void **state)
{
    if (!*state)
        *state = malloc(sizeof(struct kept));
    if (!*state)
        return fail(c, "%s: there is no memory left.", call);
    memcpy(*state, content, sizeof(struct kept));
    return UNIT_OK;
}

static enum unit_status unit_from_bytes(struct instance *c, const char *call, const void *bytes, size_t size, void **state)
{
    struct kept kept;

    if (size != sizeof kept)
        return fail(c, "%s: %zu bytes are not a state of this motor: it must be %zu.", call, size, sizeof kept);
    memcpy(&kept, bytes, size);
    if ((int)kept.phase < INSTANTIATED || kept.phase > FAILED)
        return fail(c, "%s: the bytes are not a state of this motor. Serialize it again.", call);
    return unit_copy_of(c, call, bytes, state);
}

#endif
