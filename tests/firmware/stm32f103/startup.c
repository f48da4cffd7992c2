/* The vector table, and what comes before main: data from flash, zeros, a known pattern in the stack.
 *
 * A fault or an interrupt that nobody asked for stops the core; the rig shuts the valve of a controller that is silent.
 */
#include <stddef.h>
#include <stdint.h>

#define STACK_PATTERN 0xA5A5A5A5U

/* Of the linker script. */
extern uint32_t data_in_flash[], data_begin[], data_end[], bss_begin[], bss_end[], stack_begin[], stack_free[], stack_end[];

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
    for (volatile uint32_t *word = stack_begin; word < stack_free; word++) {
        *word = STACK_PATTERN;
    }
    const uint32_t *from = data_in_flash;
    for (volatile uint32_t *to = data_begin; to < data_end; to++) {
        *to = *from++;
    }
    for (volatile uint32_t *word = bss_begin; word < bss_end; word++) {
        *word = 0U;
    }
    (void)main();
    stopped();
}

void stopped(void)
{
    for (;;) {
        __asm__ volatile("wfi");
    }
}
