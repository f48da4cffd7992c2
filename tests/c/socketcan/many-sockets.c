/* A guest that opens many sockets: many-sockets INTERFACE PROCESSES SOCKETS; each process opens so many, all are sent one frame. */
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

static int bound(const char *interface)
{
    const int can = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    struct sockaddr_can address;
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = (int)if_nametoindex(interface);
    const struct can_filter wanted = {.can_id = 0x7F6, .can_mask = CAN_SFF_MASK};
    if (can < 0 || bind(can, (struct sockaddr *)&address, sizeof address) != 0 ||
        setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, &wanted, sizeof wanted) != 0) {
        perror(interface);
        exit(1);
    }
    return can;
}

int main(int count, char **arguments)
{
    if (count != 4) {
        fprintf(stderr, "usage: many-sockets INTERFACE PROCESSES SOCKETS\n");
        return 2;
    }
    const int processes = atoi(arguments[2]), sockets = atoi(arguments[3]);
    int ready[2];
    if (pipe(ready) != 0) {
        return 1;
    }
    for (int process = 0; process < processes; process++) {
        if (fork() == 0) {
            int own[256];
            for (int place = 0; place < sockets && place < 256; place++) {
                own[place] = bound(arguments[1]);
            }
            if (write(ready[1], "r", 1) != 1) {
                _exit(1);
            }
            for (int place = 0; place < sockets && place < 256; place++) {
                struct can_frame frame;
                if (read(own[place], &frame, sizeof frame) != (ssize_t)sizeof frame) {
                    _exit(1);
                }
            }
            _exit(0);
        }
    }
    char byte;
    for (int process = 0; process < processes; process++) {
        if (read(ready[0], &byte, 1) != 1) {
            return 1;
        }
    }
    const int sender = bound(arguments[1]);
    const struct can_frame frame = {.can_id = 0x7F6, .can_dlc = 1, .data = {1}};
    if (write(sender, &frame, sizeof frame) != (ssize_t)sizeof frame) {
        perror("write");
        return 1;
    }
    int good = 0, status;
    while (wait(&status) > 0) {
        good += WIFEXITED(status) && WEXITSTATUS(status) == 0;
    }
    printf("%d sockets, each has received\n", good * sockets);
    return good == processes ? 0 : 1;
}
