/* SPDX-License-Identifier: MIT
 *
 * FMI 3.0 for co-simulation and model exchange around the averaged motor; piezomotor_fmi.h has what
 * both versions share.
 *
 * In co-simulation the importing program is called after each internal step, may read all variables there, and may end the
 * step early.
 *
 * SOURCE Functional Mock-up Interface Specification, version 3.0.2, Modelica Association
 */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* --- what fmi3Functions.h declares --- */

typedef void *fmi3Instance, *fmi3InstanceEnvironment, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef bool fmi3Boolean, fmi3Clock;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean, fmi3Boolean,
    fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3Any)(void);

#define FMI(name) fmi3##name
#define GET_RATES fmi3GetContinuousStateDerivatives
#define GET_STATE fmi3GetFMUState
#define SET_STATE fmi3SetFMUState
#define FREE_STATE fmi3FreeFMUState
#define STATE_SIZE fmi3SerializedFMUStateSize
#define STATE_TO_BYTES fmi3SerializeFMUState
#define STATE_FROM_BYTES fmi3DeserializeFMUState
#include "piezomotor_fmi.h"

static void report(struct instance *c, const char *message)
{
    if (c->log)
        ((fmi3LogMessageCallback)c->log)(c->environment, fmi3Error, "logStatusError", message);
}

/* --- creation --- */

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

static fmi3Instance created(const char *call, const char *name, const char *token, void *environment,
    fmi3LogMessageCallback log, int exchange, fmi3IntermediateUpdateCallback between)
{
    struct instance *c = calloc(1, sizeof *c);

    if (!c)
        return NULL;
    c->environment = environment;
    c->log = (fmi3Any)log;
    c->between = (fmi3Any)between;
    c->exchange = exchange;
    return begun(c, call, name, token);
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    return created("fmi3InstantiateModelExchange", name, token, environment, log, 1, NULL);
}

EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return, const fmi3ValueReference required[], size_t count,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback between)
{
    struct instance *c = created("fmi3InstantiateCoSimulation", name, token, environment, log, 0, between);
    if (c)
        c->early = early_return;
    return c;
}

EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3Any clock_update, fmi3Any lock, fmi3Any unlock)
{
    if (log)
        log(environment, fmi3Error, "logStatusError", "fmi3InstantiateScheduledExecution is not valid: there are no clocks.");
    return NULL;
}

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop)
{
    const char *call = "fmi3EnterInitializationMode";

    /* without the tolerance: the internal step follows from the motor */
    if (!instance || unit_times(instance, call, start, stop_defined, stop) != fmi3OK)
        return fmi3Error;
    return unit_enter(instance, call, INSTANTIATED, INITIALIZING);
}

/* --- variables --- */

EXPORT fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference reference[], size_t count, fmi3Float64 value[],
    size_t values)
{
    if (instance && values != count)
        return unsupported(instance, "fmi3GetFloat64", "there must be one value for each reference");
    return unit_get(instance, "fmi3GetFloat64", reference, count, value);
}

EXPORT fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference reference[], size_t count,
    const fmi3Float64 value[], size_t values)
{
    if (instance && values != count)
        return unsupported(instance, "fmi3SetFloat64", "there must be one value for each reference");
    return unit_set(instance, "fmi3SetFloat64", reference, count, value);
}

#define ALL_OF_FLOAT64 "all variables are of type Float64"
#define NO_OTHERS(name, type) NO_OTHERS_OF(name, type, ALL_OF_FLOAT64, , size_t values)
NO_OTHERS(Float32, fmi3Float32)
NO_OTHERS(Int8, int8_t)
NO_OTHERS(UInt8, uint8_t)
NO_OTHERS(Int16, int16_t)
NO_OTHERS(UInt16, uint16_t)
NO_OTHERS(Int32, int32_t)
NO_OTHERS(UInt32, uint32_t)
NO_OTHERS(Int64, int64_t)
NO_OTHERS(UInt64, uint64_t)
NO_OTHERS(Boolean, fmi3Boolean)
NO_OTHERS(String, fmi3String)

