#include "memory.h"

#define STACK_PATTERN 0xA5A5A5A5U

void memory_init(void)
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
}
