/* Interfaces, sockets, addresses, options, filters: calls that wait for nothing. */
#define _GNU_SOURCE
#include "answers.h"

#include <errno.h>
#include <fcntl.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

static struct ifreq request_of(const char *name)
{
    struct ifreq request;
    memset(&request, 0, sizeof request);
    strncpy(request.ifr_name, name, IFNAMSIZ - 1);
    return request;
}

void interfaces(void)
{
    char name[IFNAMSIZ] = "";
    printf("# interfaces\n");
    printf("if_indextoname: %s\n", if_indextoname((unsigned)interface_index, name) != NULL && strcmp(name, interface_name) == 0 ? "the name" : "another");
    answer("if_nametoindex of none", if_nametoindex("none0") == 0 ? -1 : 0);
    const int sockets[] = {socket(PF_CAN, SOCK_RAW, CAN_RAW), socket(AF_INET, SOCK_DGRAM, 0), socket(AF_UNIX, SOCK_DGRAM, 0)};
    for (int place = 0; place < 3; place++) {
        struct ifreq request = request_of(interface_name);
        answer("SIOCGIFINDEX", ioctl(sockets[place], SIOCGIFINDEX, &request));
        printf("  %s\n", request.ifr_ifindex == interface_index ? "the index" : "another");
        request = request_of(interface_name);
        answer("SIOCGIFMTU", ioctl(sockets[place], SIOCGIFMTU, &request));
        printf("  %d\n", request.ifr_mtu);
        request = request_of(interface_name);
        answer("SIOCGIFFLAGS", ioctl(sockets[place], SIOCGIFFLAGS, &request));
        printf("  %#x\n", (unsigned)request.ifr_flags);
        request = request_of(interface_name);
        answer("SIOCGIFHWADDR", ioctl(sockets[place], SIOCGIFHWADDR, &request));
        printf("  type %d\n", request.ifr_hwaddr.sa_family);
        request = request_of(interface_name);
        answer("SIOCGIFTXQLEN", ioctl(sockets[place], SIOCGIFTXQLEN, &request));
        printf("  %d\n", request.ifr_qlen);
        request = request_of("none0");
        answer("SIOCGIFINDEX of none", ioctl(sockets[place], SIOCGIFINDEX, &request));
        memset(&request, 0, sizeof request);
        request.ifr_ifindex = 99999;
        answer("SIOCGIFNAME of none", ioctl(sockets[place], SIOCGIFNAME, &request));
        close(sockets[place]);
    }
}

static void number(const char *what, int socket, int level, int option)
{
    int value = -7;
    socklen_t length = sizeof value;
    if (answer(what, getsockopt(socket, level, option, &value, &length)) == 0) {
        printf("  %d of %d bytes\n", value, (int)length);
    }
}

