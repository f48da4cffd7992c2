"""Writes as many ISO-TP messages to nobody as it can, and ends."""

import os, socket
can = socket.socket(socket.PF_CAN, socket.SOCK_DGRAM, socket.CAN_ISOTP)
can.bind(('vcan0', 0x7E8, 0x7E0))
can.setblocking(False)
accepted = 0
for _ in range(4):
    try:
        while True:
            os.write(can.fileno(), bytes(16))
            accepted += 1
    except BlockingIOError:
        can.getsockname()
print('accepted', accepted)
