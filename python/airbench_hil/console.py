"""The rig's console over its telemetry: commands of a person, each with its answer (runlog/src/telemetry.rs).

Whoever has the answer knows that the command waits for the rig's next cycle: in lockstep it acts in a definite one.
"""

from __future__ import annotations

import json
import socket
import struct
from pathlib import Path

from airbench_hil.errors import Refused, RigEnded

_HEAD = struct.Struct("<IB")
_ANSWER = 5
_PATIENCE_S = 10.0


def command(path: Path, line: str) -> str:
    """Gives the console a line, and what it answers.

    :raises Refused: it does not obey; the text says what is allowed.
    :raises RigEnded: nobody is there any more.
    """
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as viewer:
            viewer.settimeout(_PATIENCE_S)
            viewer.connect(str(path))
            viewer.sendall(line.encode() + b"\n")
            stream = viewer.makefile("rb")
            while True:
                head = stream.read(_HEAD.size)
                if len(head) < _HEAD.size:
                    raise RigEnded(f"'{line}': the rig has ended")
                length, kind = _HEAD.unpack(head)
                payload = stream.read(length)
                if kind == _ANSWER:
                    answer = json.loads(payload)
                    break
    except OSError as error:
        raise RigEnded(f"'{line}': the rig's console is not there: {error}") from error
    if not answer["ok"]:
        raise Refused(answer["text"])
    return str(answer["text"])
