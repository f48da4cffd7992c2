/* What the boards' linker scripts say, and what comes before main of every board. */
#ifndef MEMORY_H
#define MEMORY_H

#include <stdint.h>

/* Of the linker script. */
extern uint32_t data_in_flash[], data_begin[], data_end[], bss_begin[], bss_end[], stack_begin[], stack_free[], stack_end[];

/* Data from flash, zeros, and a known pattern in the stack below its first 64 bytes, in which the caller stands. */
void memory_init(void);

#endif
