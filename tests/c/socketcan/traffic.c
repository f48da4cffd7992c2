/* Frames between sockets: own ones, lengths, addresses, waiting, control messages, descriptors that travel. */
#define _GNU_SOURCE
#include "answers.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/sockios.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static const char *flags_of(int flags)
{
    static char text[64];
    snprintf(text, sizeof text, "%s%s%s%s%s", flags & MSG_DONTROUTE ? " DONTROUTE" : "", flags & MSG_CONFIRM ? " CONFIRM" : "",
             flags & MSG_TRUNC ? " TRUNC" : "", flags & MSG_CTRUNC ? " CTRUNC" : "",
             flags & ~(MSG_DONTROUTE | MSG_CONFIRM | MSG_TRUNC | MSG_CTRUNC) ? " others" : "");
    return text;
}

/* recvmsg with everything that it can tell. */
static void message(const char *what, int can, size_t room, size_t control_room)
{
    struct can_frame frame;
    struct sockaddr_can from;
    char control[256];
    struct iovec part = {.iov_base = &frame, .iov_len = room};
    struct msghdr header = {.msg_name = &from, .msg_namelen = sizeof from, .msg_iov = &part, .msg_iovlen = 1,
                            .msg_control = control, .msg_controllen = control_room, .msg_flags = 0};
    memset(&from, 0, sizeof from);
    memset(&frame, 0, sizeof frame);
    if (readable(can, 200) != 1) {
        printf("%s: nothing\n", what);
        return;
    }
    if (answer(what, recvmsg(can, &header, 0)) == -1) {
        return;
    }
    printf("  %X, family %d, %s, %d bytes,%s\n", frame.can_id, from.can_family,
           from.can_ifindex == interface_index ? "the index" : "another", (int)header.msg_namelen, flags_of(header.msg_flags));
    for (struct cmsghdr *told = CMSG_FIRSTHDR(&header); told != NULL; told = CMSG_NXTHDR(&header, told)) {
        struct timespec now;
        clock_gettime(CLOCK_REALTIME, &now);
        if (told->cmsg_level == SOL_SOCKET && told->cmsg_type == SO_TIMESTAMP) {
            const struct timeval *stamp = (struct timeval *)CMSG_DATA(told);
            printf("  SO_TIMESTAMP, %d bytes, %s\n", (int)told->cmsg_len, labs(now.tv_sec - stamp->tv_sec) < 60 ? "now" : "another time");
        } else if (told->cmsg_level == SOL_SOCKET && told->cmsg_type == SO_TIMESTAMPNS) {
            const struct timespec *stamp = (struct timespec *)CMSG_DATA(told);
            printf("  SO_TIMESTAMPNS, %d bytes, %s\n", (int)told->cmsg_len, labs(now.tv_sec - stamp->tv_sec) < 60 ? "now" : "another time");
        } else {
            printf("  level %d, type %d, %d bytes\n", told->cmsg_level, told->cmsg_type, (int)told->cmsg_len);
        }
    }
}

void own_frames(void)
{
    printf("# own frames\n");
    const int one = bound_socket(), other = bound_socket();
    const int off = 0, on = 1;
    put(one, 0x111, 1);
    message("of another socket", other, 16, 0);
    message("of itself", one, 16, 0);
    setsockopt(one, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on);
    put(one, 0x112, 1);
    message("of itself with RECV_OWN_MSGS", one, 16, 0);
    message("the other then", other, 16, 0);
    setsockopt(one, SOL_CAN_RAW, CAN_RAW_LOOPBACK, &off, sizeof off);
    put(one, 0x113, 1);
    message("without LOOPBACK the other", other, 16, 0);
    message("without LOOPBACK itself", one, 16, 0);

    const int any = socket(PF_CAN, SOCK_RAW, CAN_RAW), unbound = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    const struct sockaddr_can everywhere = address_of(0);
    bind(any, (const struct sockaddr *)&everywhere, sizeof everywhere);
    put(other, 0x114, 1);
    message("bound to any", any, 16, 0);
    message("not bound", unbound, 16, 0);
    close(any);
    close(unbound);
    close(one);
    close(other);
}

