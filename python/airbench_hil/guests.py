"""When a program under `bench can` is ready: nobody on the bus can know, since its connection is made before it starts.

In lockstep the barrier begins when all are connected, and who was not there for the first cycle's sensors never answers them. So its
system calls are looked at (/proc/PID/task/*/syscall): a program of which a thread waits for input has opened what it waits on.
"""

from __future__ import annotations

import os
import platform
from pathlib import Path

#: read, poll, select, recvfrom, recvmsg, epoll_wait, pselect6, ppoll, epoll_pwait, recvmmsg, by architecture.
_WAITING = {
    "x86_64": {0, 7, 23, 45, 47, 232, 270, 271, 281, 299, 441},
    "aarch64": {63, 72, 73, 207, 212, 22, 243, 441},
}
#: So many looks in a row have to find it waiting.
LOOKS = 8


class Readiness:
    """The program that `bench can` runs."""

    def __init__(self, bench: int) -> None:
        """:param bench: process id of `bench can`."""
        self._bench, self._in_a_row = bench, 0

    def look(self) -> bool:
        """Whether it has been waiting for input in each of the last looks; to be asked some milliseconds apart."""
        guests = _children(self._bench)
        waiting = _WAITING.get(platform.machine(), set())
        self._in_a_row = self._in_a_row + 1 if guests and any(_system_calls(guest) & waiting for guest in guests) else 0
        return self._in_a_row >= LOOKS


def _children(pid: int) -> list[int]:
    found = []
    for entry in os.listdir("/proc"):
        if not entry.isdigit():
            continue
        try:
            parent = int(Path(f"/proc/{entry}/stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue  # it has ended meanwhile
        if parent == pid:
            found.append(int(entry))
    return found


def _system_calls(pid: int) -> set[int]:
    """Numbers of the system calls in which its threads wait; a thread that runs, or may not be looked at, has none."""
    found = set()
    for file in Path(f"/proc/{pid}/task").glob("*/syscall"):
        try:
            word = file.read_text().split()[0]
        except (OSError, IndexError):
            continue
        found |= {int(word)} if word.isdigit() else set()
    return found
