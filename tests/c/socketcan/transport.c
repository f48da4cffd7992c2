/* The transport protocol, CAN_ISOTP: addresses, options, messages, and what the other side can do wrong. */
#define _GNU_SOURCE
#include "answers.h"

#include <fcntl.h>
#include <linux/can/isotp.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <unistd.h>

enum { ASKS = 0x7E0, ANSWERS = 0x7E8 };

static struct sockaddr_can channel(canid_t sent, canid_t received)
{
    struct sockaddr_can address = address_of(interface_index);
    address.can_addr.tp.tx_id = sent;
    address.can_addr.tp.rx_id = received;
    return address;
}

static int transport(void) { return socket(PF_CAN, SOCK_DGRAM, CAN_ISOTP); }

static int bind_to(int can, struct sockaddr_can address, socklen_t length)
{
    return bind(can, (const struct sockaddr *)&address, length);
}

/* A bound socket with these flags, block size and STmin. */
static int bound(canid_t sent, canid_t received, unsigned flags, int block_size, int gap)
{
    const int can = transport();
    const struct can_isotp_options options = {.flags = flags, .ext_address = 0x55, .txpad_content = 0xAA, .rxpad_content = 0xAA};
    const struct can_isotp_fc_options flow = {.bs = (__u8)block_size, .stmin = (__u8)gap};
    setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &options, sizeof options);
    setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_RECV_FC, &flow, sizeof flow);
    /* Longer than anything that the protocol waits for. */
    const struct timeval patience = {.tv_sec = 3};
    setsockopt(can, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (bind_to(can, channel(sent, received), sizeof(struct sockaddr_can)) != 0) {
        perror("a channel");
    }
    return can;
}

static void option(const char *what, int can, int name)
{
    unsigned char value[32];
    socklen_t length = sizeof value;
    if (answer(what, getsockopt(can, SOL_CAN_ISOTP, name, value, &length)) == 0) {
        printf(" ");
        for (socklen_t place = 0; place < length; place++) {
            printf(" %02X", value[place]);
        }
        printf("\n");
    }
}

/* Every frame that the observer has. */
static void frames(int observer)
{
    struct can_frame frame;
    while (readable(observer, 200) == 1 && recv(observer, &frame, sizeof frame, MSG_DONTWAIT) == (ssize_t)sizeof frame) {
        printf("  %X", frame.can_id);
        for (int place = 0; place < frame.can_dlc; place++) {
            printf(" %02X", frame.data[place]);
        }
        printf("\n");
    }
}

/* recvmsg of a message whose bytes count up. */
static void message(const char *what, int can, size_t room, int flags)
{
    static unsigned char bytes[67000];
    struct sockaddr_can from;
    struct iovec part = {bytes, room};
    struct msghdr header = {.msg_name = &from, .msg_namelen = sizeof from, .msg_iov = &part, .msg_iovlen = 1};
    memset(bytes, 0xEE, sizeof bytes);
    const long length = answer(what, recvmsg(can, &header, flags));
    if (length < 0) {
        return;
    }
    const size_t there = (size_t)length < room ? (size_t)length : room;
    size_t place = 0;
    while (place < there && bytes[place] == (unsigned char)place) {
        place++;
    }
    printf("  %s, %d bytes of address, %s%s\n", place == there ? "as it was sent" : "not as it was sent", (int)header.msg_namelen,
           from.can_ifindex == interface_index ? "the index" : "another", header.msg_flags & MSG_TRUNC ? ", TRUNC" : "");
}

