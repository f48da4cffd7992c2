"""A running rig in Foxglove: `bench watch` on one side, Foxglove's WebSocket on the other (docs/foxglove.md).

    bench watch --bus URL --telemetry PATH
    python -m airbench_hil.foxglove --watch http://127.0.0.1:8080

It is one more client of the page's events, so it costs the loop what a browser does: no work in the 1 ms path. Channels, JSON with
schemas:

    /row            the columns of the page's charts, every 10 ms of the rig's time, by name in SI; what is unknown is left out
    /state          chains, emergency stop, faults, bus, timing: every 200 ms
    /histograms     latencies: every second
    /log            messages, as foxglove.Log

Stamps are the rig's time, counted from the machine's clock at the run's first row.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from airbench_hil.errors import BAD_INPUT, GOOD
from airbench_hil.run import imported

#: Wall time until a page that is gone is looked for again, s.
_AGAIN_S = 0.5
#: The page sends something every 5 s at least.
_SILENCE_S = 15.0
_LEVELS = {"info": 2, "warning": 3, "error": 4}
_OPEN_OBJECT = {"type": "object", "additionalProperties": True}
#: Later by this much than the newest row: the first rows of another run have times before it, s.
_BACK_S = 0.5


class Bridge:
    """The channels of a Foxglove server, filled from events of the page."""

    def __init__(self, context: Any, new_session: Callable[[], object]) -> None:
        """:param context: of foxglove-sdk, which the server serves.

        :param new_session: tells clients that time begins anew.
        """
        self._sdk, self._context, self._new_session = imported("foxglove", "foxglove"), context, new_session
        self._row: Any = None
        self._columns: list[tuple[str, str]] = []
        self._state = self._channel("/state", "airbench.state", _OPEN_OBJECT)
        self._histograms = self._channel("/histograms", "airbench.histograms", _OPEN_OBJECT)
        self._log = self._channel("/log", "foxglove.Log", _LOG)
        #: Wall time minus the rig's, ns.
        self._base_ns: int | None = None
        self._newest_s = 0.0

    def _channel(self, topic: str, name: str, schema: dict[str, Any]) -> Any:
        whole = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": name, **schema}
        data = json.dumps(whole).encode()
        described = self._sdk.Schema(name=name, encoding="jsonschema", data=data)
        return self._sdk.Channel(topic, schema=described, message_encoding="json", context=self._context)

    def describe(self, description: dict[str, Any]) -> None:
        """Takes what stays the same during a run: names and units of the columns."""
        columns = [(str(each["name"]), str(each["unit"])) for each in description["columns"]]
        if self._row is not None and columns == self._columns:
            return
        if self._row is not None:
            self._row.close()
        properties: dict[str, Any] = {"t_s": {"type": "number", "unit": "s", "description": "the rig's time"}}
        properties |= {name: {"type": "number", "unit": unit} for name, unit in columns}
        self._row, self._columns = self._channel("/row", "airbench.row", {"type": "object", "properties": properties}), columns

    def take(self, event: str, data: dict[str, Any]) -> None:
        """Hands an event of the page on."""
        if event == "rows":
            for at, time_s in enumerate(data["t_s"]):
                row = {name: values[at] for name, values in data["columns"].items() if values[at] is not None}
                self._row.log({"t_s": time_s, **row}, log_time=self._stamp_ns(time_s))
        elif event == "state":
            # A state may be newer than the rows that follow it.
            self._state.log(data, log_time=self._stamp_ns(data.get("t_s"), moves=False))
        elif event == "histograms":
            self._histograms.log(data, log_time=self._stamp_ns(None))
        elif event == "message":
            stamp_ns = self._stamp_ns(data.get("t_s"), moves=False)
            self._log.log(
                {
                    "timestamp": {"sec": stamp_ns // 10**9, "nsec": stamp_ns % 10**9}, "level": _LEVELS.get(data["level"], 0),
                    "message": data["text"], "name": "airbench", "file": "", "line": 0,
                },
                log_time=stamp_ns,
            )

    def _stamp_ns(self, time_s: float | None, moves: bool = True) -> int:
        """Nanoseconds since 1970 of a time of the rig, or of the newest one. Events of the past, as messages may be, move nothing."""
        if time_s is None:
            time_s = self._newest_s
        elif moves:
            if self._base_ns is not None and time_s < self._newest_s - _BACK_S:
                self._base_ns = None
                self._new_session()
            self._newest_s = time_s
        if self._base_ns is None:
            self._base_ns = time.time_ns() - round(time_s * 1e9)
        return self._base_ns + round(time_s * 1e9)


def events(url: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Server-Sent Events of the page, by name; ends with it."""
    with urllib.request.urlopen(f"{url}/api/events", timeout=_SILENCE_S) as stream:
        event = ""
        for raw in stream:
            line = raw.decode("utf-8").rstrip("\r\n")
            if line.startswith("event:"):
                event = line[6:].strip()
            elif line.startswith("data:"):
                yield event, json.loads(line[5:])


