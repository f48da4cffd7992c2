"""Fills the bus, and then writes ISO-TP messages of 8 and 16 bytes, which are native: a broadcast, so that nobody need answer."""

import errno, os, socket, struct, sys
raw = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
raw.bind(('vcan0',))
can = socket.socket(socket.PF_CAN, socket.SOCK_DGRAM, socket.CAN_ISOTP)
can.setsockopt(106, 1, struct.pack('IIBBBB', 0x1000, 0, 0, 0, 0, 0))
can.bind(('vcan0', 0x7E8, 0x7E0))
print('ready', flush=True)
sys.stdin.readline()
try:
    while True:
        raw.sendto(struct.pack('=IB3x8s', 0x7F7, 8, bytes(8)), ('vcan0',))
except OSError as refused:
    print('refused with', errno.errorcode[refused.errno], flush=True)
for number in range(40):
    os.write(can.fileno(), bytes([number]) * (8 if number % 3 == 0 else 16))
can.getsockname()
print('written', flush=True)
sys.stdin.readline()
os.write(can.fileno(), bytes([40]) * 8)
