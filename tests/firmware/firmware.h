/* The drive controller: frames in, frames out, nothing of the board. One instance, all of it static. */
#ifndef FIRMWARE_H
#define FIRMWARE_H

#include "port.h"

/* Begins anew, as after power-on; own_time says whether the board's milliseconds are the rig's (port_millis_are_the_rigs). */
void firmware_init(bool own_time);

/* Takes a frame from the bus; sensors are answered by a command. */
void firmware_receive(const struct port_frame *frame);

/* A millisecond has passed on the board. */
void firmware_millisecond(void);

/* The next frame to send; false when there is none. */
bool firmware_transmit(struct port_frame *frame);

#endif
