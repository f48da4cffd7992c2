/* Frames with numbers, through any bus: frame-flow send INTERFACE COUNT FRAMES-A-SECOND, frame-flow receive INTERFACE COUNT.
 *
 * The receiver counts frames out of order, those that its queue lost (SO_RXQ_OVFL), and those that are missing besides, and prints
 * its resident memory at a tenth and at the end. It ends with a frame that the sender puts behind all others, several times. */
#define _GNU_SOURCE
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

enum { IDENTIFIER = 0x6F0, LAST = 0x6F1, REPEATS = 20 };

static int bound(const char *interface, canid_t id)
{
    const int can = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    struct sockaddr_can address;
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = (int)if_nametoindex(interface);
    const struct can_filter wanted = {.can_id = id, .can_mask = id == 0 ? CAN_SFF_MASK : 0x7FE};
    const int on = 1;
    if (can < 0 || setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, &wanted, sizeof wanted) != 0 ||
        setsockopt(can, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) != 0 ||
        bind(can, (struct sockaddr *)&address, sizeof address) != 0) {
        perror(interface);
        exit(1);
    }
    return can;
}

static void put(int can, canid_t id, uint64_t number)
{
    struct can_frame frame = {.can_id = id, .can_dlc = 8};
    memcpy(frame.data, &number, sizeof number);
    if (write(can, &frame, sizeof frame) != (ssize_t)sizeof frame) {
        perror("write");
        exit(1);
    }
}

static int send_all(const char *interface, uint64_t count, uint64_t rate)
{
    const int can = bound(interface, 0);
    struct timespec due;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (uint64_t number = 0; number < count; number++) {
        /* Ten at a time, by absolute time. */
        if (rate > 0 && number % 10 == 0) {
            due.tv_nsec += (long)(10 * 1000000000ULL / rate);
            due.tv_sec += due.tv_nsec / 1000000000;
            due.tv_nsec %= 1000000000;
            clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        }
        put(can, IDENTIFIER, number);
    }
    /* The last frame could be lost as any other. */
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        usleep(50000);
        put(can, LAST, count);
    }
    return 0;
}

static long resident_kib(void)
{
    long pages = 0, resident = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file == NULL || fscanf(file, "%ld %ld", &pages, &resident) != 2) {
        resident = -1;
    }
    if (file != NULL) {
        fclose(file);
    }
    return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

static int receive_all(const char *interface, uint64_t count)
{
    const int can = bound(interface, IDENTIFIER);
    uint64_t received = 0, out_of_order = 0, next = 0;
    uint32_t lost = 0;
    long at_a_tenth = 0;
    fprintf(stderr, "ready\n");
    for (;;) {
        struct can_frame frame;
        char control[64];
        struct iovec part = {.iov_base = &frame, .iov_len = sizeof frame};
        struct msghdr header = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
        if (recvmsg(can, &header, 0) != (ssize_t)sizeof frame) {
            perror("recvmsg");
            return 1;
        }
        for (struct cmsghdr *told = CMSG_FIRSTHDR(&header); told != NULL; told = CMSG_NXTHDR(&header, told)) {
            if (told->cmsg_level == SOL_SOCKET && told->cmsg_type == SO_RXQ_OVFL) {
                memcpy(&lost, CMSG_DATA(told), sizeof lost);
            }
        }
        if (frame.can_id == LAST) {
            break;
        }
        uint64_t number;
        memcpy(&number, frame.data, sizeof number);
        out_of_order += number < next;
        next = number + 1;
        if (++received == count / 10) {
            at_a_tenth = resident_kib();
        }
    }
    printf("received %llu of %llu, out of order %llu, lost at its queue %lu, missing elsewhere %lld, memory %ld then %ld KiB\n",
           (unsigned long long)received, (unsigned long long)count, (unsigned long long)out_of_order, (unsigned long)lost,
           (long long)(count - received - lost), at_a_tenth, resident_kib());
    return 0;
}

int main(int count, char **arguments)
{
    if (count == 5 && strcmp(arguments[1], "send") == 0) {
        return send_all(arguments[2], strtoull(arguments[3], NULL, 10), strtoull(arguments[4], NULL, 10));
    }
    if (count == 4 && strcmp(arguments[1], "receive") == 0) {
        return receive_all(arguments[2], strtoull(arguments[3], NULL, 10));
    }
    fprintf(stderr, "usage: frame-flow send INTERFACE COUNT FRAMES-A-SECOND | frame-flow receive INTERFACE COUNT\n");
    return 2;
}