void sizes_and_addresses(void)
{
    printf("# sizes and addresses\n");
    const int one = bound_socket(), other = bound_socket(), unbound = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    static const size_t lengths[] = {0, 1, 5, 8, 15, 17, 32, 71, 72, 73};
    char bytes[128] = {0};
    for (size_t place = 0; place < sizeof lengths / sizeof lengths[0]; place++) {
        char what[32];
        snprintf(what, sizeof what, "write %zu", lengths[place]);
        answer(what, write(one, bytes, lengths[place]));
        snprintf(what, sizeof what, "send %zu", lengths[place]);
        answer(what, send(one, bytes, lengths[place], 0));
    }
    const int on = 1;
    setsockopt(one, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    answer("write 72 with FD_FRAMES", write(one, bytes, 72));
    // A frame of CAN XL: priority, the flag XLF, 64 bytes of data.
    bytes[0] = 1;
    bytes[4] = (char)0x80;
    bytes[6] = 64;
    answer("write a frame of CAN XL", write(one, bytes, 12 + 64));
    struct can_frame frame = frame_of(0x121, 9, 1);
    answer("write 9 bytes of data", write(one, &frame, sizeof frame));
    frame = frame_of(0x122, 8, 1);
    answer("write not bound", write(unbound, &frame, sizeof frame));

    struct sockaddr_can to = address_of(interface_index);
    const struct sockaddr *given = (struct sockaddr *)&to;
    answer("sendto not bound", sendto(unbound, &frame, sizeof frame, 0, given, sizeof to));
    answer("sendto of 5 bytes", sendto(unbound, &frame, 5, 0, given, sizeof to));
    answer("sendto with 7 bytes of address", sendto(unbound, &frame, sizeof frame, 0, given, 7));
    frame.can_dlc = 9;
    answer("sendto 9 bytes of data", sendto(unbound, &frame, sizeof frame, 0, given, sizeof to));
    frame.can_dlc = 8;
    to = address_of(99999);
    answer("sendto no interface", sendto(one, &frame, sizeof frame, 0, given, sizeof to));
    to = address_of(0);
    answer("sendto index 0", sendto(one, &frame, sizeof frame, 0, given, sizeof to));
    to.can_family = AF_INET;
    answer("sendto another family", sendto(one, &frame, sizeof frame, 0, given, sizeof to));
    to = address_of(interface_index);
    struct iovec parts[2] = {{&frame, 6}, {(char *)&frame + 6, 10}};
    struct msghdr header = {.msg_name = &to, .msg_namelen = sizeof to, .msg_iov = parts, .msg_iovlen = 2};
    frame.can_id = 0x123;
    answer("sendmsg in two parts", sendmsg(unbound, &header, 0));
    header.msg_name = NULL;
    header.msg_namelen = 0;
    answer("sendmsg not bound", sendmsg(unbound, &header, 0));
    parts[1].iov_len = 3;
    answer("sendmsg of 9 bytes", sendmsg(one, &header, 0));
    parts[1].iov_len = 10;
    struct mmsghdr many[3];
    memset(many, 0, sizeof many);
    for (int place = 0; place < 3; place++) {
        many[place].msg_hdr = header;
    }
    answer("sendmmsg of 3", sendmmsg(one, many, 3, 0));
    printf("  %u bytes\n", many[2].msg_len);
    struct iovec nowhere = {(void *)8, sizeof frame};
    answer("writev at a bad address", writev(one, &nowhere, 1));
    identifiers("what arrived", other);

    struct sockaddr_can from;
    socklen_t length = sizeof from;
    memset(&from, 0, sizeof from);
    put(one, 0x124, 1);
    readable(other, 1000);
    answer("recvfrom", recvfrom(other, &frame, sizeof frame, 0, (struct sockaddr *)&from, &length));
    printf("  family %d, %s, %d bytes\n", from.can_family, from.can_ifindex == interface_index ? "the index" : "another", (int)length);
    put(one, 0x125, 1);
    length = 4;
    readable(other, 1000);
    answer("recvfrom with 4 bytes of address", recvfrom(other, &frame, sizeof frame, 0, (struct sockaddr *)&from, &length));
    printf("  %d bytes\n", (int)length);
    close(unbound);
    close(one);
    close(other);
}

static void nothing(int signal)
{
    (void)signal;
}

static void *send_soon(void *argument)
{
    usleep(50000);
    put(*(int *)argument, 0x131, 1);
    return NULL;
}

static void *signal_soon(void *argument)
{
    usleep(100000);
    pthread_kill(*(pthread_t *)argument, SIGUSR1);
    return NULL;
}

void waiting(void)
{
    printf("# waiting\n");
    const int one = bound_socket(), other = bound_socket();
    struct can_frame frame;
    struct iovec part = {.iov_base = &frame, .iov_len = sizeof frame};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1};
    answer("poll", readable(other, 10));
    answer("recv, MSG_DONTWAIT", recv(other, &frame, sizeof frame, MSG_DONTWAIT));
    answer("recvmsg, MSG_DONTWAIT", recvmsg(other, &header, MSG_DONTWAIT));
    answer("recvmsg, MSG_ERRQUEUE", recvmsg(other, &header, MSG_ERRQUEUE));
    fcntl(other, F_SETFL, O_NONBLOCK);
    answer("read, O_NONBLOCK", read(other, &frame, sizeof frame));
    answer("recvmsg, O_NONBLOCK", recvmsg(other, &header, 0));
    fcntl(other, F_SETFL, 0);
    const struct timeval short_time = {0, 50000}, for_ever = {0, 0};
    setsockopt(other, SOL_SOCKET, SO_RCVTIMEO, &short_time, sizeof short_time);
    answer("read, SO_RCVTIMEO", read(other, &frame, sizeof frame));
    answer("recvmsg, SO_RCVTIMEO", recvmsg(other, &header, 0));
    setsockopt(other, SOL_SOCKET, SO_RCVTIMEO, &for_ever, sizeof for_ever);

    pthread_t helper, self = pthread_self();
    int sender = one;
    pthread_create(&helper, NULL, send_soon, &sender);
    answer("read that waits", read(other, &frame, sizeof frame));
    pthread_join(helper, NULL);
    pthread_create(&helper, NULL, send_soon, &sender);
    answer("recvmsg that waits", recvmsg(other, &header, 0));
    pthread_join(helper, NULL);
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = nothing;
    sigaction(SIGUSR1, &action, NULL);
    pthread_create(&helper, NULL, signal_soon, &self);
    answer("read and a signal", read(other, &frame, sizeof frame));
    pthread_join(helper, NULL);
    pthread_create(&helper, NULL, signal_soon, &self);
    answer("recvmsg and a signal", recvmsg(other, &header, 0));
    pthread_join(helper, NULL);
    put(one, 0x132, 1);
    message("the frame after the signal", other, 16, 0);

    put(one, 0x133, 1);
    struct timeval second = {1, 0};
    fd_set set;
    FD_ZERO(&set);
    FD_SET(other, &set);
    answer("select", select(other + 1, &set, NULL, NULL, &second));
    struct pollfd both = {.fd = other, .events = POLLIN | POLLOUT};
    poll(&both, 1, 1000);
    printf("poll: %#x\n", (unsigned)both.revents);
    const int events = epoll_create1(0);
    struct epoll_event event = {.events = EPOLLIN, .data.fd = other};
    epoll_ctl(events, EPOLL_CTL_ADD, other, &event);
    answer("epoll", epoll_wait(events, &event, 1, 1000));
    close(events);
    close(one);
    close(other);
}

