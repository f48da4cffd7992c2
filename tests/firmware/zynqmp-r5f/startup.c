/* The vectors, and what comes before main.
 *
 * A fault and the end of main stop the core: a debugger or an emulator with semihosting is told why, and ends the program; without
 * either the core stands still. The rig shuts the valve of a controller that is silent.
 */
#include "memory.h"

#define SYS_WRITE0 0x04U
#define SYS_EXIT_EXTENDED 0x20U
#define APPLICATION_EXIT 0x20026U
#define EXIT_CODE 3U /* protocol/src/exit.rs: the bus or a partner failed */

int main(void);
void prepare(void);
void fault(uint32_t vector, uint32_t address);

/* Address 0. A fault's handler runs in ARM state, in the fault's own mode: it takes the stack, which nobody needs any more. */
__attribute__((section(".vectors"), naked, used, target("arm"))) void vectors(void)
{
    __asm__ volatile("b reset\n"
                     "b undefined\n"
                     "b stand\n" /* a supervisor call is one of semihosting that nobody answers */
                     "b prefetch\n"
                     "b data\n"
                     "b stand\n"
                     "b stand\n"
                     "b stand\n"
                     "undefined: sub r1, lr, #4\n"
                     "mov r0, #1\n"
                     "b tell\n"
                     "prefetch: sub r1, lr, #4\n"
                     "mov r0, #3\n"
                     "b tell\n"
                     "data: sub r1, lr, #8\n"
                     "mov r0, #4\n"
                     "tell: ldr sp, =stack_end\n"
                     "ldr r2, =fault\n"
                     "blx r2\n"
                     "stand: wfi\n"
                     "b stand\n"
                     ".ltorg\n");
}

/* The vectors to address 0, single precision on, the stack. */
__attribute__((naked, used, target("arm"))) void reset(void)
{
    __asm__ volatile("mrc p15, 0, r0, c1, c0, 0\n"
                     "bic r0, r0, #0x2000\n" /* SCTLR.V */
                     "mcr p15, 0, r0, c1, c0, 0\n"
                     "mrc p15, 0, r0, c1, c0, 2\n"
                     "orr r0, r0, #0xF00000\n" /* CPACR: coprocessors 10 and 11 */
                     "mcr p15, 0, r0, c1, c0, 2\n"
                     "isb\n"
                     "mov r0, #0x40000000\n" /* FPEXC.EN */
                     "vmsr fpexc, r0\n"
                     "ldr sp, =stack_end\n"
                     "ldr r0, =prepare\n"
                     "blx r0\n"
                     "b stand\n"
                     ".ltorg\n");
}

static void semihost(uint32_t operation, const void *parameter)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = parameter;
    __asm__ volatile("svc 0xAB" : "+r"(r0) : "r"(r1) : "memory", "lr");
}

static void leave(const char *why, const char *where)
{
    static const uint32_t EXIT[] = {APPLICATION_EXIT, EXIT_CODE};
    semihost(SYS_WRITE0, "firmware: ");
    semihost(SYS_WRITE0, why);
    semihost(SYS_WRITE0, where);
    semihost(SYS_EXIT_EXTENDED, EXIT);
}

void prepare(void)
{
    memory_init();
    (void)main();
    leave("main has returned", "\n");
}

void fault(uint32_t vector, uint32_t address)
{
    static const char *const NAMES[] = {"", "undefined instruction", "", "prefetch abort", "data abort"};
    char where[] = " at 0x00000000\n";
    for (uint32_t digit = 13U; digit > 5U; digit--, address >>= 4) {
        where[digit] = "0123456789ABCDEF"[address & 0xFU];
    }
    leave(NAMES[vector], where);
}