static void addresses_and_options(void)
{
    answer("CAN_ISOTP raw", socket(PF_CAN, SOCK_RAW, CAN_ISOTP));
    const int can = transport();
    const int one = 1;
    int type = 0;
    socklen_t length = sizeof type;
    answer("SO_TYPE", getsockopt(can, SOL_SOCKET, SO_TYPE, &type, &length));
    printf("  %d\n", type);
    option("options", can, CAN_ISOTP_OPTS);
    option("flow control", can, CAN_ISOTP_RECV_FC);
    option("sent gap", can, CAN_ISOTP_TX_STMIN);
    option("received gap", can, CAN_ISOTP_RX_STMIN);
    option("link layer", can, CAN_ISOTP_LL_OPTS);
    option("option 99", can, 99);
    answer("set option 99", setsockopt(can, SOL_CAN_ISOTP, 99, &one, sizeof one));
    answer("set options of 4 bytes", setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &one, sizeof one));
    answer("set flow control of 4 bytes", setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_RECV_FC, &one, sizeof one));
    answer("set a gap of 4 bytes", setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_TX_STMIN, &one, sizeof one));
    answer("set a gap of 3 bytes", setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_RX_STMIN, &one, 3));
    answer("set an option of CAN_RAW", setsockopt(can, SOL_CAN_RAW, CAN_RAW_LOOPBACK, &one, sizeof one));
    struct can_isotp_options options = {.flags = CAN_ISOTP_SF_BROADCAST | CAN_ISOTP_CF_BROADCAST, .ext_address = 7};
    answer("set both broadcasts", setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &options, sizeof options));
    option("options then", can, CAN_ISOTP_OPTS);
    options.flags = 0;
    answer("set none", setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &options, sizeof options));
    static const struct can_isotp_ll_options layers[] = {{72, 64, 0}, {72, 9, 0}, {16, 12, 0}, {16, 8, 1}, {17, 8, 0}, {16, 8, 0}};
    for (size_t place = 0; place < sizeof layers / sizeof layers[0]; place++) {
        answer("set a link layer", setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_LL_OPTS, &layers[place], sizeof layers[place]));
        if (place == 0) {
            answer("bind for CAN FD", bind_to(can, channel(ASKS, ANSWERS), sizeof(struct sockaddr_can)));
        }
    }

    char byte = 0;
    struct iovec part = {&byte, 1};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1};
    answer("write before bind", write(can, "abc", 3));
    answer("recvmsg before bind", recvmsg(can, &header, MSG_DONTWAIT));
    answer("bind with 15 bytes", bind_to(can, channel(ASKS, ANSWERS), 15));
    answer("bind to bits beyond", bind_to(can, channel(0x800, ANSWERS), sizeof(struct sockaddr_can)));
    answer("bind to bits beyond", bind_to(can, channel(ASKS, 0xA0000000), sizeof(struct sockaddr_can)));
    answer("bind to one identifier", bind_to(can, channel(ASKS, ASKS), sizeof(struct sockaddr_can)));
    struct sockaddr_can address = channel(ASKS, ANSWERS);
    address.can_family = AF_UNIX;
    answer("bind of another family", bind_to(can, address, sizeof address));
    address = channel(ASKS, ANSWERS);
    address.can_ifindex = 0;
    answer("bind to any", bind_to(can, address, sizeof address));
    address.can_ifindex = 99999;
    answer("bind to no interface", bind_to(can, address, sizeof address));
    address.can_ifindex = (int)if_nametoindex("lo");
    answer("bind to lo", bind_to(can, address, sizeof address));
    answer("bind with 16 bytes", bind_to(can, channel(ASKS, ANSWERS), 16));
    answer("bind again", bind_to(can, channel(ASKS, ANSWERS), 16));
    answer("set options after it", setsockopt(can, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &options, sizeof options));
    memset(&address, 0xEE, sizeof address);
    length = sizeof address;
    answer("getsockname", getsockname(can, (struct sockaddr *)&address, &length));
    printf("  %d bytes, sends %X, receives %X\n", (int)length, address.can_addr.tp.tx_id, address.can_addr.tp.rx_id);
    answer("getpeername", getpeername(can, (struct sockaddr *)&address, &length));
    answer("connect", connect(can, (struct sockaddr *)&address, sizeof address));
    answer("listen", listen(can, 1));
    answer("shutdown", shutdown(can, SHUT_RDWR));
    answer("recvmsg with MSG_OOB", recvmsg(can, &header, MSG_OOB | MSG_DONTWAIT));
    answer("nothing to receive", recvmsg(can, &header, MSG_DONTWAIT));
    close(can);
}

static void messages_of_every_length(const unsigned char *bytes)
{
    const int observer = bound_socket(), asks = bound(ASKS, ANSWERS, 0, 0, 0), answers = bound(ANSWERS, ASKS, 0, 3, 0xF1);
    static const size_t lengths[] = {1, 7, 8, 16, 20, 40};
    for (size_t place = 0; place < sizeof lengths / sizeof lengths[0]; place++) {
        char what[32];
        snprintf(what, sizeof what, "a message of %zu", lengths[place]);
        answer(what, write(asks, bytes, lengths[place]));
        message("received", answers, 67000, 0);
        frames(observer);
    }
    close(observer);
    answer("a message of 0", write(asks, bytes, 0));
    answer("a message of 66001", write(asks, bytes, 66001));
    answer("a message of 66000", write(asks, bytes, 66000));
    message("received", answers, 67000, 0);
    answer("one after the other", write(asks, bytes, 100));
    answer("one after the other", write(asks, bytes, 16));
    answer("one after the other", send(asks, bytes, 5, 0));
    message("received", answers, 3, MSG_PEEK | MSG_TRUNC);
    message("received", answers, 3, 0);
    message("received", answers, 67000, 0);
    message("received", answers, 67000, 0);
    struct iovec parts[2] = {{(void *)bytes, 10}, {(void *)(bytes + 10), 20}};
    struct mmsghdr many[1] = {{.msg_hdr = {.msg_iov = parts, .msg_iovlen = 2}}};
    answer("sendmmsg", sendmmsg(asks, many, 1, 0));
    printf("  %u bytes\n", many[0].msg_len);
    message("received", answers, 67000, 0);
    close(asks);
    close(answers);
}

