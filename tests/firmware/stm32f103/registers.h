/* The registers of the STM32F103 that this port uses (RM0008; SysTick: PM0056). */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

/* Clocks. */
#define RCC_CR REGISTER(0x40021000U)
#define RCC_CR_HSEON (1U << 16)
#define RCC_CR_HSERDY (1U << 17)
#define RCC_CFGR REGISTER(0x40021004U)
#define RCC_CFGR_SW_HSE 1U
#define RCC_CFGR_SWS_MASK (3U << 2)
#define RCC_CFGR_SWS_HSE (1U << 2)
#define RCC_APB2ENR REGISTER(0x40021018U)
#define RCC_APB2ENR_IOPAEN (1U << 2)
#define RCC_APB1ENR REGISTER(0x4002101CU)
#define RCC_APB1ENR_CAN1EN (1U << 25)

/* Pins: four bits each, PA8 to PA15 in CRH. */
#define GPIOA_CRH REGISTER(0x40010804U)

/* The core's timer. */
#define SYSTICK_CTRL REGISTER(0xE000E010U)
#define SYSTICK_LOAD REGISTER(0xE000E014U)
#define SYSTICK_VAL REGISTER(0xE000E018U)
#define SYSTICK_CTRL_ENABLE 1U
#define SYSTICK_CTRL_TICKINT 2U
#define SYSTICK_CTRL_CORE_CLOCK 4U

/* The CAN controller. */
#ifndef CAN_BASE
#define CAN_BASE 0x40006400U
#endif
#define CAN_MCR REGISTER(CAN_BASE)
#define CAN_MCR_INRQ (1U << 0)
#define CAN_MCR_SLEEP (1U << 1)
#define CAN_MCR_TXFP (1U << 2)
#define CAN_MCR_ABOM (1U << 6)
#define CAN_MSR REGISTER(CAN_BASE + 0x004U)
#define CAN_MSR_INAK (1U << 0)
#define CAN_MSR_SLAK (1U << 1)
#define CAN_TSR REGISTER(CAN_BASE + 0x008U)
#define CAN_TSR_ABRQ(mailbox) (1U << (7U + 8U * (mailbox)))
#define CAN_TSR_TME(mailbox) (1U << (26U + (mailbox)))
#define CAN_RF0R REGISTER(CAN_BASE + 0x00CU)
#define CAN_RF0R_FMP (3U << 0)
#define CAN_RF0R_FOVR (1U << 4)
#define CAN_RF0R_RFOM (1U << 5)
#define CAN_ESR REGISTER(CAN_BASE + 0x018U)
#define CAN_BTR REGISTER(CAN_BASE + 0x01CU)
#define CAN_MAILBOXES 3U
#define CAN_TIR(mailbox) REGISTER(CAN_BASE + 0x180U + 0x10U * (mailbox))
#define CAN_TDTR(mailbox) REGISTER(CAN_BASE + 0x184U + 0x10U * (mailbox))
#define CAN_TDLR(mailbox) REGISTER(CAN_BASE + 0x188U + 0x10U * (mailbox))
#define CAN_TDHR(mailbox) REGISTER(CAN_BASE + 0x18CU + 0x10U * (mailbox))
#define CAN_TIR_TXRQ (1U << 0)
#define CAN_RI0R REGISTER(CAN_BASE + 0x1B0U)
#define CAN_RDT0R REGISTER(CAN_BASE + 0x1B4U)
#define CAN_RDL0R REGISTER(CAN_BASE + 0x1B8U)
#define CAN_RDH0R REGISTER(CAN_BASE + 0x1BCU)
#define CAN_STID_SHIFT 21U
#define CAN_IDE (1U << 2)
#define CAN_RTR (1U << 1)
#define CAN_FMR REGISTER(CAN_BASE + 0x200U)
#define CAN_FMR_FINIT (1U << 0)
#define CAN_FM1R REGISTER(CAN_BASE + 0x204U)
#define CAN_FS1R REGISTER(CAN_BASE + 0x20CU)
#define CAN_FFA1R REGISTER(CAN_BASE + 0x214U)
#define CAN_FA1R REGISTER(CAN_BASE + 0x21CU)
#define CAN_FILTER(bank, half) REGISTER(CAN_BASE + 0x240U + 8U * (bank) + 4U * (half))

#endif
