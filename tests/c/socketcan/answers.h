/* Prints what each system call of a SocketCAN program answers, a line each, the same on every interface that answers alike. */
#ifndef ANSWERS_H
#define ANSWERS_H

#include <linux/can.h>
#include <linux/can/bcm.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>

extern const char *interface_name;
extern int interface_index;

/* A line: what was called, and its result, with errno by name when it is -1. */
int answer(const char *what, long result);

/* A CAN_RAW socket bound to the interface, and one of the given kind that is not. */
int bound_socket(void);
struct sockaddr_can address_of(int index);

struct can_frame frame_of(canid_t id, int length, int first_byte);

/* Sends a frame natively, which must succeed. */
void put(int socket, canid_t id, int first_byte);

/* Waits up to so many ms until something can be received. */
int readable(int socket, int milliseconds);

/* Reads all frames that are there and prints their identifiers. */
void identifiers(const char *what, int socket);

void interfaces(void);
void making_and_binding(void);
void options(void);
void filters(void);
void own_frames(void);
void sizes_and_addresses(void);
void waiting(void);
void messages(void);
void stamps_and_losses(void);
void descriptors(void);
void broadcast_manager(void);
void transport_protocol(void);
void interface_down(void);

#endif
