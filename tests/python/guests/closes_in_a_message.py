"""Closes a socket in the middle of a message to nobody; another of the channel must not break into it."""

import ctypes, errno, os, socket
def channel():
    can = socket.socket(socket.PF_CAN, socket.SOCK_DGRAM, socket.CAN_ISOTP)
    can.bind(('vcan0', 0x7E8, 0x7E0))
    can.setblocking(False)
    return can
first = channel()
os.write(first.fileno(), bytes(20))
first.close()
second = channel()
try:
    print('second', os.write(second.fileno(), bytes(20)))
except BlockingIOError:
    print('second waits its turn')
libc = ctypes.CDLL(None, use_errno=True)
headers = bytes(64)
print('sendmmsg of none', libc.sendmmsg(second.fileno(), headers, 0, 0))
libc.recvmmsg(second.fileno(), headers, 1, 0x10000 | socket.MSG_DONTWAIT, None)
print('recvmmsg for one', errno.errorcode[ctypes.get_errno()])
