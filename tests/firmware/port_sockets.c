/* The port for Linux: both buses are packet sockets that carry one struct can_frame of 16 bytes a packet. */
#define _POSIX_C_SOURCE 200809L /* clock_gettime */
#include "port.h"

#include <errno.h>
#include <linux/can.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

static int bus_socket = -1;
static bool up;

bool port_init(const char *bus)
{
    bus_socket = port_open(bus);
    up = bus_socket >= 0;
    if (!up) {
        fprintf(stderr, "firmware: no bus at %s: %s\n", bus, strerror(errno));
    }
    return up;
}

bool port_receive(struct port_frame *frame)
{
    struct can_frame packet;
    for (;;) {
        const ssize_t size = recv(bus_socket, &packet, sizeof packet, MSG_DONTWAIT);
        if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR && errno != ENETDOWN)) {
            up = false;
        }
        if (size <= 0) {
            return false;
        }
        const bool plain = (packet.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) == 0U;
        if (size == (ssize_t)sizeof packet && plain && packet.can_dlc <= 8) {
            frame->id = packet.can_id;
            frame->length = packet.can_dlc;
            memcpy(frame->data, packet.data, sizeof frame->data);
            return true;
        }
    }
}

bool port_send(const struct port_frame *frame)
{
    struct can_frame packet = {.can_id = frame->id, .can_dlc = frame->length};
    memcpy(packet.data, frame->data, sizeof packet.data);
    return send(bus_socket, &packet, sizeof packet, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)sizeof packet;
}

uint32_t port_millis(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000U + (uint32_t)(now.tv_nsec / 1000000);
}

bool port_millis_are_the_rigs(void)
{
    return false;
}

void port_wait(void)
{
    struct pollfd readable = {.fd = bus_socket, .events = POLLIN, .revents = 0};
    (void)poll(&readable, 1, 1);
}

bool port_is_up(void)
{
    return up;
}