void making_and_binding(void)
{
    printf("# making and binding\n");
    answer("protocol 99", socket(PF_CAN, SOCK_RAW, 99));
    answer("protocol -1", socket(PF_CAN, SOCK_RAW, -1));
    answer("protocol 3", socket(PF_CAN, SOCK_RAW, 3));
    answer("CAN_RAW as a stream", socket(PF_CAN, SOCK_STREAM, CAN_RAW));
    answer("CAN_BCM raw", socket(PF_CAN, SOCK_RAW, CAN_BCM));
    answer("an unknown flag", socket(PF_CAN, SOCK_RAW | 0x100000, CAN_RAW));
    const int flagged = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    answer("close-on-exec", fcntl(flagged, F_GETFD));
    answer("non-blocking", (fcntl(flagged, F_GETFL) & O_NONBLOCK) != 0);
    const int next = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    answer("the lowest free number", next == flagged + 1);
    answer("no close-on-exec", fcntl(next, F_GETFD));
    close(flagged);
    number("SO_TYPE", next, SOL_SOCKET, SO_TYPE);
    number("SO_DOMAIN", next, SOL_SOCKET, SO_DOMAIN);
    number("SO_PROTOCOL", next, SOL_SOCKET, SO_PROTOCOL);

    struct sockaddr_can address = address_of(interface_index);
    const struct sockaddr *given = (struct sockaddr *)&address;
    answer("bind with 7 bytes", bind(next, given, 7));
    address.can_family = AF_INET;
    answer("bind of another family", bind(next, given, sizeof address));
    address = address_of(99999);
    answer("bind to no interface", bind(next, given, sizeof address));
    address = address_of((int)if_nametoindex("lo"));
    answer("bind to lo", bind(next, given, sizeof address));
    address = address_of(interface_index);
    answer("bind with 8 bytes", bind(next, given, 8));
    answer("bind again", bind(next, given, sizeof address));
    address = address_of(0);
    answer("bind to any", bind(next, given, sizeof address));

    struct sockaddr_can named;
    socklen_t length = sizeof named;
    answer("getsockname", getsockname(next, (struct sockaddr *)&named, &length));
    printf("  family %d, index %d, %d bytes\n", named.can_family, named.can_ifindex, (int)length);
    address = address_of(interface_index);
    answer("bind back", bind(next, given, sizeof address));
    memset(&named, 0xEE, sizeof named);
    length = 3;
    answer("getsockname into 3 bytes", getsockname(next, (struct sockaddr *)&named, &length));
    printf("  family %d, byte 3 %#x, %d bytes\n", named.can_family, ((unsigned char *)&named)[3], (int)length);
    length = sizeof named;
    answer("getsockname at null", getsockname(next, NULL, &length));
    answer("getpeername", getpeername(next, (struct sockaddr *)&named, &length));
    answer("connect", connect(next, given, sizeof address));
    answer("listen", listen(next, 1));
    answer("accept", accept(next, NULL, NULL));
    answer("shutdown", shutdown(next, SHUT_RDWR));
    close(next);
    answer("bind after close", bind(next, given, sizeof address));
    answer("setsockopt after close", setsockopt(next, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0));
}

/// CAN_RAW_XL_FRAMES, which headers of older kernels lack.
#define RAW_XL_FRAMES 7

void options(void)
{
    printf("# options\n");
    const int can = bound_socket();
    static const struct {
        const char *name;
        int option, value;
    } numbers[] = {
        {"LOOPBACK", CAN_RAW_LOOPBACK, 0},     {"RECV_OWN_MSGS", CAN_RAW_RECV_OWN_MSGS, 1},
        {"ERR_FILTER", CAN_RAW_ERR_FILTER, -1}, {"FD_FRAMES", CAN_RAW_FD_FRAMES, 1},
        {"JOIN_FILTERS", CAN_RAW_JOIN_FILTERS, 1}, {"XL_FRAMES", RAW_XL_FRAMES, 1},
    };
    for (size_t place = 0; place < sizeof numbers / sizeof numbers[0]; place++) {
        printf("%s\n", numbers[place].name);
        number("get", can, SOL_CAN_RAW, numbers[place].option);
        answer("set 3 bytes", setsockopt(can, SOL_CAN_RAW, numbers[place].option, &numbers[place].value, 3));
        answer("set 8 bytes", setsockopt(can, SOL_CAN_RAW, numbers[place].option, "\1\0\0\0\0\0\0", 8));
        answer("set", setsockopt(can, SOL_CAN_RAW, numbers[place].option, &numbers[place].value, 4));
        number("get", can, SOL_CAN_RAW, numbers[place].option);
        int value = -1;
        socklen_t length = 2;
        answer("get 2 bytes", getsockopt(can, SOL_CAN_RAW, numbers[place].option, &value, &length));
        printf("  %d of %d bytes\n", value, (int)length);
    }
    int one = 1;
    socklen_t length = sizeof one;
    int none = 0;
    answer("FD_FRAMES off with XL_FRAMES on", setsockopt(can, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &none, sizeof none));
    answer("set option 99", setsockopt(can, SOL_CAN_RAW, 99, &one, sizeof one));
    answer("get option 99", getsockopt(can, SOL_CAN_RAW, 99, &one, &length));
    answer("set at the level of BCM", setsockopt(can, SOL_CAN_BASE + CAN_BCM, 1, &one, sizeof one));
    answer("get at the level of BCM", getsockopt(can, SOL_CAN_BASE + CAN_BCM, 1, &one, &length));
    answer("set from null", setsockopt(can, SOL_CAN_RAW, CAN_RAW_LOOPBACK, NULL, sizeof one));
    number("SO_RXQ_OVFL", can, SOL_SOCKET, SO_RXQ_OVFL);
    answer("set SO_RXQ_OVFL", setsockopt(can, SOL_SOCKET, SO_RXQ_OVFL, &one, sizeof one));
    number("SO_RXQ_OVFL", can, SOL_SOCKET, SO_RXQ_OVFL);
    int bytes = 65536;
    answer("set SO_RCVBUF", setsockopt(can, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes));
    number("SO_RCVBUF", can, SOL_SOCKET, SO_RCVBUF);

    struct can_filter list[3] = {{0x100, 0x700}, {0x200, 0x700}, {0x300, 0x700}};
    answer("set FILTER of 12 bytes", setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, list, 12));
    answer("set FILTER of 513", setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, list, 513 * sizeof list[0]));
    answer("set FILTER of 3", setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, list, sizeof list));
    memset(list, 0, sizeof list);
    length = 16;
    answer("get FILTER of 3 into 2", getsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, list, &length));
    printf("  %d bytes\n", (int)length);
    length = sizeof list;
    answer("get FILTER", getsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, list, &length));
    printf("  %d bytes, the last %X %X\n", (int)length, list[2].can_id, list[2].can_mask);
    answer("set FILTER of none", setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0));
    length = sizeof list;
    answer("get FILTER of none", getsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, list, &length));
    printf("  %d bytes\n", (int)length);
    close(can);
}

