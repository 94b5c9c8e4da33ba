/* SPDX-License-Identifier: MIT
 *
 * Run firmware on recorded samples, on a host or on a microcontroller with semihosting.
 *
 * replay.in holds floats: the sample time, the first commands, then one struct firmware_in for each sample. replay.out
 * takes one struct firmware_out and the logged values for each. On a Cortex-M the number of instructions of a step is
 * printed; it is counted by the system timer of qemu, for which every instruction takes the same time.
 */
#include <stdint.h>
#include <stdio.h>

#include "piezomotor_firmware.h"

#define MOST_LOGS 64

#ifdef __arm__
/* the system timer counts down at 25 MHz; qemu -icount shift=10 takes 1024 ns for an instruction */
#define TICKS_PER_INSTRUCTION 25.6
#define SYSTICK ((volatile uint32_t *)0xE000E010)
static void start_timer(void) { SYSTICK[1] = 0xFFFFFF, SYSTICK[2] = 0, SYSTICK[0] = 5; }
static uint32_t timer(void) { return SYSTICK[2]; }
#else
static void start_timer(void) {}
static uint32_t timer(void) { return 0; }
#endif

static uint32_t since(uint32_t begun) { return (begun - timer()) & 0xFFFFFF; }

int main(void)
{
    FILE *source = fopen("replay.in", "rb"), *target = fopen("replay.out", "wb");
    struct firmware_in in;
    struct firmware_out out;
    float sample_time, logged[MOST_LOGS];
    uint32_t empty, most = 0;
    double total = 0.0;
    int count = 0;

    if (!source || !target || firmware_logs > MOST_LOGS || fread(&sample_time, sizeof sample_time, 1, source) != 1 ||
        fread(&out, sizeof out, 1, source) != 1) {
        fprintf(stderr, "replay.in cannot be read, or replay.out written\n");
        return 1;
    }
    start_timer();
    empty = timer();
    empty = since(empty); /* of reading the timer */
    firmware_init(sample_time, &out);
    while (fread(&in, sizeof in, 1, source) == 1) {
        uint32_t begun = timer();
        firmware_step(&in, &out);
        uint32_t taken = since(begun) - empty;
        most = taken > most ? taken : most;
        total += taken;
        count++;
        firmware_log(logged);
        if (fwrite(&out, sizeof out, 1, target) != 1 ||
            fwrite(logged, sizeof *logged, (size_t)firmware_logs, target) != (size_t)firmware_logs)
            return 1;
    }
#ifdef __arm__
    printf("samples %d instructions_mean %.1f instructions_most %.0f\n", count, total / count / TICKS_PER_INSTRUCTION,
        most / TICKS_PER_INSTRUCTION);
#else
    printf("samples %d\n", count);
#endif
    return fclose(target) || fclose(source);
}
