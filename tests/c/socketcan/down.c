/* What sockets are told when their interface goes down, and what they do when it is up again. Others take it down and up: this
 * prints "ready", "is down" and "is up" when it has seen it. */
#define _GNU_SOURCE
#include "answers.h"

#include <errno.h>
#include <linux/can/isotp.h>
#include <net/if.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

enum { ASKS = 0x7E0, ANSWERS = 0x7E8, REPEATED = 0x211, HEARD = 0x123 };

static const unsigned char BYTES[20] = {0};

static int transport(canid_t sent, canid_t received)
{
    const int can = socket(PF_CAN, SOCK_DGRAM, CAN_ISOTP);
    struct sockaddr_can address = address_of(interface_index);
    address.can_addr.tp.tx_id = sent;
    address.can_addr.tp.rx_id = received;
    answer("bind of CAN_ISOTP", bind(can, (const struct sockaddr *)&address, sizeof address));
    return can;
}

/* Reads what is there or comes within 3 s. */
static int receive(const char *what, int can)
{
    const struct timeval patience = {.tv_sec = 3};
    unsigned char bytes[64];
    struct iovec part = {bytes, sizeof bytes};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1};
    setsockopt(can, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    return answer(what, recvmsg(can, &header, 0));
}

static void at_once(const char *what, int can)
{
    unsigned char bytes[64];
    struct iovec part = {bytes, sizeof bytes};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1};
    answer(what, recvmsg(can, &header, MSG_DONTWAIT));
}

/* A call that waits while the interface goes down. */
struct waiter {
    pthread_t thread;
    int can;
    long result;
    int error;
};

static void *wait_in_recvmsg(void *argument)
{
    struct waiter *waiter = argument;
    unsigned char bytes[64];
    struct iovec part = {bytes, sizeof bytes};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1};
    waiter->result = recvmsg(waiter->can, &header, 0);
    waiter->error = errno;
    return NULL;
}

static void start(struct waiter *waiter, int can)
{
    waiter->can = can;
    pthread_create(&waiter->thread, NULL, wait_in_recvmsg, waiter);
}

static void finish(const char *what, struct waiter *waiter)
{
    pthread_join(waiter->thread, NULL);
    errno = waiter->error;
    answer(what, waiter->result);
}

static int is_up(int can)
{
    struct ifreq request;
    memset(&request, 0, sizeof request);
    strncpy(request.ifr_name, interface_name, sizeof request.ifr_name - 1);
    return ioctl(can, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_UP);
}

static void wait_until(int can, int up)
{
    while (is_up(can) != up) {
        usleep(10000);
    }
    printf(up ? "is up\n" : "is down\n");
}

static void pending(const char *what, int can)
{
    int error = -1;
    socklen_t length = sizeof error;
    getsockopt(can, SOL_SOCKET, SO_ERROR, &error, &length);
    errno = error;
    answer(what, error == 0 ? 0 : -1);
}

static void events(const char *what, int can)
{
    struct pollfd set = {.fd = can, .events = POLLIN, .revents = 0};
    poll(&set, 1, 1000);
    printf("%s:%s%s%s\n", what, set.revents & POLLIN ? " IN" : "", set.revents & POLLERR ? " ERR" : "",
           set.revents & POLLHUP ? " HUP" : "");
}

struct command {
    struct bcm_msg_head head;
    struct can_frame frame;
};

static void command(const char *what, int manager, unsigned opcode, unsigned flags, canid_t id)
{
    struct command command;
    memset(&command, 0, sizeof command);
    command.head.opcode = opcode;
    command.head.flags = flags;
    command.head.can_id = id;
    command.head.ival2.tv_usec = opcode == TX_SETUP ? 20000 : 0;
    command.head.nframes = 1;
    command.frame = frame_of(id, 1, opcode == RX_SETUP ? 0xFF : 7);
    answer(what, send(manager, &command, sizeof command, 0));
}

static int manager(void)
{
    const int can = socket(PF_CAN, SOCK_DGRAM, CAN_BCM);
    const struct sockaddr_can address = address_of(interface_index);
    answer("connect of CAN_BCM", connect(can, (const struct sockaddr *)&address, sizeof address));
    return can;
}

static void raw_to_address(const char *what, int can)
{
    const struct can_frame frame = frame_of(0x100, 1, 1);
    const struct sockaddr_can address = address_of(interface_index);
    answer(what, sendto(can, &frame, sizeof frame, 0, (const struct sockaddr *)&address, sizeof address));
}

