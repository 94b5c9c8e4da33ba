/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * FMI 2.0 for co-simulation around the averaged motor of piezomotor_averaged.c.
 *
 * A value reference is the place of the variable in struct values. Invalid input is fmi2Error with a message that gives
 * the value and the range; after it the instance must be reset. There are no variables outside of the instances.
 *
 * SOURCE Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.2, Modelica Association
 */
#include "piezomotor_averaged.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- what fmi2Functions.h declares --- */

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

/* --- instance --- */

enum phase { INSTANTIATED, INITIALIZING, RUNNING, TERMINATED, FAILED };
static const char *const PHASE[] = {"instantiated", "in initialization", "running", "terminated", "in error; reset it"};

struct kept { /* what a reset sets back, and an FMU state holds */
    struct motor motor;
    enum phase phase;
    double time; /* s */
    int measured;
};

struct instance {
    struct kept kept;
    fmi2CallbackFunctions callbacks;
    char name[256];
};

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
    COUNT = FIRST_OF_MODES + MODES * COUNT_OF_MODE
};

#define LONGEST 1e6 /* s, of one call of fmi2DoStep */

static fmi2Status fail(struct instance *c, const char *format, ...)
{
    char message[512];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    c->kept.phase = FAILED;
    c->callbacks.logger(c->callbacks.componentEnvironment, c->name, fmi2Error, "logStatusError", "%s", message);
    return fmi2Error;
}

/* Check that a call is allowed now. */
static fmi2Status allowed(struct instance *c, const char *call, int now)
{
    if (!now)
        return fail(c, "%s is not valid now: the instance is %s.", call, PHASE[c->kept.phase]);
    return fmi2OK;
}

static fmi2Status unsupported(fmi2Component component, const char *call, const char *reason)
{
    return component ? fail(component, "%s is not valid: %s.", call, reason) : fmi2Error;
}

/* --- creation --- */

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)on, (void)count, (void)categories; /* errors are always logged, and there is nothing else to log */
    return component ? fmi2OK : fmi2Error;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible, (void)logging;
    if (!callbacks || !callbacks->logger)
        return NULL;
    struct instance *c = calloc(1, sizeof *c);
    if (!c)
        return NULL;
    c->callbacks = *callbacks;
    snprintf(c->name, sizeof c->name, "%s", name ? name : "");
    if (type != fmi2CoSimulation)
        fail(c, "fmi2Instantiate: the type must be fmi2CoSimulation; there is no model exchange.");
    else if (!name || !*name)
        fail(c, "fmi2Instantiate: the instance needs a name.");
    else if (!guid || strcmp(guid, GUID) != 0)
        fail(c, "fmi2Instantiate: the guid is %.80s, it must be %s: take binary and model description from one file.",
            guid ? guid : "missing", GUID);
    else {
        fmi2Status fmi2Reset(fmi2Component);
        fmi2Reset(c);
        return c;
    }
    free(c);
    return NULL;
}

EXPORT void fmi2FreeInstance(fmi2Component component) { free(component); }

EXPORT fmi2Status fmi2Reset(fmi2Component component)
{
    struct instance *c = component;

    if (!c)
        return fmi2Error;
    memset(&c->kept, 0, sizeof c->kept);
    motor_default(&c->kept.motor);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
    fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop)
{
    struct instance *c = component;

    (void)tolerance_defined, (void)tolerance; /* the internal step follows from the motor */
    if (!c || allowed(c, "fmi2SetupExperiment", c->kept.phase == INSTANTIATED) != fmi2OK)
        return fmi2Error;
    if (!isfinite(start) || (stop_defined && !(stop >= start)))
        return fail(c, "fmi2SetupExperiment: start = %g s and stop = %g s are not valid: start must be finite, and stop "
            "not before it.", start, stop);
    c->kept.time = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    struct instance *c = component;

    if (!c || allowed(c, "fmi2EnterInitializationMode", c->kept.phase == INSTANTIATED) != fmi2OK)
        return fmi2Error;
    c->kept.phase = INITIALIZING;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component component)
{
    struct instance *c = component;

    if (!c || allowed(c, "fmi2ExitInitializationMode", c->kept.phase == INITIALIZING) != fmi2OK)
        return fmi2Error;
    motor_rest(&c->kept.motor);
    c->kept.measured = 1;
    c->kept.phase = RUNNING;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component component)
{
    struct instance *c = component;

    if (!c || allowed(c, "fmi2Terminate", c->kept.phase == RUNNING) != fmi2OK)
        return fmi2Error;
    c->kept.phase = TERMINATED;
    return fmi2OK;
}

