/* What system calls on SocketCAN answer: socketcan-answers INTERFACE; and when it goes down: socketcan-answers INTERFACE down. The
 * output on a vcan of Debian's kernel, with mtu 16 as a classic interface has it, is in tests/expected/socketcan. */
#define _GNU_SOURCE
#include "answers.h"

#include <errno.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

const char *interface_name;
int interface_index;

/* Only the C library of GNU has strerrorname_np. */
static const char *name_of(int error)
{
#define NAME(name) \
    case name: return #name
    switch (error) {
        NAME(E2BIG); NAME(EADDRNOTAVAIL); NAME(EAGAIN); NAME(EBADF); NAME(EBADMSG); NAME(ECOMM); NAME(EFAULT); NAME(EILSEQ);
        NAME(EINTR); NAME(EINVAL); NAME(EISCONN); NAME(EMSGSIZE); NAME(ENETDOWN); NAME(ENOBUFS); NAME(ENODEV); NAME(ENOENT);
        NAME(ENOPROTOOPT); NAME(ENOTCONN); NAME(ENXIO); NAME(EOPNOTSUPP); NAME(EPROTONOSUPPORT); NAME(EPROTOTYPE); NAME(ERANGE);
        NAME(ETIMEDOUT);
    default: return strerror(error);
    }
#undef NAME
}

int answer(const char *what, long result)
{
    const int error = errno;
    if (result == -1) {
        printf("%s: -1 %s\n", what, name_of(error));
    } else {
        printf("%s: %ld\n", what, result);
    }
    errno = error;
    return (int)result;
}

struct sockaddr_can address_of(int index)
{
    struct sockaddr_can address;
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = index;
    return address;
}

int bound_socket(void)
{
    const int made = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    const struct sockaddr_can address = address_of(interface_index);
    if (made < 0 || bind(made, (const struct sockaddr *)&address, sizeof address) != 0) {
        perror("a bound socket");
        exit(2);
    }
    return made;
}

struct can_frame frame_of(canid_t id, int length, int first_byte)
{
    struct can_frame frame;
    memset(&frame, 0, sizeof frame);
    frame.can_id = id;
    frame.can_dlc = (unsigned char)length;
    frame.data[0] = (unsigned char)first_byte;
    return frame;
}

void put(int socket, canid_t id, int first_byte)
{
    const struct can_frame frame = frame_of(id, 1, first_byte);
    if (write(socket, &frame, sizeof frame) != (ssize_t)sizeof frame) {
        perror("put");
        exit(2);
    }
}

int readable(int socket, int milliseconds)
{
    struct pollfd set = {.fd = socket, .events = POLLIN, .revents = 0};
    return poll(&set, 1, milliseconds);
}

void identifiers(const char *what, int socket)
{
    struct can_frame frame;
    printf("%s:", what);
    /* Frames of one sender come in order: the last is one that every list here lets pass, or nothing comes. */
    while (readable(socket, 100) == 1 && recv(socket, &frame, sizeof frame, MSG_DONTWAIT) == (ssize_t)sizeof frame) {
        printf(" %X", frame.can_id);
    }
    printf("\n");
}

int main(int count, char **arguments)
{
    const int goes_down = count == 3 && strcmp(arguments[2], "down") == 0;
    if (count != 2 && !goes_down) {
        fprintf(stderr, "usage: socketcan-answers INTERFACE [down]\n");
        return 2;
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    interface_name = arguments[1];
    interface_index = (int)if_nametoindex(interface_name);
    if (interface_index == 0) {
        perror(interface_name);
        return 2;
    }
    if (goes_down) {
        interface_down();
        return 0;
    }
    interfaces();
    making_and_binding();
    options();
    filters();
    own_frames();
    sizes_and_addresses();
    waiting();
    messages();
    stamps_and_losses();
    descriptors();
    broadcast_manager();
    transport_protocol();
    return 0;
}
