/* SPDX-License-Identifier: MIT
 *
 * What the Functional Mock-up Units of FMI 2.0 and 3.0 share: an instance of the averaged motor of piezomotor_averaged.c
 * with its phases, its variables, steps and states, and the functions that both versions declare alike.
 *
 * A file that includes this one first declares the types of its version, and defines FMI(name), which puts the prefix of
 * the version before a name, and the names that differ in more than the prefix: GET_RATES, GET_STATE, SET_STATE,
 * FREE_STATE, STATE_SIZE, STATE_TO_BYTES and STATE_FROM_BYTES. It also defines report().
 *
 * A value reference is the place of the variable in struct values; the states and their rates follow. Invalid input is an
 * error with a message that gives the value and the range; after it the instance must be reset. There are no variables
 * outside of the instances.
 */
#ifndef PIEZOMOTOR_FMI_H
#define PIEZOMOTOR_FMI_H

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

static void report(struct instance *c, const char *message);

struct variable { const char *name, *unit; double least, greatest; };
#define RANGE(name, unit, least, greatest, meaning) {#name, unit, least, greatest},
#define ONE(...) +1
static const struct variable INPUT[] = {INPUTS(RANGE) TUNABLE(RANGE)};
static const struct variable PARAMETER[] = {PARAMETERS(RANGE) MOUNT_PARAMETERS(RANGE) MOUNT_X_PARAMETERS(RANGE)};
static const struct variable OF_CONTACT[] = {CONTACT_PARAMETERS(RANGE)};
static const struct variable OF_MODE[] = {MODE_PARAMETERS(RANGE)};
static const struct variable SEAT[] = {SEAT_PARAMETERS(RANGE)};
static const struct variable TIP[] = {TIP_PARAMETERS(RANGE)};
enum {
    FIRST_PARAMETER = INPUT_COUNT OUTPUTS(ONE),
    FIRST_STATE = sizeof(struct values) / sizeof(double),
    FIRST_RATE = FIRST_STATE + STATES,
    TIME = FIRST_RATE + STATES, /* s */
    COUNT
};
#ifdef STATE_COUNT
_Static_assert(STATES == STATE_COUNT, "the model description has another number of states");
#endif

#define LONGEST 1e6 /* s, of one step between two communication points */

#define TEXT(name) TEXT_OF(name)
#define TEXT_OF(name) #name

static FMI(Status) fail(struct instance *c, const char *format, ...)
{
    char message[512];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    c->kept.phase = FAILED;
    report(c, message);
    return FMI(Error);
}

/* Check that a call is allowed now. */
static FMI(Status) allowed(struct instance *c, const char *call, int now)
{
    if (!now)
        return fail(c, "%s is not valid now: the instance is %s.", call, PHASE[c->kept.phase]);
    return FMI(OK);
}

static FMI(Status) unsupported(void *instance, const char *call, const char *reason)
{
    return instance ? fail(instance, "%s is not valid: %s.", call, reason) : FMI(Error);
}

static void unit_reset(struct instance *c)
{
    memset(&c->kept, 0, sizeof c->kept);
    motor_default(&c->kept.motor);
}

static FMI(Status) unit_times(struct instance *c, const char *call, double start, int stop_defined, double stop)
{
    if (allowed(c, call, c->kept.phase == INSTANTIATED) != FMI(OK))
        return FMI(Error);
    if (!isfinite(start) || (stop_defined && !(stop >= start)))
        return fail(c, "%s: start = %g s and stop = %g s are not valid: start must be finite, and stop not before it.", call,
            start, stop);
    c->kept.time = start;
    return FMI(OK);
}