/* --- variables --- */

EXPORT fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference reference[], size_t count, fmi2Real value[])
{
    struct instance *c = component;

    if (!c || (count && (!reference || !value)))
        return fmi2Error;
    for (size_t i = 0; i < count; i++)
        if (reference[i] >= COUNT)
            return fail(c, "fmi2GetReal: the value reference %u is not valid: it must be below %d.", reference[i], COUNT);
    if (!c->kept.measured && c->kept.phase == INITIALIZING)
        motor_rest(&c->kept.motor); /* outputs for the parameters and inputs that are set until now */
    else if (!c->kept.measured && c->kept.phase == RUNNING)
        motor_measure(&c->kept.motor);
    c->kept.measured = 1;
    for (size_t i = 0; i < count; i++)
        value[i] = ((const double *)&c->kept.motor.value)[reference[i]];
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference reference[], size_t count,
    const fmi2Real value[])
{
    struct instance *c = component;

    if (!c || (count && (!reference || !value)))
        return fmi2Error;
    if (allowed(c, "fmi2SetReal", c->kept.phase <= RUNNING) != fmi2OK)
        return fmi2Error;
    for (size_t i = 0; i < count; i++) {
        unsigned r = reference[i];
        const struct variable *v = NULL;
        if (r < INPUT_COUNT)
            v = &INPUT[r];
        else if (r >= FIRST_PARAMETER && r < FIRST_OF_MODES)
            v = &PARAMETER[r - FIRST_PARAMETER];
        else if (r >= FIRST_OF_MODES && r < COUNT)
            v = &OF_MODE[(r - FIRST_OF_MODES) % COUNT_OF_MODE];
        if (!v)
            return fail(c, "fmi2SetReal: the value reference %u is not that of an input or a parameter.", r);
        if (r >= FIRST_PARAMETER && c->kept.phase == RUNNING)
            return fail(c, "fmi2SetReal: the parameter %s cannot change during a run. Reset the instance first.", v->name);
        if (!(value[i] >= v->least && value[i] <= v->greatest))
            return fail(c, "fmi2SetReal: %s = %g %s is not valid: it must be between %g and %g.", v->name, value[i], v->unit,
                v->least, v->greatest);
    }
    for (size_t i = 0; i < count; i++)
        ((double *)&c->kept.motor.value)[reference[i]] = value[i];
    if (count)
        c->kept.measured = 0;
    return fmi2OK;
}

