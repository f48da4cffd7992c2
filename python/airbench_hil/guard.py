"""The guard of a rig's processes, a process of its own: when whoever asked for it is gone, however it went, nothing is left.

Started as a file with the standard library alone: `python -I -S guard.py SOCKET PARENT FOLDER`. It makes FOLDER, says
{"ready": true}, or {"why"} and ends, and reads lines of JSON:

    {"do": "start", "name", "words", "env", "cwd", "out", "err"}    →  {"started": name, "pid"} or {"failed": name, "why"}
    {"do": "signal", "name", "signal"}                              →  nothing
    {"do": "end", "grace_s"}                                        →  {"over": true}, and it ends
                                                                       {"ended": name, "code"} whenever one ends

It ends what it started when the socket closes, when the parent ends, or on SIGTERM: SIGTERM to each, which saves what it has, and
SIGKILL to whatever is left, grandchildren too, since orphans become its own children (PR_SET_CHILD_SUBREAPER). Then it removes FOLDER,
where bus and lock files lie. Should the guard itself be killed, its children are by the kernel (PR_SET_PDEATHSIG).
"""

import ctypes
import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import time
from typing import Any, Dict, List

_SET_PDEATHSIG, _SET_CHILD_SUBREAPER = 1, 36
#: How long programs have to save what they have when nobody waits for them any more, s.
_GRACE_S = 3.0
#: ... and for SIGKILL to have ended them, s.
_KILL_S = 3.0
_libc = ctypes.CDLL(None, use_errno=True)


def _dies_with_guard(guard: int) -> None:
    _libc.prctl(_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != guard:
        os._exit(1)  # it was killed before this was said
    for each in (signal.SIGINT, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(each, signal.SIG_DFL)


class Guard:
    """The processes of one rig."""

    def __init__(self, control: socket.socket, folder: str) -> None:
        self.control, self.folder = control, folder
        self.children: Dict[int, str] = {}
        self.popens: Dict[int, "subprocess.Popen[bytes]"] = {}
        self.buffer = b""

    def say(self, words: Dict[str, Any]) -> None:
        """Answers the one who asked, if he is still there."""
        try:
            self.control.sendall(json.dumps(words).encode() + b"\n")
        except OSError:
            pass  # what follows is the end, which the closed socket brings

    def start(self, asked: Dict[str, Any]) -> None:
        """Starts a program with its output in files."""
        name, guard = asked["name"], os.getpid()
        try:
            with open(asked["out"], "ab") as out, open(asked["err"], "ab") as err:
                child = subprocess.Popen(
                    asked["words"], stdin=subprocess.DEVNULL, stdout=out, stderr=err, env=asked["env"], cwd=asked["cwd"],
                    preexec_fn=lambda: _dies_with_guard(guard), start_new_session=True,
                )
        except OSError as error:
            self.say({"failed": name, "why": f"{error.strerror}: {asked['words'][0]}"})
            return
        # An object that is dropped would collect its process itself, now or later.
        self.popens[child.pid] = child
        self.children[child.pid] = name
        self.say({"started": name, "pid": child.pid})

    def reap(self) -> None:
        """Collects who has ended, adopted ones as well."""
        while True:
            try:
                pid, status = os.waitpid(-1, os.WNOHANG)
            except ChildProcessError:
                return
            if pid == 0:
                return
            name, code = self.children.pop(pid, None), os.waitstatus_to_exitcode(status)
            if name is not None:
                self.popens.pop(pid).returncode = code
                self.say({"ended": name, "code": code})

    def signal_all(self, number: int) -> None:
        """Sends a signal to everything that was started, and to what it started."""
        for pid in set(self.children) | set(_descendants()):
            try:
                os.kill(pid, number)
            except (ProcessLookupError, PermissionError):
                pass  # it has ended, or became another user's

    def end(self, grace_s: float) -> None:
        """Ends all of them."""
        until = time.monotonic() + grace_s
        self.reap()
        if grace_s > 0:
            self.signal_all(signal.SIGTERM)
        while time.monotonic() < until and (self.children or _descendants()):
            time.sleep(0.01)
            self.reap()
        # Not for ever: whoever became another user's, or stands in the kernel, cannot be ended.
        until = time.monotonic() + _KILL_S
        while time.monotonic() < until and _descendants():
            self.signal_all(signal.SIGKILL)
            time.sleep(0.005)
            self.reap()
        shutil.rmtree(self.folder, ignore_errors=True)

    def take(self) -> bool:
        """Reads and obeys; False when it is over."""
        try:
            read = self.control.recv(65536)
        except OSError:
            read = b""
        if not read:
            self.end(_GRACE_S)
            return False
        *lines, self.buffer = (self.buffer + read).split(b"\n")
        for line in lines:
            asked = json.loads(line)
            if asked["do"] == "start":
                self.start(asked)
            elif asked["do"] == "signal":
                for pid in [pid for pid, name in self.children.items() if name == asked["name"]]:
                    try:
                        os.kill(pid, asked["signal"])
                    except (ProcessLookupError, PermissionError):
                        pass
            else:
                self.end(asked["grace_s"])
                self.say({"over": True})
                return False
        return True


def _descendants() -> List[int]:
    """Processes whose parent is this one, and theirs."""
    parents: Dict[int, List[int]] = {}
    for entry in os.listdir("/proc"):
        if not entry.isdigit():
            continue
        try:
            with open(f"/proc/{entry}/stat", "rb") as file:
                state, parent = file.read().rpartition(b")")[2].split()[:2]
        except OSError:
            continue  # it has ended meanwhile
        if state != b"Z":
            parents.setdefault(int(parent), []).append(int(entry))
    found: List[int] = []
    wanted = [os.getpid()]
    while wanted:
        children = parents.get(wanted.pop(), [])
        found += children
        wanted += children
    return found


def main() -> None:
    """The process."""
    descriptor, parent, folder = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    _libc.prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    for each in (signal.SIGINT, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(each, signal.SIG_IGN)
    wake_read, wake_write = os.pipe()
    os.set_blocking(wake_write, False)
    signal.set_wakeup_fd(wake_write, warn_on_full_buffer=False)
    ended: List[int] = []
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.signal(signal.SIGTERM, lambda *_: ended.append(1))
    guard = Guard(socket.socket(fileno=descriptor), folder)
    try:
        os.mkdir(folder, 0o700)
    except OSError as error:
        guard.say({"why": error.strerror})
        return
    guard.say({"ready": True})
    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    poll.register(wake_read, select.POLLIN)
    try:
        # A child that the parent forked may hold the socket open; the parent's end shows here all the same.
        parent_fd = os.pidfd_open(parent)
        poll.register(parent_fd, select.POLLIN)
    except ProcessLookupError:
        ended.append(1)
    except (OSError, AttributeError):
        pass  # a kernel before 5.3, or one that forbids it: the closed socket shows it
    while not ended:
        for at, _ in poll.poll():
            if at == wake_read:
                os.read(wake_read, 4096)
                guard.reap()
            elif at == descriptor:
                if not guard.take():
                    return
            else:
                ended.append(1)
    guard.end(_GRACE_S)


if __name__ == "__main__":
    main()
