/* The port for an STM32F103: bxCAN at 1 Mbit/s, SysTick each millisecond, both from a crystal of 8 MHz without the PLL.
 *
 * 8 MHz are enough (docs/elf.md has the cycles), need no wait states of the flash, and divide into 8 quanta a bit, sampled at
 * 75 %: at 87.5 %, with one quantum after the sample, an emulator takes the timing for invalid and sends nothing. The RC
 * oscillator would do as well but for its tolerance of 1 %, which CAN at this rate does not allow.
 *
 * CAN on PA11 and PA12. Frames wait in FIFO 0, which holds three: the filters let in only what the firmware takes. It is polled
 * while the core has nothing else to do: the interrupt of the FIFO is not needed for that, and one emulator does not have it.
 */
#include "port.h"

#include "registers.h"
#include "rig.h"

#include <string.h>

#define CORE_HZ 8000000U
#define TICKS_A_MILLISECOND (CORE_HZ / 1000U)
#define SPINS_FOR_A_CRYSTAL 100000U /* some 0.1 s; a crystal takes 2 ms */
#define QUEUE_FRAMES 8U
#define PAUSE_TURNS 16U /* some 8 us between two looks at the FIFO, where 100 us pass from frame to frame */

void systick(void);

static volatile uint32_t milliseconds;
static bool up;

/* Frames for which no mailbox was empty, oldest first. */
static struct {
    struct port_frame frames[QUEUE_FRAMES];
    uint32_t first;
    uint32_t count;
} queue;

void systick(void)
{
    milliseconds++;
}

static bool wait_for(volatile const uint32_t *what, uint32_t mask, uint32_t value)
{
    for (uint32_t spins = 0; spins < SPINS_FOR_A_CRYSTAL; spins++) {
        if ((*what & mask) == value) {
            return true;
        }
    }
    return false;
}

static bool start_clock(void)
{
    RCC_CR |= RCC_CR_HSEON;
    if (!wait_for(&RCC_CR, RCC_CR_HSERDY, RCC_CR_HSERDY)) {
        return false;
    }
    RCC_CFGR = RCC_CFGR_SW_HSE; /* no prescaler, for no bus */
    return wait_for(&RCC_CFGR, RCC_CFGR_SWS_MASK, RCC_CFGR_SWS_HSE);
}

/* One identifier of 11 bits in a half of a bank of two masks: all bits count, and so do IDE and RTR, which have to be zero. */
static void let_in(uint32_t position, uint32_t id)
{
    const uint32_t whole = (id << CAN_STID_SHIFT);
    CAN_FILTER(position / 2U, position % 2U) = whole;
}

static bool start_can(void)
{
    static const uint16_t TAKEN[] = {
        RIG_DRIVE_SENSORS_FRAME_ID,          RIG_TICK_FRAME_ID,           RIG_RIG_STATUS_FRAME_ID,
        RIG_CONSOLE_EMERGENCY_STOP_FRAME_ID, RIG_RIG_EMERGENCY_STOP_FRAME_ID,
        RIG_LOAD_EMERGENCY_STOP_FRAME_ID,    RIG_RUN_CONTROL_FRAME_ID,
    };
    const uint32_t taken = sizeof TAKEN / sizeof *TAKEN;
    const uint32_t banks = (1U << ((taken + 1U) / 2U)) - 1U;

    RCC_APB2ENR |= RCC_APB2ENR_IOPAEN;
    RCC_APB1ENR |= RCC_APB1ENR_CAN1EN;
    /* PA11 an input that floats, PA12 driven by the controller. */
    GPIOA_CRH = (GPIOA_CRH & ~0x000FF000U) | 0x000B4000U;

    /* Out of sleep, into initialisation; after bus-off the controller comes back by itself, and mailboxes go in order. */
    CAN_MCR = CAN_MCR_INRQ | CAN_MCR_TXFP | CAN_MCR_ABOM;
    if (!wait_for(&CAN_MSR, CAN_MSR_INAK | CAN_MSR_SLAK, CAN_MSR_INAK)) {
        return false;
    }
    CAN_BTR = ((2U - 1U) << 20) | ((5U - 1U) << 16) | (1U - 1U); /* 1 + 5 + 2 quanta of 125 ns */

    CAN_FMR |= CAN_FMR_FINIT;
    CAN_FA1R = 0U;
    CAN_FM1R |= banks; /* lists of identifiers */
    CAN_FS1R |= banks; /* two of 32 bits in each bank */
    CAN_FFA1R &= ~banks; /* FIFO 0 */
    for (uint32_t i = 0; i < taken + taken % 2U; i++) {
        let_in(i, TAKEN[i < taken ? i : 0U]);
    }
    CAN_FA1R = banks;
    CAN_FMR &= ~CAN_FMR_FINIT;

    CAN_MCR &= ~CAN_MCR_INRQ;
    return wait_for(&CAN_MSR, CAN_MSR_INAK, 0U);
}

