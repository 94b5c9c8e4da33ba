/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Calls the functions of a Functional Mock-up Unit in random order with random and with impossible arguments. The
 * sanitizers of the compiler end it at a fault. Arguments: seed and number of calls.
 */
#include "piezomotor_fmi2.c"

static void ignore(fmi2ComponentEnvironment a, fmi2String b, fmi2Status c, fmi2String d, fmi2String e, ...)
{
    (void)a, (void)b, (void)c, (void)d, (void)e;
}

static int one_in(int n) { return rand() % n == 0; }

static double number(void)
{
    static const double some[] = {0, -1, 1, 1e-3, NAN, INFINITY, -INFINITY, 1e308, -1e308, 1e-308, 40100, 1e5, 110};
    return some[rand() % (int)(sizeof some / sizeof *some)];
}

static fmi2Component created(void)
{
    static const fmi2CallbackFunctions callbacks = {.logger = ignore};
    return fmi2Instantiate(one_in(20) ? NULL : "motor", one_in(20) ? fmi2ModelExchange : fmi2CoSimulation,
        one_in(20) ? "0" : GUID, "", one_in(20) ? NULL : &callbacks, 0, 0);
}

int main(int count, char **words)
{
    if (count != 3)
        return 2;
    srand((unsigned)atoi(words[1]));
    fmi2Component c = NULL;
    fmi2FMUstate state = NULL;
    static fmi2Byte bytes[sizeof(struct kept)];
    double time = 0.0;
    long succeeded = 0;

    for (long n = 0; n < atol(words[2]); n++) {
        if (!c)
            c = created();
        fmi2Component used = one_in(50) ? NULL : c;
        fmi2ValueReference reference[4];
        double value[4];
        int flag;
        size_t items = (size_t)(rand() % 5), size;
        fmi2Status status = fmi2Error;
        for (int i = 0; i < 4; i++) {
            reference[i] = (unsigned)(rand() % (COUNT + 3));
            value[i] = number();
        }
        double step = one_in(3) ? fmin(number(), 1e-3) : 1e-5 * (1 + rand() % 5);
        switch (rand() % 20) {
        case 0: status = fmi2SetupExperiment(used, 0, number(), one_in(2) ? 0 : number(), one_in(2), number()); break;
        case 1: status = fmi2EnterInitializationMode(used); break;
        case 2: status = fmi2ExitInitializationMode(used); break;
        case 3: case 4: case 5: status = fmi2SetReal(used, one_in(20) ? NULL : reference, items, value); break;
        case 6: case 7: status = fmi2GetReal(used, reference, items, one_in(20) ? NULL : value); break;
        case 8: case 9: case 10: case 11:
            status = fmi2DoStep(used, one_in(5) ? number() : time, step, 1);
            time += status == fmi2OK ? step : 0.0;
            break;
        case 12: status = fmi2Reset(used); time = 0.0; break;
        case 13: status = fmi2Terminate(used); break;
        case 14: status = fmi2GetFMUstate(used, one_in(9) ? NULL : &state); break;
        case 15: status = fmi2SetFMUstate(used, state); break;
        case 16: status = fmi2FreeFMUstate(used, &state); break;
        case 17: status = fmi2SerializeFMUstate(used, state, bytes, one_in(2) ? 3 : sizeof bytes); break;
        case 18:
            if (one_in(2))
                bytes[rand() % (int)sizeof bytes] = (fmi2Byte)rand();
            status = fmi2DeSerializeFMUstate(used, bytes, one_in(4) ? 4 : sizeof bytes, &state);
            break;
        case 19:
            fmi2GetBoolean(used, reference, items, &flag);
            fmi2GetRealStatus(used, fmi2LastSuccessfulTime, value);
            fmi2SerializedFMUstateSize(used, state, &size);
            fmi2CancelStep(used);
            if (one_in(10)) {
                free(state);
                fmi2FreeInstance(c);
                state = c = NULL;
            }
        }
        succeeded += status == fmi2OK;
    }
    free(state);
    fmi2FreeInstance(c);
    printf("%ld\n", succeeded);
    return 0;
}
