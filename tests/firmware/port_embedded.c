/* The bus is airbench's embedded one, a Unix SEQPACKET socket: firmware-embedded /tmp/bus0
 *
 * A frame is the same struct can_frame as on SocketCAN; opening is all that differs. Waits ten seconds for the bus to come.
 */
#define _POSIX_C_SOURCE 200809L /* nanosleep */
#include "port.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

int port_open(const char *bus)
{
    const struct timespec pause = {.tv_sec = 0, .tv_nsec = 10 * 1000 * 1000};
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(bus) >= sizeof address.sun_path) {
        errno = ENAMETOOLONG;
        return -1;
    }
    strcpy(address.sun_path, bus);
    for (int tries = 0; tries < 1000; tries++) {
        const int unix_socket = socket(AF_UNIX, SOCK_SEQPACKET, 0);
        if (unix_socket < 0 || connect(unix_socket, (struct sockaddr *)&address, sizeof address) == 0) {
            return unix_socket;
        }
        close(unix_socket);
        nanosleep(&pause, NULL);
    }
    return -1;
}
