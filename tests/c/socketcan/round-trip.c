/* Round trips of a frame between two programs: round-trip answer BUS, round-trip ask BUS COUNT. BUS is an interface, or, with a slash,
 * the socket of an embedded bus, spoken natively. Both read and write as most programs do. Prints percentiles in us. */
#define _GNU_SOURCE
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

enum { ASKED = 0x6E0, ANSWERED = 0x6E1, END = 0x6E2 };

static int open_bus(const char *bus, canid_t wanted)
{
    if (strchr(bus, '/') != NULL) {
        struct sockaddr_un address = {.sun_family = AF_UNIX};
        strncpy(address.sun_path, bus, sizeof address.sun_path - 1);
        const int made = socket(AF_UNIX, SOCK_SEQPACKET, 0);
        if (made < 0 || connect(made, (struct sockaddr *)&address, sizeof address) != 0) {
            perror(bus);
            exit(1);
        }
        return made;
    }
    const int made = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    struct sockaddr_can address;
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = (int)if_nametoindex(bus);
    const struct can_filter filters[] = {{wanted, CAN_SFF_MASK}, {END, CAN_SFF_MASK}};
    if (made < 0 || setsockopt(made, SOL_CAN_RAW, CAN_RAW_FILTER, filters, sizeof filters) != 0 ||
        bind(made, (struct sockaddr *)&address, sizeof address) != 0) {
        perror(bus);
        exit(1);
    }
    return made;
}

static void put(int bus, canid_t id, uint32_t number)
{
    struct can_frame frame = {.can_id = id, .can_dlc = 4};
    memcpy(frame.data, &number, sizeof number);
    if (write(bus, &frame, sizeof frame) != (ssize_t)sizeof frame) {
        perror("write");
        exit(1);
    }
}

static struct can_frame next(int bus)
{
    struct can_frame frame;
    if (read(bus, &frame, sizeof frame) != (ssize_t)sizeof frame) {
        perror("read");
        exit(1);
    }
    return frame;
}

static int by_size(const void *one, const void *other)
{
    const double difference = *(const double *)one - *(const double *)other;
    return (difference > 0) - (difference < 0);
}

static double now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
}

int main(int count, char **arguments)
{
    if (count == 3 && strcmp(arguments[1], "answer") == 0) {
        const int bus = open_bus(arguments[2], ASKED);
        fprintf(stderr, "ready\n");
        for (;;) {
            const struct can_frame frame = next(bus);
            uint32_t number;
            memcpy(&number, frame.data, sizeof number);
            if (frame.can_id == END) {
                return 0;
            }
            if (frame.can_id == ASKED) {
                put(bus, ANSWERED, number);
            }
        }
    }
    if (count != 4 || strcmp(arguments[1], "ask") != 0) {
        fprintf(stderr, "usage: round-trip answer BUS | round-trip ask BUS COUNT\n");
        return 2;
    }
    const int bus = open_bus(arguments[2], ANSWERED);
    const size_t trips = strtoul(arguments[3], NULL, 10);
    double *times = calloc(trips, sizeof *times);
    for (uint32_t number = 0; number < trips; number++) {
        const double began = now_us();
        put(bus, ASKED, number);
        for (;;) {
            const struct can_frame frame = next(bus);
            uint32_t answered;
            memcpy(&answered, frame.data, sizeof answered);
            if (frame.can_id == ANSWERED && answered == number) {
                break;
            }
        }
        times[number] = now_us() - began;
    }
    put(bus, END, 0);
    qsort(times, trips, sizeof *times, by_size);
    printf("%zu round trips, us: p50 %.1f, p90 %.1f, p99 %.1f, p99.9 %.1f, max %.1f\n", trips, times[trips / 2], times[trips * 9 / 10],
           times[trips * 99 / 100], times[trips * 999 / 1000], times[trips - 1]);
    return 0;
}
