/* The main loop, as on a board without an operating system: frames, milliseconds, frames. It ends when the bus does. */
#include "firmware.h"

#include <stdio.h>

int main(int argc, char **argv)
{
    struct port_frame frame;

    if (argc != 2) {
        fprintf(stderr, "usage: %s BUS, the name of a CAN interface or the path of an embedded bus\n", argv[0]);
        return 2;
    }
    if (!port_init(argv[1])) {
        return 3;
    }
    firmware_init();
    uint32_t then = port_millis();
    while (port_is_up()) {
        port_wait();
        while (port_receive(&frame)) {
            firmware_receive(&frame);
            while (firmware_transmit(&frame)) {
                (void)port_send(&frame);
            }
        }
        /* After a pause of the board milliseconds are made up for, as a timer's pending interrupt would not: time-outs hold. */
        for (const uint32_t now = port_millis(); then != now; then++) {
            firmware_millisecond();
        }
        while (firmware_transmit(&frame)) {
            (void)port_send(&frame);
        }
    }
    return 0;
}
