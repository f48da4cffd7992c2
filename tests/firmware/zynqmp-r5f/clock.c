/* In place of the controller: answers each Tick with what the clocks of the chip say, for scripts/qemu-clock.
 *
 * Frame 0x7A0, little endian: the core's cycle counter (4 bytes, a count for each 64 clocks), timer 0 of TTC 0 (2, its clock by
 * 1024), the port's milliseconds (2).
 */
#include "port.h"
#include "registers.h"
#include "rig.h"

#include <string.h>

#define CLOCK_FRAME_ID 0x7A0U

int main(void)
{
    struct port_frame frame;

    TTC_CLOCK = TTC_CLOCK_BY_1024;
    TTC_CONTROL = TTC_CONTROL_RESET;
    if (!port_init("can0")) {
        return 1;
    }
    for (;;) {
        port_wait();
        while (port_receive(&frame)) {
            if (frame.id == RIG_TICK_FRAME_ID) {
                const uint32_t cycles = cycle_counter();
                const uint16_t timer = (uint16_t)TTC_VALUE;
                const uint16_t milliseconds = (uint16_t)port_millis();
                frame = (struct port_frame){.id = CLOCK_FRAME_ID, .length = 8U};
                memcpy(&frame.data[0], &cycles, sizeof cycles);
                memcpy(&frame.data[4], &timer, sizeof timer);
                memcpy(&frame.data[6], &milliseconds, sizeof milliseconds);
                (void)port_send(&frame);
            }
        }
    }
}
