/* SPDX-License-Identifier: MIT
 *
 * Reset of a Cortex-M4 with a floating-point unit, for the C library's start with semihosting.
 */
#include <stdint.h>

extern uint32_t stack_top[];
void _start(void);

static void reset(void)
{
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* access to the floating-point unit */
    __asm__ volatile("dsb\n\tisb");
    _start();
}

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {stack_top, (const void *)reset};
