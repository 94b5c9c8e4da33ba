/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The functions that FMI 2.0 and 3.0 declare alike. A file that includes this one first declares the types of its version,
 * and defines FMI(name), which puts the prefix of the version before a name, and the names that differ in more than that:
 * GET_RATES, GET_STATE, SET_STATE, FREE_STATE, STATE_SIZE, STATE_TO_BYTES and STATE_FROM_BYTES.
 */
#ifndef PIEZOMOTOR_FMI_H
#define PIEZOMOTOR_FMI_H

#include "piezomotor_unit.h"

#define TEXT(name) TEXT_OF(name)
#define TEXT_OF(name) #name

static FMI(Status) told(enum unit_status status) { return status == UNIT_OK ? FMI(OK) : FMI(Error); }

static FMI(Status) unsupported(void *instance, const char *call, const char *reason)
{
    return instance ? told(fail(instance, "%s is not valid: %s.", call, reason)) : FMI(Error);
}

/* --- creation --- */

/* Return a new instance at its start values; for no name or another token free it and return NULL. */
static struct instance *begun(struct instance *c, const char *call, const char *name, const char *token)
{
    if (unit_begin(c, call, name, token) != UNIT_OK) {
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
    return told(unit_enter(instance, TEXT(FMI(ExitInitializationMode)), INITIALIZING, RUNNING));
}

EXPORT FMI(Status) FMI(Terminate)(void *instance)
{
    return told(unit_enter(instance, TEXT(FMI(Terminate)), RUNNING, TERMINATED));
}

/* --- model exchange --- */

EXPORT FMI(Status) FMI(EnterEventMode)(void *instance)
{
    return told(unit_exchange(instance, TEXT(FMI(EnterEventMode)), 1));
}

EXPORT FMI(Status) FMI(EnterContinuousTimeMode)(void *instance)
{
    return told(unit_exchange(instance, TEXT(FMI(EnterContinuousTimeMode)), 1));
}

EXPORT FMI(Status) FMI(CompletedIntegratorStep)(void *instance, FMI(Boolean) no_set_prior, FMI(Boolean) *enter,
    FMI(Boolean) *terminate)
{
    (void)no_set_prior;
    if (unit_exchange(instance, TEXT(FMI(CompletedIntegratorStep)), 1) != UNIT_OK || !enter || !terminate)
        return FMI(Error);
    *enter = *terminate = 0; /* there are no events */
    return FMI(OK);
}

EXPORT FMI(Status) FMI(SetTime)(void *instance, double time)
{
    struct instance *c = instance;

    if (unit_exchange(c, TEXT(FMI(SetTime)), 1) != UNIT_OK)
        return FMI(Error);
    c->kept.time = time; /* the equations do not contain it */
    return FMI(OK);
}

EXPORT FMI(Status) FMI(SetContinuousStates)(void *instance, const double states[], size_t count)
{
    return told(unit_set_states(instance, TEXT(FMI(SetContinuousStates)), states, count));
}

EXPORT FMI(Status) FMI(GetContinuousStates)(void *instance, double states[], size_t count)
{
    return told(unit_get_states(instance, TEXT(FMI(GetContinuousStates)), states, count));
}

EXPORT FMI(Status) GET_RATES(void *instance, double rates[], size_t count)
{
    return told(unit_get_rates(instance, TEXT(GET_RATES), rates, count));
}

EXPORT FMI(Status) FMI(GetNominalsOfContinuousStates)(void *instance, double nominals[], size_t count)
{
    return told(unit_nominals(instance, TEXT(FMI(GetNominalsOfContinuousStates)), nominals, count));
}

EXPORT FMI(Status) FMI(GetEventIndicators)(void *instance, double indicators[], size_t count)
{
    (void)indicators;
    return count ? unsupported(instance, TEXT(FMI(GetEventIndicators)), "there are none") : FMI(OK);
}

/* --- state of the FMU --- */

EXPORT FMI(Status) GET_STATE(void *instance, void **state)
{
    struct instance *c = instance;

    return c && state ? told(unit_copy_of(c, TEXT(GET_STATE), &c->kept, state)) : FMI(Error);
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
        return told(fail(instance, "%s: %zu bytes are too few: it must be %zu.", TEXT(STATE_TO_BYTES), size,
            sizeof(struct kept)));
    memcpy(bytes, state, sizeof(struct kept));
    return FMI(OK);
}

EXPORT FMI(Status) STATE_FROM_BYTES(void *instance, const FMI(Byte) bytes[], size_t size, void **state)
{
    if (!instance || !bytes || !state)
        return FMI(Error);
    return told(unit_from_bytes(instance, TEXT(STATE_FROM_BYTES), bytes, size, state));
}

#endif
