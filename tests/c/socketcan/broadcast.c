/* CAN_BCM: cyclic sending, changes, time-outs. Times are only told apart by their order. */
#define _GNU_SOURCE
#include "answers.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct command {
    struct bcm_msg_head head;
    struct can_frame frames[4];
};

static struct command command_of(unsigned opcode, unsigned flags, canid_t id, unsigned frames)
{
    struct command command;
    memset(&command, 0, sizeof command);
    command.head.opcode = opcode;
    command.head.flags = flags;
    command.head.can_id = id;
    command.head.nframes = frames;
    for (unsigned place = 0; place < frames && place < 4; place++) {
        command.frames[place] = frame_of(id, 2, (int)place + 1);
    }
    return command;
}

static size_t bytes_of(const struct command *command)
{
    return sizeof command->head + command->head.nframes * sizeof command->frames[0];
}

static void give(const char *what, int manager, const struct command *command)
{
    answer(what, send(manager, command, bytes_of(command), 0));
}

/* The next message of the manager. */
static void hear(const char *what, int manager)
{
    struct command told;
    struct sockaddr_can from;
    socklen_t length = sizeof from;
    memset(&told, 0, sizeof told);
    if (readable(manager, 500) != 1) {
        printf("%s: nothing\n", what);
        return;
    }
    answer(what, recvfrom(manager, &told, sizeof told, 0, (struct sockaddr *)&from, &length));
    printf("  opcode %u, flags %#x, count %u, id %X, %u frames, first byte %u, %s, %d bytes\n", told.head.opcode, told.head.flags,
           told.head.count, told.head.can_id, told.head.nframes, told.head.nframes > 0 ? told.frames[0].data[0] : 0,
           from.can_ifindex == interface_index ? "the index" : "another", (int)length);
}

/* The data of the next frames on the bus, as many as there should be. */
static void bytes(const char *what, int can, int count)
{
    struct can_frame frame;
    printf("%s:", what);
    for (int number = 0; number < count && readable(can, 1000) == 1; number++) {
        if (recv(can, &frame, sizeof frame, 0) == (ssize_t)sizeof frame) {
            printf(" %X#%u", frame.can_id, frame.data[0]);
        }
    }
    printf("\n");
}

static void drain(int can)
{
    struct can_frame frame;
    while (readable(can, 50) == 1 && recv(can, &frame, sizeof frame, MSG_DONTWAIT) > 0) {
    }
}

/* Reads frames until one has this first byte. */
static void until(int can, int first_byte)
{
    struct can_frame frame = frame_of(0, 1, first_byte + 1);
    while (frame.data[0] != first_byte && readable(can, 1000) == 1 && recv(can, &frame, sizeof frame, 0) > 0) {
    }
}

static void sending(int manager, int can)
{
    struct command command = command_of(TX_SEND, 0, 0x201, 1);
    give("TX_SEND", manager, &command);
    command = command_of(TX_SEND, 0, 0x201, 2);
    give("TX_SEND of 2", manager, &command);
    bytes("sent", can, 1);

    command = command_of(TX_SETUP, SETTIMER | STARTTIMER, 0x202, 1);
    command.head.ival2.tv_usec = 20000;
    give("TX_SETUP", manager, &command);
    bytes("sent", can, 3);
    command = command_of(TX_SETUP, 0, 0x202, 1);
    command.frames[0].data[0] = 9;
    give("TX_SETUP with other data", manager, &command);
    until(can, 9);
    bytes("sent", can, 2);
    command = command_of(TX_READ, 0, 0x202, 0);
    give("TX_READ", manager, &command);
    hear("TX_STATUS", manager);
    command = command_of(TX_DELETE, 0, 0x202, 0);
    give("TX_DELETE", manager, &command);
    drain(can);
    bytes("sent", can, 0);
    give("TX_DELETE again", manager, &command);
    command = command_of(TX_READ, 0, 0x202, 0);
    give("TX_READ of none", manager, &command);

    command = command_of(TX_SETUP, SETTIMER | STARTTIMER | TX_COUNTEVT, 0x203, 3);
    command.head.count = 4;
    command.head.ival1.tv_usec = 10000;
    give("TX_SETUP of 3 frames, 4 times", manager, &command);
    bytes("sent", can, 5);
    hear("TX_EXPIRED", manager);
    command = command_of(TX_SETUP, SETTIMER, 0x203, 4);
    give("TX_SETUP of more frames", manager, &command);
    command = command_of(TX_SETUP, TX_CP_CAN_ID | TX_ANNOUNCE, 0x203, 2);
    command.frames[0].can_id = 0x7FF;
    give("TX_SETUP with TX_CP_CAN_ID", manager, &command);
    bytes("sent", can, 1);
    command = command_of(TX_DELETE, 0, 0x203, 0);
    give("TX_DELETE", manager, &command);
    command = command_of(TX_SETUP, SETTIMER | STARTTIMER, 0x204, 1);
    command.frames[0].can_dlc = 9;
    give("TX_SETUP of 9 bytes of data", manager, &command);
    command = command_of(TX_SETUP, SETTIMER | STARTTIMER, 0x204, 1);
    command.head.ival2.tv_usec = 1000000;
    give("TX_SETUP of a time that is none", manager, &command);
    command = command_of(TX_SETUP, SETTIMER | STARTTIMER, 0x204, 0);
    give("TX_SETUP of no frame", manager, &command);
}

