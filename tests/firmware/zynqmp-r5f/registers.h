/* The registers of the Zynq UltraScale+ that this port uses (UG1085 and UG1087; the core's: ARM DDI 0460, DDI 0406).
 *
 * With QEMU_MODEL those of QEMU's xlnx-zcu102, where they differ from the chip's (docs/qemu.md).
 */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdbool.h>
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

/* CAN 0. */
#define CAN_BASE 0xFF060000U
#define CAN_SRR REGISTER(CAN_BASE + 0x000U)
#define CAN_SRR_SRST (1U << 0)
#define CAN_SRR_CEN (1U << 1)
#define CAN_MSR REGISTER(CAN_BASE + 0x004U)
#define CAN_BRPR REGISTER(CAN_BASE + 0x008U)
#define CAN_BTR REGISTER(CAN_BASE + 0x00CU)
#define CAN_SR REGISTER(CAN_BASE + 0x018U)
#define CAN_SR_CONFIG (1U << 0)
#define CAN_SR_NORMAL (1U << 3)
#define CAN_SR_TXFLL (1U << 10)
#define CAN_ISR REGISTER(CAN_BASE + 0x01CU)
#define CAN_ISR_RXNEMP (1U << 7)
#define CAN_ISR_RXFWMFLL (1U << 12)
#define CAN_IER REGISTER(CAN_BASE + 0x020U)
#define CAN_ICR REGISTER(CAN_BASE + 0x024U)
#define CAN_WIR REGISTER(CAN_BASE + 0x02CU)
#define CAN_TXFIFO_ID REGISTER(CAN_BASE + 0x030U)
#define CAN_TXFIFO_DLC REGISTER(CAN_BASE + 0x034U)
#define CAN_TXFIFO_DATA1 REGISTER(CAN_BASE + 0x038U)
#define CAN_TXFIFO_DATA2 REGISTER(CAN_BASE + 0x03CU)
#define CAN_RXFIFO (CAN_BASE + 0x050U) /* identifier, length, data, data */
#define CAN_AFR REGISTER(CAN_BASE + 0x060U)
#define CAN_AFMR(filter) REGISTER(CAN_BASE + 0x064U + 8U * (filter))
#define CAN_AFIR(filter) REGISTER(CAN_BASE + 0x068U + 8U * (filter))
#define CAN_DLC_SHIFT 28U

#ifdef QEMU_MODEL
/* An identifier is a can_id of SocketCAN, and the first byte of the data is the lowest of its register. */
#define CAN_ID(id) (id)
#define CAN_ID_OF(word) ((word) & 0x7FFU)
#define CAN_ID_NOT_PLAIN 0xE0000000U /* extended, remote, error */
#define CAN_ID_MASK 0xE00007FFU
#define CAN_DATA(little_endian) (little_endian)
#define CAN_BREAKS_WHEN_FULL true /* a frame for a full FIFO of which not all four words are read ends QEMU */
#define CORE_HZ 1000000000U
#define CORE_CLOCK_IS_THE_HOSTS true
#else
#define CAN_ID(id) ((id) << 21)
#define CAN_ID_OF(word) ((word) >> 21)
#define CAN_ID_NOT_PLAIN (3U << 19) /* remote, extended */
#define CAN_ID_MASK (0x7FFU << 21 | CAN_ID_NOT_PLAIN)
#define CAN_DATA(little_endian) __builtin_bswap32(little_endian)
#define CAN_BREAKS_WHEN_FULL false
#define CORE_HZ 500000000U
#define CORE_CLOCK_IS_THE_HOSTS false
#endif

/* Timer 0 of triple timer counter 0. */
#define TTC_CLOCK REGISTER(0xFF110000U)
#define TTC_CLOCK_BY_1024 (9U << 1 | 1U)
#define TTC_CONTROL REGISTER(0xFF11000CU)
#define TTC_CONTROL_RESET (1U << 4) /* and nothing that stops it */
#define TTC_VALUE REGISTER(0xFF110018U)

/* The cycle counter of the core's performance monitor, a count for each 64 clocks. */
#define CLOCKS_A_COUNT 64U
#define PMCR_E (1U << 0)
#define PMCR_C (1U << 2)
#define PMCR_D (1U << 3)
#define PMCNTENSET_C (1U << 31)

static inline void start_cycle_counter(void)
{
    __asm__ volatile("mcr p15, 0, %0, c9, c12, 1" : : "r"(PMCNTENSET_C));
    __asm__ volatile("mcr p15, 0, %0, c9, c12, 0" : : "r"(PMCR_E | PMCR_C | PMCR_D));
}

static inline uint32_t cycle_counter(void)
{
    uint32_t count;
    __asm__ volatile("mrc p15, 0, %0, c9, c13, 0" : "=r"(count));
    return count;
}

#endif