static void with_flags(const char *what, unsigned flags, const unsigned char *bytes)
{
    printf("%s\n", what);
    const int observer = bound_socket(), asks = bound(ASKS, ANSWERS, flags, 0, 0), answers = bound(ANSWERS, ASKS, flags, 0, 0);
    answer("a message of 3", write(asks, bytes, 3));
    message("received", answers, 67000, 0);
    answer("a message of 15", write(asks, bytes, 15));
    message("received", answers, 67000, 0);
    frames(observer);
    close(asks);
    close(answers);
    close(observer);
}

static void broadcast(const unsigned char *bytes)
{
    const int observer = bound_socket(), single = bound(ASKS, ASKS, CAN_ISOTP_SF_BROADCAST, 0, 0);
    answer("a broadcast of 3", write(single, bytes, 3));
    answer("a broadcast of 9", write(single, bytes, 9));
    const int many = bound(ASKS, ASKS, CAN_ISOTP_CF_BROADCAST, 0, 0);
    answer("a broadcast of 9 in frames", write(many, bytes, 9));
    frames(observer);
    close(single);
    close(many);
    close(observer);
}

/* A frame of the other side, by hand. */
static void by_hand(int raw, canid_t id, int length, const char *bytes)
{
    struct can_frame frame = frame_of(id, length, 0);
    memcpy(frame.data, bytes, (size_t)length);
    if (write(raw, &frame, sizeof frame) != (ssize_t)sizeof frame) {
        perror("by hand");
    }
}

static void what_can_go_wrong(const unsigned char *bytes)
{
    const int raw = bound_socket();
    int can = bound(ASKS, ANSWERS, 0, 0, 0);
    by_hand(raw, ANSWERS, 8, "\x10\x14\0\1\2\3\4\5");
    by_hand(raw, ANSWERS, 8, "\x22\6\7\x8\x9\xA\xB\xC");
    message("a wrong number", can, 67000, 0);
    by_hand(raw, ANSWERS, 8, "\x10\x14\0\1\2\3\4\5");
    message("no consecutive frame", can, 67000, 0);
    by_hand(raw, ANSWERS, 8, "\x10\0\0\1\1\xD1\0\1");
    by_hand(raw, ANSWERS, 3, "\2\0\1");
    message("a single frame after one that is too long", can, 67000, 0);
    frames(raw);

    answer("a message for nobody", write(can, bytes, 20));
    fcntl(can, F_SETFL, O_NONBLOCK);
    answer("another at once", write(can, bytes, 20));
    fcntl(can, F_SETFL, 0);
    answer("another that waits is told", write(can, bytes, 4));
    message("and nobody else", can, 67000, MSG_DONTWAIT);
    answer("a message for nobody", write(can, bytes, 20));
    message("whose reader is told", can, 67000, 0);
    answer("and no writer", write(can, bytes, 4));
    frames(raw);
    answer("a message", write(can, bytes, 20));
    by_hand(raw, ANSWERS, 3, "\x32\0\0");
    message("an overflow of the other side", can, 67000, 0);
    answer("a message", write(can, bytes, 20));
    by_hand(raw, ANSWERS, 2, "\x30\0");
    message("flow control that is too short", can, 67000, 0);
    answer("a message", write(can, bytes, 20));
    by_hand(raw, ANSWERS, 3, "\x31\0\0");
    by_hand(raw, ANSWERS, 3, "\x30\0\0");
    frames(raw);
    close(can);

    can = bound(ASKS, ANSWERS, CAN_ISOTP_WAIT_TX_DONE, 0, 0);
    answer("a message whose end is awaited", write(can, bytes, 20));
    answer("a short one", write(can, bytes, 6));
    frames(raw);
    close(can);

    can = bound(ASKS, ANSWERS, CAN_ISOTP_RX_PADDING | CAN_ISOTP_CHK_PAD_LEN | CAN_ISOTP_CHK_PAD_DATA, 0, 0);
    by_hand(raw, ANSWERS, 4, "\2\0\1\xAA");
    message("padding that is too short", can, 67000, 0);
    by_hand(raw, ANSWERS, 8, "\2\0\1\xAA\xAA\xAA\xAA\0");
    message("another padding", can, 67000, 0);
    by_hand(raw, ANSWERS, 8, "\2\0\1\xAA\xAA\xAA\xAA\xAA");
    message("the padding", can, 67000, 0);
    close(can);
    close(raw);
}

void transport_protocol(void)
{
    static unsigned char bytes[67000];
    for (size_t place = 0; place < sizeof bytes; place++) {
        bytes[place] = (unsigned char)place;
    }
    printf("# transport protocol\n");
    addresses_and_options();
    messages_of_every_length(bytes);
    with_flags("extended addresses", CAN_ISOTP_EXTEND_ADDR, bytes);
    with_flags("padding", CAN_ISOTP_TX_PADDING, bytes);
    with_flags("padding that is compared", CAN_ISOTP_TX_PADDING | CAN_ISOTP_RX_PADDING | CAN_ISOTP_CHK_PAD_DATA, bytes);
    broadcast(bytes);
    what_can_go_wrong(bytes);
}
