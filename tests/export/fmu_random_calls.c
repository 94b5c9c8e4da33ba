/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Calls the functions of a Functional Mock-up Unit in random order with random and with impossible arguments. The
 * sanitizers of the compiler end it at a fault. Arguments: seed and number of calls. -DVERSION=2 or 3 is that of FMI. It
 * prints how many calls and how many steps succeeded.
 */
#if VERSION == 3
#include "piezomotor_fmi3.c"
#else
#include "piezomotor_fmi2.c"
#endif

static int one_in(int n) { return rand() % n == 0; }

static double number(void)
{
    static const double some[] = {0, -1, 1, 1e-3, NAN, INFINITY, -INFINITY, 1e308, -1e308, 1e-308, 40100, 1e5, 110};
    return some[rand() % (int)(sizeof some / sizeof *some)];
}

/* The calls that differ between the versions: a new instance, the way to initialization, access to values, a step. */
#if VERSION == 3

static void ignore(void *a, fmi3Status b, const char *c, const char *d) { (void)a, (void)b, (void)c, (void)d; }

static void *instance; /* of the step that is running */

static void between(void *a, double time, bool b, bool c, bool d, bool may_end, bool *ends, double *until)
{
    const unsigned reference = (unsigned)(rand() % (COUNT + 3));
    double value;

    (void)a, (void)b, (void)c, (void)d;
    fmi3GetFloat64(instance, &reference, 1, &value, 1);
    *ends = may_end && one_in(5);
    *until = time;
}

static void *some_instance(void)
{
    const char *name = one_in(20) ? NULL : "motor", *token = one_in(20) ? "0" : GUID;
    if (one_in(20))
        return fmi3InstantiateScheduledExecution(name, token, "", 0, 0, NULL, one_in(2) ? ignore : NULL, NULL, NULL, NULL);
    if (one_in(20))
        return fmi3InstantiateModelExchange(name, token, "", 0, 0, NULL, one_in(2) ? ignore : NULL);
    return fmi3InstantiateCoSimulation(name, token, "", 0, 0, 0, one_in(2), NULL, 0, NULL, one_in(2) ? ignore : NULL,
        one_in(2) ? between : NULL);
}

static fmi3Status initialize(void *c, double start, int stop_defined, double stop)
{
    return fmi3EnterInitializationMode(c, 0, 0.0, start, stop_defined, stop);
}

static fmi3Status set(void *c, const unsigned reference[], size_t count, const double value[])
{
    return fmi3SetFloat64(c, reference, count, value, one_in(20) ? count + 1 : count);
}

static fmi3Status get(void *c, const unsigned reference[], size_t count, double value[])
{
    return fmi3GetFloat64(c, reference, count, value, one_in(20) ? count + 1 : count);
}

static fmi3Status advance(void *c, double time, double step, double *reached)
{
    bool event, terminate, early;

    instance = c;
    return fmi3DoStep(c, time, step, true, &event, one_in(50) ? NULL : &terminate, &early, reached);
}

static void try_others(void *c, const unsigned reference[], size_t count)
{
    bool value[4], flag[5];
    size_t number;
    double next;

    fmi3GetBoolean(c, reference, count, value, count);
    fmi3GetNumberOfContinuousStates(c, one_in(9) ? NULL : &number);
    fmi3GetNumberOfEventIndicators(c, one_in(9) ? NULL : &number);
    fmi3UpdateDiscreteStates(c, flag, flag + 1, flag + 2, flag + 3, flag + 4, one_in(9) ? NULL : &next);
    fmi3EnterStepMode(c);
}

#else

static void ignore(void *a, const char *b, fmi2Status c, const char *d, const char *e, ...)
{
    (void)a, (void)b, (void)c, (void)d, (void)e;
}

static void *some_instance(void)
{
    static const fmi2CallbackFunctions callbacks = {.logger = ignore};
    return fmi2Instantiate(one_in(20) ? NULL : "motor", one_in(20) ? fmi2ModelExchange : fmi2CoSimulation,
        one_in(20) ? "0" : GUID, "", one_in(20) ? NULL : &callbacks, 0, 0);
}

static fmi2Status initialize(void *c, double start, int stop_defined, double stop)
{
    if (one_in(2))
        return fmi2SetupExperiment(c, 0, 0.0, start, stop_defined, stop);
    return fmi2EnterInitializationMode(c);
}

static fmi2Status set(void *c, const unsigned reference[], size_t count, const double value[])
{
    return fmi2SetReal(c, reference, count, value);
}

