"""Waits for a frame, and then leaves in 16 bytes, which are written natively, how `recvmsg` and the next call ended."""

import errno, os, socket, sys
can = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
can.bind(('vcan0',))
left = os.open(sys.argv[1], os.O_WRONLY | os.O_CREAT)
def ended(call):
    try:
        return str(call())
    except OSError as refused:
        return errno.errorcode[refused.errno]
print('waits', flush=True)
first = ended(lambda: can.recvmsg(16))
second = ended(lambda: socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW))
os.write(left, f'{first} {second}'.ljust(16).encode())
