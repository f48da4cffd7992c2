/* The bus is a SocketCAN interface: firmware-socketcan vcan0 */
#include "port.h"

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

int port_open(const char *bus)
{
    const int can = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(bus)};
    if (can >= 0 && (address.can_ifindex == 0 || bind(can, (struct sockaddr *)&address, sizeof address) != 0)) {
        close(can);
        return -1;
    }
    return can;
}