/* functions for what there is not: clocks, binary values, configuration, derivatives of variables by others */
#define REFERENCES fmi3Instance instance, const fmi3ValueReference a[], size_t b
#define NO_CLOCKS "there are no clocks"
ABSENT(GetBinary, ALL_OF_FLOAT64, (REFERENCES, size_t c[], fmi3Binary d[], size_t e))
ABSENT(SetBinary, ALL_OF_FLOAT64, (REFERENCES, const size_t c[], const fmi3Binary d[], size_t e))
ABSENT(GetClock, NO_CLOCKS, (REFERENCES, fmi3Clock c[]))
ABSENT(SetClock, NO_CLOCKS, (REFERENCES, const fmi3Clock c[]))
ABSENT(GetIntervalDecimal, NO_CLOCKS, (REFERENCES, fmi3Float64 c[], fmi3IntervalQualifier d[]))
ABSENT(GetIntervalFraction, NO_CLOCKS, (REFERENCES, uint64_t c[], uint64_t d[], fmi3IntervalQualifier e[]))
ABSENT(GetShiftDecimal, NO_CLOCKS, (REFERENCES, fmi3Float64 c[]))
ABSENT(GetShiftFraction, NO_CLOCKS, (REFERENCES, uint64_t c[], uint64_t d[]))
ABSENT(SetIntervalDecimal, NO_CLOCKS, (REFERENCES, const fmi3Float64 c[]))
ABSENT(SetIntervalFraction, NO_CLOCKS, (REFERENCES, const uint64_t c[], const uint64_t d[]))
ABSENT(SetShiftDecimal, NO_CLOCKS, (REFERENCES, const fmi3Float64 c[]))
ABSENT(SetShiftFraction, NO_CLOCKS, (REFERENCES, const uint64_t c[], const uint64_t d[]))
ABSENT(ActivateModelPartition, NO_CLOCKS, (fmi3Instance instance, fmi3ValueReference a, fmi3Float64 b))
ABSENT(GetNumberOfVariableDependencies, "no dependencies are known",
    (fmi3Instance instance, fmi3ValueReference a, size_t *b))
ABSENT(GetVariableDependencies, "no dependencies are known",
    (fmi3Instance instance, fmi3ValueReference a, size_t b[], fmi3ValueReference c[], size_t d[], fmi3DependencyKind e[],
    size_t f))
ABSENT(GetDirectionalDerivative, "there are no directional derivatives",
    (REFERENCES, const fmi3ValueReference c[], size_t d, const fmi3Float64 e[], size_t f, fmi3Float64 g[], size_t h))
ABSENT(GetAdjointDerivative, "there are no adjoint derivatives",
    (REFERENCES, const fmi3ValueReference c[], size_t d, const fmi3Float64 e[], size_t f, fmi3Float64 g[], size_t h))
ABSENT(GetOutputDerivatives, "there are no derivatives of outputs",
    (REFERENCES, const int32_t c[], fmi3Float64 d[], size_t e))
ABSENT(EnterConfigurationMode, "there are no structural parameters", (fmi3Instance instance))
ABSENT(ExitConfigurationMode, "there are no structural parameters", (fmi3Instance instance))
ABSENT(EvaluateDiscreteStates, "there are no discrete states", (fmi3Instance instance))
ABSENT(EnterStepMode, "there is no event mode in co-simulation", (fmi3Instance instance))

/* --- co-simulation --- */

EXPORT fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_return,
    fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    struct instance *c = instance;
    fmi3IntermediateUpdateCallback between;
    double left = step;

    if (unit_step_allowed(c, "fmi3DoStep", time, step) != fmi3OK)
        return fmi3Error;
    if (!event || !terminate || !early || !reached)
        return unsupported(c, "fmi3DoStep", "a place for its results is missing");
    between = (fmi3IntermediateUpdateCallback)c->between;
    *event = *terminate = *early = false;
    motor_begin(&c->kept.motor);
    while (left > 1e-12 * step && !*early) {
        double taken = motor_step(&c->kept.motor, left), wanted = 0.0;
        fmi3Boolean ends = false;
        if (taken < 0.0)
            return unit_unsolved(c, "fmi3DoStep");
        left -= taken;
        c->kept.time = left > 1e-12 * step ? time + step - left : time + step;
        if (!between)
            continue;
        motor_measure(&c->kept.motor);
        c->kept.measured = 1;
        between(c->environment, c->kept.time, false, true, true, c->early, &ends, &wanted);
        *early = c->early && ends && left > 1e-12 * step && wanted <= c->kept.time;
    }
    motor_measure(&c->kept.motor);
    c->kept.measured = 1;
    *reached = c->kept.time;
    return fmi3OK;
}

/* --- model exchange --- */

EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *needed, fmi3Boolean *terminate,
    fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *next_defined, fmi3Float64 *next)
{
    if (unit_exchange(instance, "fmi3UpdateDiscreteStates", 1) != fmi3OK)
        return fmi3Error;
    if (!needed || !terminate || !nominals || !values || !next_defined || !next)
        return unsupported(instance, "fmi3UpdateDiscreteStates", "a place for its results is missing");
    *needed = *terminate = *nominals = *values = *next_defined = false; /* there are no events */
    *next = 0.0;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *count)
{
    if (!instance || !count)
        return fmi3Error;
    *count = 0;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *count)
{
    if (!instance || !count)
        return fmi3Error;
    *count = STATES;
    return fmi3OK;
}
