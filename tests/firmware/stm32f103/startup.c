/* The vector table, and what comes before main.
 *
 * A fault, an interrupt that nobody asked for and the end of main stop the core, with a record of what it was, which a debugger and
 * scripts/mcu read; the rig shuts the valve of a controller that is silent.
 */
#include "memory.h"

#define MAIN_HAS_RETURNED 1U /* in place of an exception's number: that of reset */
#define FRAME_PC 6U          /* of the eight words that the core stacks */

int main(void);
void reset(void);
void stopped(void);
__attribute__((noreturn)) void stop(uint32_t exception, const uint32_t *frame);
void systick(void);

/* Number of the exception (DDI 0337: 3 HardFault, 16 the first interrupt) and where it came; zeros while all is well. */
volatile uint32_t fault_record[2];

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
    stop(MAIN_HAS_RETURNED, stack_end);
}

/* With the whole stack again, since an overflow of it is a fault too. */
__attribute__((naked)) void stopped(void)
{
    __asm__ volatile("mrs r0, ipsr\n"
                     "mov r1, sp\n"
                     "ldr r2, =stack_end\n"
                     "mov sp, r2\n"
                     "b stop\n");
}

void stop(uint32_t exception, const uint32_t *frame)
{
    /* What the core could not stack is not there to be read. */
    fault_record[1] = frame >= stack_begin && frame + FRAME_PC < stack_end ? frame[FRAME_PC] : 0U;
    fault_record[0] = exception;
    for (;;) {
        __asm__ volatile("wfi");
    }
}