void messages(void)
{
    printf("# messages\n");
    const int one = bound_socket(), other = bound_socket();
    struct can_frame frame;
    put(one, 0x141, 1);
    readable(other, 1000);
    answer("read of 8 bytes", read(other, &frame, 8));
    put(one, 0x142, 1);
    message("recvmsg of 8 bytes", other, 8, 0);
    put(one, 0x143, 1);
    readable(other, 1000);
    answer("recv, MSG_PEEK", recv(other, &frame, sizeof frame, MSG_PEEK));
    struct iovec parts[2] = {{&frame, 4}, {(char *)&frame + 4, 60}};
    struct msghdr header = {.msg_iov = parts, .msg_iovlen = 2};
    struct can_frame room[5];
    parts[1].iov_base = room;
    answer("recvmsg, MSG_PEEK", recvmsg(other, &header, MSG_PEEK));
    answer("recvmsg in two parts", recvmsg(other, &header, 0));
    printf("  %X,%s\n", frame.can_id, flags_of(header.msg_flags));
    answer("recv of what was read", recv(other, &frame, sizeof frame, MSG_DONTWAIT));
    put(one, 0x144, 1);
    put(one, 0x145, 2);
    put(one, 0x146, 3);
    usleep(50000);
    struct mmsghdr many[4];
    struct iovec each[4];
    struct sockaddr_can from[4];
    memset(many, 0, sizeof many);
    for (int place = 0; place < 4; place++) {
        each[place] = (struct iovec){&room[place], sizeof room[place]};
        many[place].msg_hdr = (struct msghdr){.msg_name = &from[place], .msg_namelen = sizeof from[place],
                                              .msg_iov = &each[place], .msg_iovlen = 1};
    }
    answer("recvmmsg", recvmmsg(other, many, 4, MSG_DONTWAIT, NULL));
    printf("  %X %X %X, %u bytes, family %d,%s\n", room[0].can_id, room[1].can_id, room[2].can_id, many[2].msg_len,
           from[2].can_family, flags_of(many[2].msg_hdr.msg_flags));
    answer("recvmmsg of none", recvmmsg(other, many, 4, MSG_DONTWAIT, NULL));
    put(one, 0x147, 1);
    readable(other, 1000);
    header.msg_iov = (struct iovec *)8;
    answer("recvmsg at a bad address", recvmsg(other, &header, 0));
    close(one);
    close(other);
}