def _description(url: str) -> dict[str, Any]:
    with urllib.request.urlopen(f"{url}/api/description", timeout=_SILENCE_S) as answer:
        described: dict[str, Any] = json.load(answer)
    return described


def follow(bridge: Bridge, url: str, over: threading.Event, say: Callable[[str], None]) -> None:
    """Reads the page until `over`; waits for one that is not there yet, or is gone."""
    connected, reported = False, False
    while not over.is_set():
        try:
            bridge.describe(_description(url))
            for event, data in events(url):
                if not connected:
                    say(f"connected to {url}")
                connected, reported = True, False
                if event == "status":
                    bridge.describe(_description(url))  # after `connected` it may be another run's
                else:
                    bridge.take(event, data)
                if over.is_set():
                    return
        except (OSError, urllib.error.URLError, json.JSONDecodeError) as gone:
            if not reported:
                say(f"{url} is not there ({gone}): waiting for bench watch")
            reported = True
        connected = False
        over.wait(_AGAIN_S)


_NUMBER, _TEXT = {"type": "number"}, {"type": "string"}
#: https://docs.foxglove.dev/docs/sdk/schemas/log
_LOG = {
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "title": "time", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        "level": _NUMBER, "message": _TEXT, "name": _TEXT, "file": _TEXT, "line": {"type": "integer"},
    },
}


def main(words: Sequence[str] | None = None) -> int:
    """The command; gives its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m airbench_hil.foxglove", description="Serves what bench watch shows of a running rig to Foxglove, until Ctrl-C.",
    )
    parser.add_argument("--watch", metavar="URL", default="http://127.0.0.1:8080", help="address of bench watch [default: %(default)s]")
    parser.add_argument("--host", default="127.0.0.1", help="address to serve at: whoever reaches it sees the run [default: %(default)s]")
    parser.add_argument("--port", type=int, default=8765, help="port to serve at; 0 takes a free one [default: %(default)s]")
    asked = parser.parse_args(words)
    url = asked.watch.partition("#")[0].rstrip("/")
    if not url.startswith("http://"):
        parser.error(f"--watch {asked.watch}: http://ADDRESS:PORT, as bench watch prints it")
    try:
        sdk = imported("foxglove", "foxglove")
    except ImportError as missing:
        print(f"airbench_hil.foxglove: {missing}", file=sys.stderr)
        return BAD_INPUT

    def say(text: str) -> None:
        print(f"airbench_hil.foxglove: {text}", file=sys.stderr, flush=True)

    context = sdk.Context()
    try:
        server = sdk.start_server(name="airbench", host=asked.host, port=asked.port, context=context)
    except (RuntimeError, OSError, ValueError) as refused:
        say(f"no server at {asked.host}:{asked.port}: {refused}")
        return BAD_INPUT
    say(f"serving ws://{asked.host}:{server.port} ; in Foxglove: Open connection, Foxglove WebSocket; Ctrl-C ends it")
    over = threading.Event()
    try:
        # A shell that starts it in the background has Ctrl-C ignored; `kill` ends it as well.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.default_int_handler)
        follow(Bridge(context, server.clear_session), url, over, say)
    except KeyboardInterrupt:
        pass
    finally:
        server.stop()
    return GOOD


if __name__ == "__main__":
    sys.exit(main())
