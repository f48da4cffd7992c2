/* What the firmware needs of its board: a CAN controller and a millisecond timer.
 *
 * port_socketcan.c and port_embedded.c open a bus, port_sockets.c does the rest. A board brings files of its own: stm32f103/.
 */
#ifndef PORT_H
#define PORT_H

#include <stdbool.h>
#include <stdint.h>

/* A classic CAN frame; only those with 11-bit identifiers that are no remote requests reach the firmware. */
struct port_frame {
    uint32_t id;
    uint8_t length;
    uint8_t data[8];
};

/* Opens the bus; false, with a message, when it cannot be had. */
bool port_init(const char *bus);

/* The oldest frame that waits in the receive queue; false when none does. */
bool port_receive(struct port_frame *frame);

/* Hands a frame to the transmit queue, in place of older ones of its identifier as far as the controller can take them back; false
 * when the queue is full: the frame is dropped. */
bool port_send(const struct port_frame *frame);

/* Milliseconds since some moment, modulo 2^32. */
uint32_t port_millis(void);

/* Whether these pass as the rig's time does, even where that is simulated: true on a board, whose timer is that of its core and
 * is simulated with it; false for a process on a host, whose clock goes on by itself. */
bool port_millis_are_the_rigs(void);

/* Sleeps until a frame or the next millisecond comes, as a processor waits for its next interrupt. */
void port_wait(void);

/* Whether the bus is still there. */
bool port_is_up(void);

/* Opens a packet socket on the bus; negative when there is none. Of port_socketcan.c or port_embedded.c. */
int port_open(const char *bus);

#endif
