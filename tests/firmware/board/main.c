/* The program on the board: a bus that cannot be had is a board that stays silent. */
#include "loop.h"
#include "port.h"

int main(void)
{
    if (port_init("can1")) {
        loop_run();
    }
    return 0;
}