bool port_init(const char *bus)
{
    (void)bus; /* there is one */
    up = start_clock() && start_can();
    SYSTICK_LOAD = TICKS_A_MILLISECOND - 1U;
    SYSTICK_VAL = 0U;
    SYSTICK_CTRL = SYSTICK_CTRL_ENABLE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_CORE_CLOCK;
    return up;
}

static void put_word(uint8_t *bytes, uint32_t word)
{
    memcpy(bytes, &word, sizeof word); /* both are little endian */
}

static uint32_t get_word(const uint8_t *bytes)
{
    uint32_t word;
    memcpy(&word, bytes, sizeof word);
    return word;
}

bool port_receive(struct port_frame *frame)
{
    if ((CAN_RF0R & CAN_RF0R_FMP) == 0U) {
        return false;
    }
    const uint32_t length = CAN_RDT0R & 0xFU;
    frame->id = CAN_RI0R >> CAN_STID_SHIFT;
    frame->length = (uint8_t)(length > 8U ? 8U : length);
    put_word(&frame->data[0], CAN_RDL0R);
    put_word(&frame->data[4], CAN_RDH0R);
    CAN_RF0R = CAN_RF0R_RFOM;
    /* The controller needs some clocks to show the next one. */
    while ((CAN_RF0R & CAN_RF0R_RFOM) != 0U) {
    }
    return true;
}

/* Gives up the frames of this identifier that still wait: a newer one says more, and the rig must not act on the old ones when the
 * bus comes back. One that is on the wire at this moment is still sent. */
static void forget(uint32_t id)
{
    for (uint32_t mailbox = 0; mailbox < CAN_MAILBOXES; mailbox++) {
        if ((CAN_TSR & CAN_TSR_TME(mailbox)) == 0U && CAN_TIR(mailbox) >> CAN_STID_SHIFT == id) {
            CAN_TSR = CAN_TSR_ABRQ(mailbox);
        }
    }
    uint32_t kept = 0U;
    for (uint32_t i = 0; i < queue.count; i++) {
        const struct port_frame *frame = &queue.frames[(queue.first + i) % QUEUE_FRAMES];
        if (frame->id != id) {
            queue.frames[(queue.first + kept) % QUEUE_FRAMES] = *frame;
            kept++;
        }
    }
    queue.count = kept;
}

static bool into_mailbox(const struct port_frame *frame)
{
    for (uint32_t mailbox = 0; mailbox < CAN_MAILBOXES; mailbox++) {
        if ((CAN_TSR & CAN_TSR_TME(mailbox)) != 0U) {
            CAN_TDTR(mailbox) = frame->length;
            CAN_TDLR(mailbox) = get_word(&frame->data[0]);
            CAN_TDHR(mailbox) = get_word(&frame->data[4]);
            CAN_TIR(mailbox) = (frame->id << CAN_STID_SHIFT) | CAN_TIR_TXRQ;
            return true;
        }
    }
    return false;
}

static void send_what_waits(void)
{
    while (queue.count > 0U && into_mailbox(&queue.frames[queue.first])) {
        queue.first = (queue.first + 1U) % QUEUE_FRAMES;
        queue.count--;
    }
}

bool port_send(const struct port_frame *frame)
{
    forget(frame->id);
    send_what_waits();
    if (queue.count == 0U && into_mailbox(frame)) {
        return true;
    }
    if (queue.count == QUEUE_FRAMES) {
        return false;
    }
    queue.frames[(queue.first + queue.count) % QUEUE_FRAMES] = *frame;
    queue.count++;
    return true;
}

uint32_t port_millis(void)
{
    return milliseconds;
}

bool port_millis_are_the_rigs(void)
{
    return true;
}

void port_wait(void)
{
    const uint32_t since = milliseconds;
    while ((CAN_RF0R & CAN_RF0R_FMP) == 0U && milliseconds == since) {
        send_what_waits();
        for (uint32_t turn = 0; turn < PAUSE_TURNS; turn++) {
            __asm__ volatile("nop");
        }
    }
}

bool port_is_up(void)
{
    return up;
}