#define NO_OTHERS(Type) \
    EXPORT fmi2Status fmi2Get##Type(fmi2Component component, const fmi2ValueReference reference[], size_t count, \
        fmi2##Type value[]) \
    { \
        (void)reference, (void)value; \
        return count ? unsupported(component, "fmi2Get" #Type, "all variables are of type Real") : fmi2OK; \
    } \
    EXPORT fmi2Status fmi2Set##Type(fmi2Component component, const fmi2ValueReference reference[], size_t count, \
        const fmi2##Type value[]) \
    { \
        (void)reference, (void)value; \
        return count ? unsupported(component, "fmi2Set" #Type, "all variables are of type Real") : fmi2OK; \
    }
NO_OTHERS(Integer)
NO_OTHERS(Boolean)
NO_OTHERS(String)

/* --- steps --- */

EXPORT fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean no_return)
{
    struct instance *c = component;

    (void)no_return;
    if (!c || allowed(c, "fmi2DoStep", c->kept.phase == RUNNING) != fmi2OK)
        return fmi2Error;
    if (!(step > 0.0 && step <= LONGEST))
        return fail(c, "fmi2DoStep: the step size %g s is not valid: it must be more than 0 and at most %g s.", step, LONGEST);
    if (!(fabs(time - c->kept.time) <= 1e-6 * step + 1e-9 * fabs(c->kept.time)))
        return fail(c, "fmi2DoStep: the communication point %.9g s is not valid: the instance is at %.9g s.", time,
            c->kept.time);
    if (motor_advance(&c->kept.motor, step) != 0)
        return fail(c, "fmi2DoStep: the equations have no solution after %.9g s. Check the parameters of the motor.", time);
    c->kept.time = time + step;
    c->kept.measured = 1;
    return fmi2OK;
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component component)
{
    return unsupported(component, "fmi2CancelStep", "fmi2DoStep returns when the step is done");
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value)
{
    struct instance *c = component;

    if (!c || !value || kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = c->kept.time;
    return fmi2OK;
}

#define NO_STATUS(Name, Type) \
    EXPORT fmi2Status fmi2Get##Name##Status(fmi2Component component, const fmi2StatusKind kind, Type *value) \
    { \
        (void)component, (void)kind, (void)value; \
        return fmi2Discard; \
    }
NO_STATUS(, fmi2Status)
NO_STATUS(Integer, fmi2Integer)
NO_STATUS(Boolean, fmi2Boolean)
NO_STATUS(String, fmi2String)

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference reference[], size_t count,
    const fmi2Integer order[], const fmi2Real value[])
{
    (void)reference, (void)count, (void)order, (void)value;
    return unsupported(component, "fmi2SetRealInputDerivatives", "inputs are constant between two steps");
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference reference[], size_t count,
    const fmi2Integer order[], fmi2Real value[])
{
    (void)reference, (void)count, (void)order, (void)value;
    return unsupported(component, "fmi2GetRealOutputDerivatives", "there are no derivatives of outputs");
}

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknown[],
    size_t unknown_count, const fmi2ValueReference known[], size_t known_count, const fmi2Real by[], fmi2Real value[])
{
    (void)unknown, (void)unknown_count, (void)known, (void)known_count, (void)by, (void)value;
    return unsupported(component, "fmi2GetDirectionalDerivative", "there are no directional derivatives");
}

/* --- state of the FMU --- */

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    struct instance *c = component;

    if (!c || !state)
        return fmi2Error;
    if (!*state)
        *state = malloc(sizeof c->kept);
    if (!*state)
        return fail(c, "fmi2GetFMUstate: there is no memory left.");
    memcpy(*state, &c->kept, sizeof c->kept);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state)
{
    struct instance *c = component;

    if (!c || !state)
        return fmi2Error;
    memcpy(&c->kept, state, sizeof c->kept);
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state)
{
    if (!component)
        return fmi2Error;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size)
{
    if (!component || !state || !size)
        return fmi2Error;
    *size = sizeof(struct kept);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (!component || !state || !bytes)
        return fmi2Error;
    if (size < sizeof(struct kept))
        return fail(component, "fmi2SerializeFMUstate: %zu bytes are too few: it must be %zu.", size, sizeof(struct kept));
    memcpy(bytes, state, sizeof(struct kept));
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    struct instance *c = component;

    if (!c || !bytes || !state)
        return fmi2Error;
    if (size != sizeof c->kept)
        return fail(c, "fmi2DeSerializeFMUstate: %zu bytes are not a state of this motor: it must be %zu.", size,
            sizeof c->kept);
    struct kept kept;
    memcpy(&kept, bytes, size);
    if ((int)kept.phase < INSTANTIATED || kept.phase > FAILED)
        return fail(c, "fmi2DeSerializeFMUstate: the bytes are not a state of this motor. Serialize it again.");
    if (!*state)
        *state = malloc(size);
    if (!*state)
        return fail(c, "fmi2DeSerializeFMUstate: there is no memory left.");
    memcpy(*state, bytes, size);
    return fmi2OK;
}