static void watching(int manager, int can)
{
    struct command command = command_of(RX_SETUP, 0, 0x211, 0);
    give("RX_SETUP by identifier", manager, &command);
    put(can, 0x211, 1);
    hear("RX_CHANGED", manager);
    put(can, 0x211, 1);
    hear("the same again", manager);
    put(can, 0x212, 1);
    hear("another identifier", manager);
    put(can, 0x211 | CAN_EFF_FLAG, 1);
    hear("an extended one", manager);
    command = command_of(RX_DELETE, 0, 0x211, 0);
    give("RX_DELETE", manager, &command);
    put(can, 0x211, 2);
    hear("after it", manager);
    give("RX_DELETE again", manager, &command);

    command = command_of(RX_SETUP, SETTIMER | STARTTIMER, 0x213, 1);
    command.head.ival1.tv_usec = 60000;
    command.frames[0].data[0] = 0xF0;
    give("RX_SETUP with a mask and a time-out", manager, &command);
    hear("silence", manager);
    hear("no second one", manager);
    put(can, 0x213, 0x11);
    hear("the first", manager);
    put(can, 0x213, 0x12);
    hear("one outside the mask, then silence", manager);
    put(can, 0x213, 0x22);
    hear("one inside the mask", manager);
    hear("silence again", manager);
    command = command_of(RX_READ, 0, 0x213, 0);
    give("RX_READ", manager, &command);
    hear("RX_STATUS", manager);
    command = command_of(RX_DELETE, 0, 0x213, 0);
    give("RX_DELETE", manager, &command);

    command = command_of(RX_SETUP, SETTIMER, 0x214, 1);
    command.head.ival2.tv_usec = 100000;
    command.frames[0].data[0] = 0xFF;
    give("RX_SETUP with a shortest interval", manager, &command);
    put(can, 0x214, 1);
    hear("the first", manager);
    put(can, 0x214, 2);
    put(can, 0x214, 3);
    hear("the last of two", manager);
    hear("nothing more", manager);
    command = command_of(RX_SETUP, RX_RTR_FRAME, 0x215 | CAN_RTR_FLAG, 1);
    give("RX_SETUP that answers requests", manager, &command);
    put(can, 0x215 | CAN_RTR_FLAG, 0);
    bytes("the answer", can, 1);
    command = command_of(RX_SETUP, RX_RTR_FRAME, 0x216, 1);
    give("RX_SETUP that answers no request", manager, &command);
}

void broadcast_manager(void)
{
    printf("# broadcast manager\n");
    const int manager = socket(PF_CAN, SOCK_DGRAM, CAN_BCM), can = bound_socket();
    const struct sockaddr_can address = address_of(interface_index), none = address_of(99999);
    struct sockaddr_can named;
    socklen_t length = sizeof named;
    struct command command = command_of(TX_SEND, 0, 0x200, 1);
    give("not connected", manager, &command);
    answer("bind", bind(manager, (const struct sockaddr *)&address, sizeof address));
    answer("getsockname", getsockname(manager, (struct sockaddr *)&named, &length));
    answer("setsockopt", setsockopt(manager, SOL_CAN_RAW, CAN_RAW_LOOPBACK, &length, sizeof length));
    answer("connect to none", connect(manager, (const struct sockaddr *)&none, sizeof none));
    answer("connect with 7 bytes", connect(manager, (const struct sockaddr *)&address, 7));
    answer("connect", connect(manager, (const struct sockaddr *)&address, sizeof address));
    answer("connect again", connect(manager, (const struct sockaddr *)&address, sizeof address));
    answer("55 bytes", send(manager, &command, 55, 0));
    answer("61 bytes", send(manager, &command, 61, 0));
    answer("one frame missing", send(manager, &(struct command){.head = {.opcode = TX_SETUP, .nframes = 2}}, 72, 0));
    command = command_of(99, 0, 0x200, 0);
    give("an unknown command", manager, &command);
    answer("write of 72 bytes", write(manager, &(struct command){.head = {.opcode = TX_SEND, .nframes = 1, .can_id = 0x200},
                                                               .frames = {{.can_id = 0x200}}}, 72));
    bytes("sent", can, 1);
    sending(manager, can);
    watching(manager, can);
    close(manager);
    drain(can);
    close(can);
}
