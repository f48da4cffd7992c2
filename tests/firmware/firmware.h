/* The drive controller: frames in, frames out, nothing of the board. One instance, all of it static. */
#ifndef FIRMWARE_H
#define FIRMWARE_H

#include "port.h"

/* Begins anew, as after power-on. */
void firmware_init(void);

/* Takes a frame from the bus; sensors are answered by a command. */
void firmware_receive(const struct port_frame *frame);

/* A millisecond has passed on the board. */
void firmware_millisecond(void);

/* The next frame to send; false when there is none. */
bool firmware_transmit(struct port_frame *frame);

#endif