/* Change the phase. */
static FMI(Status) unit_enter(struct instance *c, const char *call, enum phase from, enum phase to)
{
    if (!c || allowed(c, call, c->kept.phase == from) != FMI(OK))
        return FMI(Error);
    if (from == INITIALIZING) {
        motor_rest(&c->kept.motor);
        c->kept.measured = 1;
    }
    c->kept.phase = to;
    return FMI(OK);
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

static FMI(Status) unit_get(struct instance *c, const char *call, const unsigned reference[], size_t count, double value[])
{
    const struct motor *m;

    if (!c || (count && (!reference || !value)))
        return FMI(Error);
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
    return FMI(OK);
}

/* Return the input or parameter with a value reference, NULL for any other. */
static const struct variable *declared(unsigned reference)
{
#define PART(list, times) {list, sizeof list / sizeof *list, times}
    static const struct { const struct variable *list; unsigned count, times; } PARTS[] = {
        PART(INPUT, 1), {NULL, FIRST_PARAMETER - INPUT_COUNT, 1}, PART(OF_CONTACT, CONTACTS), PART(PARAMETER, 1),
        PART(OF_MODE, MODES), PART(SEAT, CONTACTS > 1 ? CONTACTS : 0), PART(TIP, (CONTACTS - 1) * MODES),
    };
    for (size_t i = 0; i < sizeof PARTS / sizeof *PARTS; i++) {
        if (reference < PARTS[i].count * PARTS[i].times)
            return PARTS[i].list ? &PARTS[i].list[reference % PARTS[i].count] : NULL;
        reference -= PARTS[i].count * PARTS[i].times;
    }
    return NULL;
}

static FMI(Status) unit_set(struct instance *c, const char *call, const unsigned reference[], size_t count,
    const double value[])
{
    if (!c || (count && (!reference || !value)))
        return FMI(Error);
    if (allowed(c, call, c->kept.phase <= RUNNING) != FMI(OK))
        return FMI(Error);
    for (size_t i = 0; i < count; i++) {
        unsigned r = reference[i];
        const struct variable *v = declared(r);
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
    return FMI(OK);
}

/* Check a step from a communication point. */
static FMI(Status) unit_step_allowed(struct instance *c, const char *call, double time, double step)
{
    if (!c || allowed(c, call, c->kept.phase == RUNNING && !c->exchange) != FMI(OK))
        return FMI(Error);
    if (!(step > 0.0 && step <= LONGEST))
        return fail(c, "%s: the step size %g s is not valid: it must be more than 0 and at most %g s.", call, step, LONGEST);
    if (!(fabs(time - c->kept.time) <= 1e-6 * step + 1e-9 * fabs(c->kept.time)))
        return fail(c, "%s: the communication point %.9g s is not valid: the instance is at %.9g s.", call, time,
            c->kept.time);
    return FMI(OK);
}

static FMI(Status) unit_unsolved(struct instance *c, const char *call)
{
    return fail(c, "%s: the equations have no solution after %.9g s. Check the parameters of the motor.", call, c->kept.time);
}

/* A function for what there is not; parameters is its list of them in parentheses, the instance first. */
#define ABSENT(name, reason, parameters) \
    EXPORT FMI(Status) FMI(name) parameters { return unsupported(instance, TEXT(FMI(name)), reason); }
/* Variables of other types; the last argument is the last parameter of the function, if it has more than three. */
#define NO_OTHERS_OF(name, type, reason, ...) \
    EXPORT FMI(Status) FMI(Get##name)(void *instance, const unsigned reference[], size_t count, type value[] __VA_ARGS__) \
    { \
        return count ? unsupported(instance, TEXT(FMI(Get##name)), reason) : FMI(OK); \
    } \
    EXPORT FMI(Status) FMI(Set##name)(void *instance, const unsigned reference[], size_t count, \
        const type value[] __VA_ARGS__) \
    { \
        return count ? unsupported(instance, TEXT(FMI(Set##name)), reason) : FMI(OK); \
    }
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

/* --- creation --- */

/* Return a new instance at its start values; for no name or another token free it and return NULL. */
static struct instance *begun(struct instance *c, const char *call, const char *name, const char *token)
{
    snprintf(c->name, sizeof c->name, "%s", name ? name : "");
    if (!name || !*name)
        fail(c, "%s: the instance needs a name.", call);
    else if (!token || strcmp(token, GUID) != 0)
        fail(c, "%s: the guid is %.80s, it must be %s: take binary and model description from one file.", call,
            token ? token : "missing", GUID);
    if (c->kept.phase == FAILED) {
        free(c);
        return NULL;
    }
    unit_reset(c);
    return c;
}

EXPORT FMI(Status) FMI(SetDebugLogging)(void *instance, FMI(Boolean) on, size_t count, const FMI(String) categories[])
{
    (void)on, (void)count, (void)categories; /* errors are always logged, and there is nothing else to log */
    return instance ? FMI(OK) : FMI(Error);
}

EXPORT void FMI(FreeInstance)(void *instance) { free(instance); }

EXPORT FMI(Status) FMI(Reset)(void *instance)
{
    if (!instance)
        return FMI(Error);
    unit_reset(instance);
    return FMI(OK);
}

EXPORT FMI(Status) FMI(ExitInitializationMode)(void *instance)
{
    return unit_enter(instance, TEXT(FMI(ExitInitializationMode)), INITIALIZING, RUNNING);
}

EXPORT FMI(Status) FMI(Terminate)(void *instance)
{
    return unit_enter(instance, TEXT(FMI(Terminate)), RUNNING, TERMINATED);
}

/* --- model exchange: the other program has the time and the states --- */

static FMI(Status) unit_exchange(struct instance *c, const char *call, int count_is_right)
{
    if (!c || allowed(c, call, c->exchange && (c->kept.phase == RUNNING || c->kept.phase == INITIALIZING)) != FMI(OK))
        return FMI(Error);
    if (!count_is_right)
        return fail(c, "%s: the number of values is not valid: it must be %d for the states.", call, STATES);
    return FMI(OK);
}

EXPORT FMI(Status) FMI(EnterEventMode)(void *instance)
{
    return unit_exchange(instance, TEXT(FMI(EnterEventMode)), 1);
}

EXPORT FMI(Status) FMI(EnterContinuousTimeMode)(void *instance)
{
    return unit_exchange(instance, TEXT(FMI(EnterContinuousTimeMode)), 1);
}

EXPORT FMI(Status) FMI(CompletedIntegratorStep)(void *instance, FMI(Boolean) no_set_prior, FMI(Boolean) *enter,
    FMI(Boolean) *terminate)
{
    (void)no_set_prior;
    if (unit_exchange(instance, TEXT(FMI(CompletedIntegratorStep)), 1) != FMI(OK) || !enter || !terminate)
        return FMI(Error);
    *enter = *terminate = 0; /* there are no events */
    return FMI(OK);
}

EXPORT FMI(Status) FMI(SetTime)(void *instance, double time)
{
    struct instance *c = instance;

    if (unit_exchange(c, TEXT(FMI(SetTime)), 1) != FMI(OK))
        return FMI(Error);
    c->kept.time = time; /* the equations do not contain it */
    return FMI(OK);
}

EXPORT FMI(Status) FMI(SetContinuousStates)(void *instance, const double states[], size_t count)
{
    struct instance *c = instance;

    if (unit_exchange(c, TEXT(FMI(SetContinuousStates)), states && count == STATES) != FMI(OK))
        return FMI(Error);
    for (size_t s = 0; s < STATES; s++)
        if (!isfinite(states[s]))
            return fail(c, "%s: state %zu = %g is not valid: it must be a finite number.", TEXT(FMI(SetContinuousStates)),
                s + 1, states[s]);
    memcpy(c->kept.motor.state, states, sizeof c->kept.motor.state);
    c->kept.measured = 0;
    return FMI(OK);
}

/* Copy what the equations give at the present states. */
static FMI(Status) unit_copy(struct instance *c, const char *call, const double *source, double values[], size_t count)
{
    if (unit_exchange(c, call, values && count == STATES) != FMI(OK))
        return FMI(Error);
    unit_measure(c);
    memcpy(values, source, STATES * sizeof(double));
    return FMI(OK);
}

EXPORT FMI(Status) FMI(GetContinuousStates)(void *instance, double states[], size_t count)
{
    struct instance *c = instance;

    return unit_copy(c, TEXT(FMI(GetContinuousStates)), c ? c->kept.motor.state : NULL, states, count);
}

EXPORT FMI(Status) GET_RATES(void *instance, double rates[], size_t count)
{
    struct instance *c = instance;

    return unit_copy(c, TEXT(GET_RATES), c ? c->kept.motor.rate : NULL, rates, count);
}

/* Sizes of the states, for the tolerance of the program that integrates. */
EXPORT FMI(Status) FMI(GetNominalsOfContinuousStates)(void *instance, double nominals[], size_t count)
{
    struct instance *c = instance;

    if (unit_exchange(c, TEXT(FMI(GetNominalsOfContinuousStates)), nominals && count == STATES) != FMI(OK))
        return FMI(Error);
    motor_scales(&c->kept.motor, nominals);
    return FMI(OK);
}

EXPORT FMI(Status) FMI(GetEventIndicators)(void *instance, double indicators[], size_t count)
{
    (void)indicators;
    return count ? unsupported(instance, TEXT(FMI(GetEventIndicators)), "there are none") : FMI(OK);
}

/* --- state of the unit, also as bytes --- */

static FMI(Status) unit_copy_of(struct instance *c, const char *call, const void *content, void **state)
{
    if (!*state)
        *state = malloc(sizeof(struct kept));
    if (!*state)
        return fail(c, "%s: there is no memory left.", call);
    memcpy(*state, content, sizeof(struct kept));
    return FMI(OK);
}

EXPORT FMI(Status) GET_STATE(void *instance, void **state)
{
    struct instance *c = instance;

    return c && state ? unit_copy_of(c, TEXT(GET_STATE), &c->kept, state) : FMI(Error);
}

EXPORT FMI(Status) SET_STATE(void *instance, void *state)
{
    struct instance *c = instance;

    if (!c || !state)
        return FMI(Error);
    memcpy(&c->kept, state, sizeof c->kept);
    return FMI(OK);
}

EXPORT FMI(Status) FREE_STATE(void *instance, void **state)
{
    if (!instance)
        return FMI(Error);
    if (state) {
        free(*state);
        *state = NULL;
    }
    return FMI(OK);
}

EXPORT FMI(Status) STATE_SIZE(void *instance, void *state, size_t *size)
{
    if (!instance || !state || !size)
        return FMI(Error);
    *size = sizeof(struct kept);
    return FMI(OK);
}

EXPORT FMI(Status) STATE_TO_BYTES(void *instance, void *state, FMI(Byte) bytes[], size_t size)
{
    if (!instance || !state || !bytes)
        return FMI(Error);
    if (size < sizeof(struct kept))
        return fail(instance, "%s: %zu bytes are too few: it must be %zu.", TEXT(STATE_TO_BYTES), size,
            sizeof(struct kept));
    memcpy(bytes, state, sizeof(struct kept));
    return FMI(OK);
}

EXPORT FMI(Status) STATE_FROM_BYTES(void *instance, const FMI(Byte) bytes[], size_t size, void **state)
{
    struct kept kept;

    if (!instance || !bytes || !state)
        return FMI(Error);
    if (size != sizeof kept)
        return fail(instance, "%s: %zu bytes are not a state of this motor: it must be %zu.", TEXT(STATE_FROM_BYTES), size,
            sizeof kept);
    memcpy(&kept, bytes, size);
    if ((int)kept.phase < INSTANTIATED || kept.phase > FAILED)
        return fail(instance, "%s: the bytes are not a state of this motor. Serialize it again.", TEXT(STATE_FROM_BYTES));
    return unit_copy_of(instance, TEXT(STATE_FROM_BYTES), bytes, state);
}

#endif
