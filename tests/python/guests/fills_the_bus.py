"""Sends by an address until the bus takes no more, then natively until its own queue does not."""

import errno, socket, struct, sys
can = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
can.bind(('vcan0',))
frame = struct.pack('=IB3x8s', 0x7F7, 8, bytes(8))
print('ready', flush=True)
sys.stdin.readline()
addressed, native = 0, 0
try:
    while True:
        can.sendto(frame, ('vcan0',))
        addressed += 1
except OSError as refused:
    print('refused with', errno.errorcode[refused.errno], flush=True)
can.setblocking(False)
try:
    while True:
        can.send(frame)
        native += 1
except BlockingIOError:
    print('accepted', addressed + native, 'of them natively', native, flush=True)
sys.stdin.readline()
