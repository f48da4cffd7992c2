"""The processes of a rig, started through a guard (guard.py) that outlives this process by what it takes to end them."""

from __future__ import annotations

import json
import os
import secrets
import select
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from airbench_hil.errors import AirbenchError, ProgramFailed

_SAID_LINES = 20
#: Bytes of a folder in which a folder with a socket has a place.
_LONGEST = 70


class Processes:
    """Programs by name, their exit codes, and what they said."""

    def __init__(self, private: Path, output: Path) -> None:
        """Starts the guard, and waits until it has made the folder.

        :param private: a folder that the guard makes, and removes when all is over, however it ended: bus, telemetry, locks.
        :param output: where NAME.txt and NAME.err of each program are written.
        :raises AirbenchError: the folder cannot be made.
        """
        self.output = output
        ours, theirs = socket.socketpair()
        guard = Path(__file__).with_name("guard.py")
        self._guard = subprocess.Popen(
            [sys.executable, "-I", "-S", str(guard), str(theirs.fileno()), str(os.getpid()), str(private)],
            pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True,
        )
        theirs.close()
        self._socket, self._buffer, self._over = ours, b"", False
        self._poll = select.poll()
        self._poll.register(ours, select.POLLIN)
        #: Exit codes of those that have ended; negative: the signal.
        self.ended: dict[str, int] = {}
        self.pids: dict[str, int] = {}
        event = self._event(30.0)
        if event is None or "ready" not in event:
            why = event.get("why") if event else "the guard of the rig's processes does not answer"
            self._guard.kill()
            self._guard.wait()
            raise AirbenchError(f"{private}: {why}")

    def start(self, name: str, words: list[str], env: dict[str, str] | None = None, cwd: Path | None = None) -> None:
        """Starts a program.

        :raises ProgramFailed: it cannot be started.
        """
        self._say({
            "do": "start", "name": name, "words": words, "env": env, "cwd": str(cwd) if cwd else None,
            "out": str(self.output / f"{name}.txt"), "err": str(self.output / f"{name}.err"),
        })
        while True:
            event = self._event(10.0)
            if event is None:
                raise AirbenchError("the guard of the rig's processes does not answer")
            if event.get("started") == name:
                return
            if event.get("failed") == name:
                raise ProgramFailed(name, 127, event["why"])

    def running(self, name: str) -> bool:
        """Whether it has not ended yet."""
        self.look()
        return name in self.pids and name not in self.ended

    def look(self) -> None:
        """Takes what the guard has said."""
        while self._event(0.0) is not None:
            pass

    def wait(self, names: list[str], timeout_s: float) -> bool:
        """Waits until these have ended; False when they have not within that wall time, s."""
        until = time.monotonic() + timeout_s
        self.look()
        while any(name in self.pids and name not in self.ended for name in names):
            left = until - time.monotonic()
            if left <= 0:
                return False
            self._event(left)
        return True

    def signal(self, name: str, number: int) -> None:
        """Sends a signal to a program."""
        self._say({"do": "signal", "name": name, "signal": number})

    def close(self, grace_s: float) -> None:
        """Ends all of them: SIGTERM, and SIGKILL after that time, s. To close twice does nothing."""
        if self._over:
            return
        try:
            self._say({"do": "end", "grace_s": grace_s})
            while not self._over and self._event(grace_s + 30.0) is not None:
                pass
        except AirbenchError:
            pass  # it is gone, and with it all that it started
        self._over = True
        self._socket.close()
        try:
            self._guard.wait(5.0)
        except subprocess.TimeoutExpired:
            self._guard.kill()
            self._guard.wait()

    def said(self, name: str) -> str:
        """The last lines of its standard error."""
        try:
            text = (self.output / f"{name}.err").read_text(errors="replace")
        except OSError:
            return ""
        return "\n".join(text.strip().splitlines()[-_SAID_LINES:])

    def _say(self, words: dict[str, Any]) -> None:
        try:
            self._socket.sendall(json.dumps(words).encode() + b"\n")
        except OSError as error:
            raise AirbenchError(f"the guard of the rig's processes is gone: {error}") from error

    def _event(self, timeout_s: float) -> dict[str, Any] | None:
        while b"\n" not in self._buffer:
            if not self._poll.poll(timeout_s * 1000):
                return None
            read = self._socket.recv(65536)
            if not read:
                raise AirbenchError("the guard of the rig's processes is gone")
            self._buffer += read
        line, _, self._buffer = self._buffer.partition(b"\n")
        event: dict[str, Any] = json.loads(line)
        if "started" in event:
            self.pids[event["started"]] = event["pid"]
            self.ended.pop(event["started"], None)
        elif "ended" in event:
            self.ended[event["ended"]] = event["code"]
        elif "over" in event:
            self._over = True
        return event


def private_folder() -> Path:
    """Where a folder for sockets will be, whose paths have 107 bytes at most: where a long one is set for temporary files, /tmp.

    The guard makes it: who is killed before there is one leaves nothing behind.
    """
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    places = [runtime if os.path.isabs(runtime) and os.access(runtime, os.W_OK) else tempfile.gettempdir(), "/tmp"]
    return Path(next((each for each in places if len(each) <= _LONGEST), "/tmp"), f"airbench-rig-{secrets.token_hex(4)}")