void stamps_and_losses(void)
{
    printf("# stamps and losses\n");
    const int one = bound_socket(), other = bound_socket();
    const int on = 1, small = 4096;
    struct can_frame frame;
    struct timeval stamp;
    struct timespec fine;
    answer("SIOCGSTAMP before a frame", ioctl(other, SIOCGSTAMP, &stamp));
    put(one, 0x150, 1);
    readable(other, 1000);
    read(other, &frame, sizeof frame);
    answer("SIOCGSTAMP after a frame", ioctl(other, SIOCGSTAMP, &stamp));
    printf("  %s\n", labs(time(NULL) - stamp.tv_sec) < 60 ? "now" : "another time");
    answer("SIOCGSTAMPNS after a frame", ioctl(other, SIOCGSTAMPNS, &fine));
    printf("  %s\n", fine.tv_sec == stamp.tv_sec && fine.tv_nsec / 1000 == stamp.tv_usec ? "the same" : "another time");
    answer("set SO_TIMESTAMP", setsockopt(other, SOL_SOCKET, SO_TIMESTAMP, &on, sizeof on));
    put(one, 0x151, 1);
    message("with SO_TIMESTAMP", other, 16, 256);
    put(one, 0x152, 1);
    message("without room for it", other, 16, 0);
    answer("set SO_TIMESTAMPNS", setsockopt(other, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on));
    put(one, 0x153, 1);
    message("with SO_TIMESTAMPNS", other, 16, 256);

    const int lossy = bound_socket();
    setsockopt(lossy, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    setsockopt(lossy, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    for (int number = 0; number < 200; number++) {
        put(one, 0x160, number);
    }
    usleep(200000);
    int read_frames = 0, told = 0;
    while (readable(lossy, 0) == 1 && recv(lossy, &frame, sizeof frame, MSG_DONTWAIT) > 0) {
        read_frames++;
    }
    put(one, 0x161, 1);
    readable(lossy, 1000);
    char control[64];
    struct iovec part = {.iov_base = &frame, .iov_len = sizeof frame};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    answer("the frame after a loss", recvmsg(lossy, &header, 0));
    struct cmsghdr *loss = CMSG_FIRSTHDR(&header);
    if (loss != NULL && loss->cmsg_level == SOL_SOCKET && loss->cmsg_type == SO_RXQ_OVFL) {
        memcpy(&told, CMSG_DATA(loss), sizeof told);
        printf("  SO_RXQ_OVFL, %d bytes of %d\n", (int)loss->cmsg_len, (int)header.msg_controllen);
    }
    printf("some were read: %d, some lost: %d, none without a word: %d\n", read_frames > 0, told > 0, read_frames + told == 200);
    close(lossy);
    close(one);
    close(other);
}

static int give(int way, int can)
{
    char byte = 1, control[CMSG_SPACE(sizeof can)] = {0};
    struct iovec part = {&byte, 1};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    struct cmsghdr *rights = CMSG_FIRSTHDR(&header);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(sizeof can);
    memcpy(CMSG_DATA(rights), &can, sizeof can);
    return (int)sendmsg(way, &header, 0);
}

static int given(int way)
{
    int can = -1;
    char byte, control[CMSG_SPACE(sizeof can)];
    struct iovec part = {&byte, 1};
    struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    if (recvmsg(way, &header, 0) == 1 && CMSG_FIRSTHDR(&header) != NULL) {
        memcpy(&can, CMSG_DATA(CMSG_FIRSTHDR(&header)), sizeof can);
    }
    return can;
}

void descriptors(void)
{
    printf("# descriptors\n");
    const int one = bound_socket(), other = bound_socket();
    const int copy = dup(one), high = dup2(one, 700), way[2] = {0, 0};
    close(one);
    put(copy, 0x171, 1);
    put(high, 0x172, 1);
    fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
        struct sockaddr_can named = address_of(0);
        socklen_t length = sizeof named;
        const int bound = getsockname(copy, (struct sockaddr *)&named, &length) == 0 && named.can_ifindex == interface_index;
        put(copy, bound ? 0x173 : 0x7FF, 1);
        const int own = bound_socket();
        put(own, 0x174, 1);
        _exit(0);
    }
    waitpid(child, NULL, 0);
    close(copy);
    put(high, 0x175, 1);
    identifiers("copies and a child", other);

    socketpair(AF_UNIX, SOCK_DGRAM, 0, (int *)way);
    answer("SCM_RIGHTS", give(way[0], high));
    close(high);
    const int arrived = given(way[1]);
    put(arrived, 0x176, 1);
    identifiers("what was handed over", other);
    close(arrived);
    close(way[0]);
    close(way[1]);
    for (int round = 0; round < 300; round++) {
        const int made = bound_socket();
        close(made);
    }
    const int last = bound_socket();
    put(last, 0x177, 1);
    identifiers("after three hundred others", other);
    close(last);
    close(other);
}
