/* The main loop of every port. */
#include "loop.h"

#include "firmware.h"

static void transmit(void)
{
    struct port_frame frame;
    while (firmware_transmit(&frame)) {
        (void)port_send(&frame);
    }
}

void loop_run(void)
{
    struct port_frame frame;

    firmware_init(port_millis_are_the_rigs());
    uint32_t then = port_millis();
    while (port_is_up()) {
        port_wait();
        while (port_receive(&frame)) {
            firmware_receive(&frame);
            transmit();
        }
        /* After a pause of the board milliseconds are made up for, as a timer's pending interrupt would not: time-outs hold. */
        for (const uint32_t now = port_millis(); then != now; then++) {
            firmware_millisecond();
        }
        transmit();
    }
}