static fmi2Status get(void *c, const unsigned reference[], size_t count, double value[])
{
    return fmi2GetReal(c, reference, count, value);
}

static fmi2Status advance(void *c, double time, double step, double *reached)
{
    *reached = time + step;
    return fmi2DoStep(c, time, step, 1);
}

static void try_others(void *c, const unsigned reference[], size_t count)
{
    fmi2Boolean flag[4];
    fmi2EventInfo info;
    double value;

    fmi2GetBoolean(c, reference, count, flag);
    fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &value);
    fmi2NewDiscreteStates(c, one_in(9) ? NULL : &info);
    fmi2CancelStep(c);
}

#endif

/* Set or get the states of a motor in model exchange, or their rates. */
static FMI(Status) exchange(void *c)
{
    static double values[STATES + 1];
    size_t count = STATES + (size_t)one_in(20);
    FMI(Boolean) enter, terminate;

    switch (rand() % 6) {
    case 0: return FMI(SetTime)(c, number());
    case 1: return FMI(GetContinuousStates)(c, one_in(20) ? NULL : values, count);
    case 2:
        if (one_in(4))
            values[rand() % STATES] = number();
        return FMI(SetContinuousStates)(c, values, count);
    case 3: return GET_RATES(c, values, count);
    case 4: return FMI(CompletedIntegratorStep)(c, 0, &enter, one_in(9) ? NULL : &terminate);
    default: return FMI(GetNominalsOfContinuousStates)(c, values, count);
    }
}

/* Start a run at 0 s, as an importing program does. */
static void start(void *c)
{
#if VERSION == 3
    fmi3EnterInitializationMode(c, 0, 0.0, 0.0, 0, 0.0);
#else
    fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0);
    fmi2EnterInitializationMode(c);
#endif
    FMI(ExitInitializationMode)(c);
}

int main(int count, char **words)
{
    if (count != 3)
        return 2;
    srand((unsigned)atoi(words[1]));
    void *c = NULL, *state = NULL;
    static FMI(Byte) bytes[sizeof(struct kept)];
    double time = 0.0, reached;
    long succeeded = 0, steps = 0;

    for (long n = 0; n < atol(words[2]); n++) {
        if (!c)
            c = some_instance();
        void *used = one_in(50) ? NULL : c;
        unsigned reference[4];
        double value[4];
        size_t items = (size_t)(rand() % 5), size;
        FMI(Status) status = FMI(Error);
        for (int i = 0; i < 4; i++) {
            reference[i] = (unsigned)(rand() % (COUNT + 3));
            value[i] = number();
        }
        double step = one_in(3) ? fmin(number(), 1e-3) : 1e-5 * (1 + rand() % 5);
        if (c && one_in(15) && FMI(Reset)(c) == FMI(OK)) { /* random calls alone seldom start a run */
            time = 0.0;
            start(c);
        }
        switch (rand() % 21) {
        case 0: case 1: status = initialize(used, one_in(2) ? 0 : number(), one_in(2), number()); break;
        case 2: status = FMI(ExitInitializationMode)(used); break;
        case 3: case 4: case 5: status = set(used, one_in(20) ? NULL : reference, items, value); break;
        case 6: case 7: status = get(used, reference, items, one_in(20) ? NULL : value); break;
        case 8: case 9: case 10: case 11:
            status = advance(used, one_in(5) ? number() : time, step, &reached);
            time = status == FMI(OK) ? reached : time;
            steps += status == FMI(OK);
            break;
        case 12: status = FMI(Reset)(used); time = 0.0; break;
        case 13: status = FMI(Terminate)(used); break;
        case 14: status = GET_STATE(used, one_in(9) ? NULL : &state); break;
        case 15: status = SET_STATE(used, state); break;
        case 16: status = FREE_STATE(used, &state); break;
        case 17: status = STATE_TO_BYTES(used, state, bytes, one_in(2) ? 3 : sizeof bytes); break;
        case 18:
            if (one_in(2))
                bytes[rand() % (int)sizeof bytes] = (FMI(Byte))rand();
            status = STATE_FROM_BYTES(used, bytes, one_in(4) ? 4 : sizeof bytes, &state);
            break;
        case 19: status = exchange(used); break;
        case 20:
            try_others(used, reference, items);
            STATE_SIZE(used, state, &size);
            if (one_in(10)) {
                free(state);
                FMI(FreeInstance)(c);
                state = c = NULL;
            }
        }
        succeeded += status == FMI(OK);
    }
    free(state);
    FMI(FreeInstance)(c);
    printf("%ld %ld\n", succeeded, steps);
    return 0;
}
