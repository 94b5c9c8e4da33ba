/* SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Runs a Functional Mock-up Unit of FMI 3.0 on Windows: DLL, token, value reference, number of steps of 1 ms. Prints the
 * variable after each.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <windows.h>

static void say(void *environment, int status, const char *category, const char *message)
{
    (void)environment, (void)category;
    fprintf(stderr, "%d %s\n", status, message);
}

typedef void *instantiate(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t, void *,
    void (*)(void *, int, const char *, const char *), void *);
typedef int enter(void *, bool, double, double, bool, double), leave(void *);
typedef int step(void *, double, double, bool, bool *, bool *, bool *, double *);
typedef int get(void *, const uint32_t *, size_t, double *, size_t);

#define FIND(type, name) type *name = (type *)(void (*)(void))GetProcAddress(library, "fmi3" #name)

int main(int count, char **words)
{
    HMODULE library = count == 5 ? LoadLibraryA(words[1]) : NULL;
    if (!library)
        return 2;
    FIND(instantiate, InstantiateCoSimulation);
    FIND(enter, EnterInitializationMode);
    FIND(leave, ExitInitializationMode);
    FIND(step, DoStep);
    FIND(get, GetFloat64);
    void *unit = InstantiateCoSimulation("motor", words[2], NULL, false, false, false, false, NULL, 0, NULL, say, NULL);
    uint32_t reference = (uint32_t)atoi(words[3]);
    bool event, terminate, early;
    double reached = 0.0, value;

    if (!unit || EnterInitializationMode(unit, false, 0.0, 0.0, false, 0.0) || ExitInitializationMode(unit))
        return 3;
    for (int n = 0; n < atoi(words[4]); n++) {
        if (DoStep(unit, reached, 1e-3, false, &event, &terminate, &early, &reached) ||
            GetFloat64(unit, &reference, 1, &value, 1))
            return 4;
        printf("%.17g\n", value);
    }
    return 0;
}
