/* SPDX-License-Identifier: MIT
 *
 * FMI 2.0 for co-simulation and model exchange around the averaged motor; piezomotor_fmi.h has what
 * both versions share.
 *
 * SOURCE Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.2, Modelica Association
 */
#include <stddef.h>

/* --- what fmi2Functions.h declares --- */

typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void (*fmi2Logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
typedef struct {
    fmi2Logger logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;
typedef struct {
    fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged, valuesOfContinuousStatesChanged,
        nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;

#define FMI(name) fmi2##name
#define GET_RATES fmi2GetDerivatives
#define GET_STATE fmi2GetFMUstate
#define SET_STATE fmi2SetFMUstate
#define FREE_STATE fmi2FreeFMUstate
#define STATE_SIZE fmi2SerializedFMUstateSize
#define STATE_TO_BYTES fmi2SerializeFMUstate
#define STATE_FROM_BYTES fmi2DeSerializeFMUstate
#include "piezomotor_fmi.h"

static void report(struct instance *c, const char *message)
{
    ((fmi2Logger)c->log)(c->environment, c->name, fmi2Error, "logStatusError", "%s", message);
}

/* --- creation --- */

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    if (!callbacks || !callbacks->logger)
        return NULL;
    struct instance *c = calloc(1, sizeof *c);
    if (!c)
        return NULL;
    c->log = (void (*)(void))callbacks->logger;
    c->environment = callbacks->componentEnvironment;
    c->exchange = type == fmi2ModelExchange;
    return begun(c, "fmi2Instantiate", name, guid);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
    fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop)
{
    /* without the tolerance: the internal step follows from the motor */
    return component ? unit_times(component, "fmi2SetupExperiment", start, stop_defined, stop) : fmi2Error;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component component)
{
    return unit_enter(component, "fmi2EnterInitializationMode", INSTANTIATED, INITIALIZING);
}

/* --- variables --- */

EXPORT fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference reference[], size_t count, fmi2Real value[])
{
    return unit_get(component, "fmi2GetReal", reference, count, value);
}

EXPORT fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference reference[], size_t count,
    const fmi2Real value[])
{
    return unit_set(component, "fmi2SetReal", reference, count, value);
}

#define NO_OTHERS(name) NO_OTHERS_OF(name, fmi2##name, "all variables are of type Real", )
NO_OTHERS(Integer)
NO_OTHERS(Boolean)
NO_OTHERS(String)

/* --- co-simulation --- */

EXPORT fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean no_return)
{
    struct instance *c = component;

    if (unit_step_allowed(c, "fmi2DoStep", time, step) != fmi2OK)
        return fmi2Error;
    if (motor_advance(&c->kept.motor, step) != 0)
        return unit_unsolved(c, "fmi2DoStep");
    c->kept.time = time + step;
    c->kept.measured = 1;
    return fmi2OK;
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
        return fmi2Discard; \
    }
NO_STATUS(, fmi2Status)
NO_STATUS(Integer, fmi2Integer)
NO_STATUS(Boolean, fmi2Boolean)
NO_STATUS(String, fmi2String)

#define REFERENCES fmi2Component instance, const fmi2ValueReference reference[], size_t count
ABSENT(CancelStep, "fmi2DoStep returns when the step is done", (fmi2Component instance))
ABSENT(SetRealInputDerivatives, "inputs are constant between two steps",
    (REFERENCES, const fmi2Integer order[], const fmi2Real value[]))
ABSENT(GetRealOutputDerivatives, "there are no derivatives of outputs",
    (REFERENCES, const fmi2Integer order[], fmi2Real value[]))
ABSENT(GetDirectionalDerivative, "there are no directional derivatives",
    (REFERENCES, const fmi2ValueReference known[], size_t known_count, const fmi2Real by[], fmi2Real value[]))

/* --- model exchange --- */

EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info)
{
    if (unit_exchange(component, "fmi2NewDiscreteStates", 1) != fmi2OK || !info)
        return fmi2Error;
    memset(info, 0, sizeof *info); /* there are no events */
    return fmi2OK;
}