static void send_all_kinds(int sender)
{
    static const canid_t ids[] = {
        0x000, 0x100, 0x123, 0x1FF, 0x7FF, 0x123 | CAN_EFF_FLAG, 0x12345678 | CAN_EFF_FLAG, 0x123 | CAN_RTR_FLAG,
        CAN_ERR_FLAG | CAN_ERR_BUSOFF, CAN_ERR_FLAG | CAN_ERR_CRTL,
    };
    for (size_t place = 0; place < sizeof ids / sizeof ids[0]; place++) {
        put(sender, ids[place], 1);
    }
}

static void filtered(const char *what, const struct can_filter *list, size_t count, int join, unsigned errors)
{
    const int sender = bound_socket(), can = bound_socket();
    setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, list, (socklen_t)(count * sizeof *list));
    setsockopt(can, SOL_CAN_RAW, CAN_RAW_JOIN_FILTERS, &join, sizeof join);
    setsockopt(can, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors);
    send_all_kinds(sender);
    identifiers(what, can);
    close(can);
    close(sender);
}

void filters(void)
{
    printf("# filters\n");
    const struct can_filter all = {0, 0}, one = {0x123, CAN_SFF_MASK}, group = {0x100, 0x700};
    const struct can_filter standard = {0x123, CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG};
    const struct can_filter extended = {0x123 | CAN_EFF_FLAG, CAN_EFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG};
    const struct can_filter inverted = {0x123 | CAN_INV_FILTER, CAN_SFF_MASK};
    const struct can_filter two[] = {{0x100, 0x7FF}, {0x7FF, 0x7FF}};
    const struct can_filter twice[] = {{0x123, 0x7FF}, {0x100, 0x700}};
    const struct can_filter neither[] = {{0x100 | CAN_INV_FILTER, 0x7FF}, {0x7FF | CAN_INV_FILTER, 0x7FF}};
    const struct can_filter of_errors = {0, CAN_ERR_FLAG | CAN_ERR_BUSOFF};
    filtered("all", &all, 1, 0, 0);
    filtered("none", NULL, 0, 0, 0);
    filtered("one", &one, 1, 0, 0);
    filtered("a group", &group, 1, 0, 0);
    filtered("standard only", &standard, 1, 0, 0);
    filtered("extended only", &extended, 1, 0, 0);
    filtered("inverted", &inverted, 1, 0, 0);
    filtered("two", two, 2, 0, 0);
    filtered("two that overlap", twice, 2, 0, 0);
    filtered("two joined", twice, 2, 1, 0);
    filtered("two inverted", neither, 2, 0, 0);
    filtered("two inverted and joined", neither, 2, 1, 0);
    filtered("bus-off", NULL, 0, 0, CAN_ERR_BUSOFF);
    filtered("all errors beside one", &one, 1, 0, CAN_ERR_MASK);
    filtered("a filter of errors", &of_errors, 1, 0, 0);
    filtered("joined with errors", twice, 2, 1, CAN_ERR_MASK);
}
