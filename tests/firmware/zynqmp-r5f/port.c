/* The port for the Cortex-R5F of a Zynq UltraScale+: CAN 0 at 1 Mbit/s, milliseconds by the core's cycle counter.
 *
 * Everything is polled: QEMU's board does not lead interrupts to this core. Clocks, pins and resets are the first-stage boot
 * loader's (psu_init), as for any program of this core; of CAN's clock 100 MHz are expected.
 */
#include "port.h"

#include "registers.h"
#include "rig.h"

#include <string.h>

#define SPINS 100000U
#define FILTERS 4U
#define MOST_WAITING 32U /* frames, of 64 */
/* Between two looks at the controller, a register access being what costs in an emulator: some 5 us there. */
#define PAUSE_TURNS 2000U

static uint32_t counted;
static uint64_t clocks; /* of the millisecond that has begun */
static uint32_t milliseconds;
static bool up;
static bool closed; /* to new frames, until the old ones are read */

static bool wait_for(uint32_t mask, uint32_t value)
{
    for (uint32_t spins = 0; spins < SPINS; spins++) {
        if ((CAN_SR & mask) == value) {
            return true;
        }
    }
    return false;
}

/* Four pairs of identifier and mask let in the seven that the firmware takes and three more, which it passes over. */
static void set_filters(void)
{
    static const struct {
        uint32_t id, any;
    } TAKEN[FILTERS] = {
        {RIG_CONSOLE_EMERGENCY_STOP_FRAME_ID, 3U}, /* 0x108 to 0x10B: the rig's and the load's too */
        {RIG_DRIVE_SENSORS_FRAME_ID, 0U},
        {RIG_TICK_FRAME_ID, 0U},
        {RIG_RIG_STATUS_FRAME_ID, RIG_RIG_STATUS_FRAME_ID ^ RIG_RUN_CONTROL_FRAME_ID}, /* 0x140 and 0x160 */
    };
    CAN_AFR = 0U;
    for (uint32_t i = 0; i < FILTERS; i++) {
        CAN_AFMR(i) = CAN_ID_MASK & ~CAN_ID(TAKEN[i].any);
        CAN_AFIR(i) = CAN_ID(TAKEN[i].id);
    }
    CAN_AFR = (1U << FILTERS) - 1U;
}

bool port_init(const char *bus)
{
    (void)bus; /* there is one */
    start_cycle_counter();
    counted = cycle_counter();

    CAN_SRR = CAN_SRR_SRST;
    if (!wait_for(CAN_SR_CONFIG, CAN_SR_CONFIG)) {
        return false;
    }
    CAN_MSR = 0U;                           /* neither asleep nor looped back */
    CAN_BRPR = 5U - 1U;                     /* quanta of 50 ns */
    CAN_BTR = (4U - 1U) << 4 | (15U - 1U);  /* 1 + 15 + 4 of them: sampled at 80 % */
    CAN_IER = 0U;
    CAN_WIR = MOST_WAITING;
    set_filters();
    CAN_SRR = CAN_SRR_CEN;
    up = wait_for(CAN_SR_CONFIG | CAN_SR_NORMAL, CAN_SR_NORMAL);
    return up;
}

static void put_word(uint8_t *bytes, uint32_t word)
{
    word = CAN_DATA(word);
    memcpy(bytes, &word, sizeof word);
}

static uint32_t get_word(const uint8_t *bytes)
{
    uint32_t word;
    memcpy(&word, bytes, sizeof word);
    return CAN_DATA(word);
}

/* The four words of a frame, by one instruction: the reads must not be far apart. */
static void read_fifo(uint32_t words[4])
{
    register uint32_t id __asm__("r2");
    register uint32_t length __asm__("r3");
    register uint32_t first __asm__("r4");
    register uint32_t second __asm__("r5");
    __asm__ volatile("ldmia %4, {r2-r5}"
                     : "=&r"(id), "=&r"(length), "=&r"(first), "=&r"(second)
                     : "r"(CAN_RXFIFO)
                     : "memory");
    words[0] = id;
    words[1] = length;
    words[2] = first;
    words[3] = second;
}

bool port_receive(struct port_frame *frame)
{
    uint32_t words[4];

    while ((CAN_ISR & CAN_ISR_RXNEMP) != 0U) {
        if (CAN_BREAKS_WHEN_FULL && (CAN_ISR & CAN_ISR_RXFWMFLL) != 0U && !closed) {
            CAN_SRR = 0U;
            closed = true;
        }
        read_fifo(words);
        CAN_ICR = CAN_ISR_RXNEMP; /* set again when another one waits */
        if ((words[0] & CAN_ID_NOT_PLAIN) == 0U) {
            const uint32_t length = words[1] >> CAN_DLC_SHIFT;
            frame->id = CAN_ID_OF(words[0]);
            frame->length = (uint8_t)(length > 8U ? 8U : length);
            put_word(&frame->data[0], words[2]);
            put_word(&frame->data[4], words[3]);
            return true;
        }
    }
    if (closed) {
        CAN_ICR = CAN_ISR_RXFWMFLL;
        CAN_SRR = CAN_SRR_CEN;
        closed = false;
    }
    return false;
}

bool port_send(const struct port_frame *frame)
{
    if ((CAN_SR & CAN_SR_TXFLL) != 0U) {
        return false;
    }
    CAN_TXFIFO_ID = CAN_ID(frame->id);
    CAN_TXFIFO_DLC = (uint32_t)frame->length << CAN_DLC_SHIFT;
    CAN_TXFIFO_DATA1 = get_word(&frame->data[0]);
    CAN_TXFIFO_DATA2 = get_word(&frame->data[4]);
    return true;
}

uint32_t port_millis(void)
{
    const uint32_t now = cycle_counter();
    clocks += (uint64_t)(now - counted) * CLOCKS_A_COUNT;
    counted = now;
    while (clocks >= CORE_HZ / 1000U) {
        clocks -= CORE_HZ / 1000U;
        milliseconds++;
    }
    return milliseconds;
}

bool port_millis_are_the_rigs(void)
{
    return !CORE_CLOCK_IS_THE_HOSTS;
}

void port_wait(void)
{
    const uint32_t since = port_millis();
    while ((CAN_ISR & CAN_ISR_RXNEMP) == 0U && port_millis() == since) {
        for (uint32_t turn = 0; turn < PAUSE_TURNS; turn++) {
            __asm__ volatile("nop");
        }
    }
}

bool port_is_up(void)
{
    return up;
}
