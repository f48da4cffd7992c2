/* The vector table, and what comes before main.
 *
 * A fault or an interrupt that nobody asked for stops the core; the rig shuts the valve of a controller that is silent.
 */
#include "memory.h"

int main(void);
void reset(void);
void stopped(void);
void systick(void);

#define EXCEPTIONS 16
#define INTERRUPTS 43 /* of a medium-density device */

/* Address 0: the stack, then the handlers of the core (1 to 15) and of the chip. */
__attribute__((section(".vectors"), used)) static void (*const vectors[EXCEPTIONS + INTERRUPTS])(void) = {
    [0] = (void (*)(void))stack_end,
    [1] = reset,
    [2 ... 14] = stopped,
    [15] = systick,
    [EXCEPTIONS ... EXCEPTIONS + INTERRUPTS - 1] = stopped,
};

void reset(void)
{
    memory_init();
    (void)main();
    stopped();
}

void stopped(void)
{
    for (;;) {
        __asm__ volatile("wfi");
    }
}