/* Frames until one is of this identifier. */
static void until(int can, canid_t id)
{
    struct can_frame frame = frame_of(0, 0, 0);
    while (frame.can_id != id && readable(can, 3000) == 1 && recv(can, &frame, sizeof frame, 0) == (ssize_t)sizeof frame) {
    }
    printf("%s of %X\n", frame.can_id == id ? "a frame" : "no frame", id);
}

void interface_down(void)
{
    const struct can_frame frame = frame_of(0x101, 1, 1);
    const int raw = bound_socket(), reader = bound_socket(), asked = bound_socket(), polled = bound_socket();
    const int any = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    struct sockaddr_can address = address_of(0);
    answer("bind to any", bind(any, (const struct sockaddr *)&address, sizeof address));
    /* None of them hears the cyclic frames. */
    struct can_filter heard = {.can_id = 0x100, .can_mask = 0x7FE};
    const int sockets[] = {raw, reader, asked, polled, any};
    for (size_t place = 0; place < sizeof sockets / sizeof sockets[0]; place++) {
        setsockopt(sockets[place], SOL_CAN_RAW, CAN_RAW_FILTER, &heard, sizeof heard);
    }
    const int cyclic = manager(), watches = manager();
    command("TX_SETUP", cyclic, TX_SETUP, SETTIMER | STARTTIMER, REPEATED);
    command("RX_SETUP", watches, RX_SETUP, 0, HEARD);
    const int asks = transport(ASKS, ANSWERS), answers = transport(ANSWERS, ASKS), waiting = transport(0x700, 0x701);
    const int read_one = transport(0x702, 0x703);
    struct waiter raw_waiter, transport_waiter;
    start(&raw_waiter, raw);
    start(&transport_waiter, waiting);
    printf("ready\n");

    wait_until(raw, 0);
    finish("recvmsg of CAN_RAW that waited", &raw_waiter);
    finish("recvmsg of CAN_ISOTP that waited", &transport_waiter);
    receive("recvmsg of CAN_ISOTP", answers);
    at_once("recvmsg of CAN_ISOTP again", answers);
    at_once("recvmsg of CAN_RAW again", raw);
    at_once("recvmsg of CAN_RAW bound to any", any);
    at_once("recvmsg of CAN_BCM that sends", cyclic);
    at_once("recvmsg of CAN_BCM that receives", watches);
    unsigned char bytes[64];
    answer("read of CAN_RAW", read(reader, bytes, sizeof bytes));
    answer("read of CAN_ISOTP", read(read_one, bytes, sizeof bytes));
    events("poll of CAN_RAW", polled);
    pending("SO_ERROR of CAN_RAW", asked);
    at_once("recvmsg of CAN_RAW after it", asked);
    pending("SO_ERROR of CAN_ISOTP", asks);
    pending("SO_ERROR of CAN_ISOTP again", asks);

    answer("write of CAN_RAW", write(raw, &frame, sizeof frame));
    raw_to_address("sendto of CAN_RAW", raw);
    raw_to_address("sendto of CAN_RAW bound to any", any);
    answer("write of CAN_ISOTP, one frame", write(asks, BYTES, 5));
    answer("write of CAN_ISOTP, several", write(asks, BYTES, sizeof BYTES));
    at_once("recvmsg of CAN_ISOTP after them", asks);
    command("TX_SEND", cyclic, TX_SEND, 0, REPEATED);
    const int late = bound_socket();
    setsockopt(late, SOL_CAN_RAW, CAN_RAW_FILTER, &heard, sizeof heard);
    at_once("recvmsg of CAN_RAW bound meanwhile", late);
    at_once("recvmsg of CAN_RAW bound meanwhile, again", late);
    const int late_transport = transport(0x704, 0x705);
    at_once("recvmsg of CAN_ISOTP bound meanwhile", late_transport);
    const int late_manager = manager();
    command("TX_SETUP meanwhile", late_manager, TX_SETUP, SETTIMER | STARTTIMER, REPEATED + 1);
    printf("all is seen\n");

    wait_until(raw, 1);
    const int observer = bound_socket();
    until(observer, REPEATED);
    until(observer, REPEATED + 1);
    raw_to_address("sendto of CAN_RAW", observer);
    receive("recvmsg of CAN_RAW", raw);
    receive("recvmsg of CAN_RAW bound to any", any);
    receive("recvmsg of CAN_RAW bound meanwhile", late);
    answer("write of CAN_ISOTP", write(asks, BYTES, sizeof BYTES));
    receive("recvmsg of CAN_ISOTP", answers);
    put(observer, HEARD, 9);
    receive("recvmsg of CAN_BCM that receives", watches);
}
