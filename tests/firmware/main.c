/* The program for Linux: the name of a bus on the command line, messages on standard error. It ends when the bus does. */
#include "loop.h"
#include "port.h"

#include <stdio.h>

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "usage: %s BUS, the name of a CAN interface or the path of an embedded bus\n", argv[0]);
        return 2;
    }
    if (!port_init(argv[1])) {
        return 3;
    }
    loop_run();
    return 0;
}
