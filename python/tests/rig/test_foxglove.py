"""The bridge to Foxglove: a client of its WebSocket sees the rows of the run's record, state and messages."""

import json
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import foxglove
import pytest
from airbench_hil import Own, Rig, programs
from airbench_hil.foxglove import Bridge
from websockets.sync.client import connect

#: Wall time for what is only slow on a busy machine, s.
PATIENCE_S = 60


@contextmanager
def started(words, pattern, **options):
    """A program that says where it is on standard error, and what the pattern finds there; ended as by Ctrl-C."""
    program = subprocess.Popen([str(word) for word in words], stderr=subprocess.PIPE, text=True, **options)
    said = program.stderr.readline()
    found = re.search(pattern, said)
    assert found, said
    # Whatever else it says must not fill the pipe.
    threading.Thread(target=program.stderr.read, daemon=True).start()
    try:
        yield found[1]
    finally:
        end(program, signal.SIGINT)


def end(program, number):
    """Its exit code after a signal; it is not left running."""
    try:
        program.send_signal(number)
        return program.wait(PATIENCE_S)
    finally:
        program.kill()


def bridge(*options):
    """The bridge's command."""
    words = [sys.executable, "-m", "airbench_hil.foxglove", "--port", "0", *options]
    return started(words, r"(ws://127\.0\.0\.1:\d+) ;", cwd=programs.PACKAGE.parent)


class Client:
    """A client of Foxglove's protocol: channels by topic, messages by topic."""

    def __init__(self, connection):
        self.socket = connection
        self.channels, self.messages = {}, {}

    def until(self, there):
        """Takes what comes until that holds."""
        limit = time.monotonic() + PATIENCE_S
        while not there():
            came = self.socket.recv(timeout=max(0.0, limit - time.monotonic()))
            if isinstance(came, str):
                said = json.loads(came)
                for each in said.get("channels", []) if said["op"] == "advertise" else []:
                    self.channels[each["topic"]] = each
                    self.messages.setdefault(each["topic"], [])
                    ask = {"op": "subscribe", "subscriptions": [{"id": each["id"], "channelId": each["id"]}]}
                    self.socket.send(json.dumps(ask))
            elif came[0] == 1:
                number, stamp_ns = struct.unpack_from("<IQ", came, 1)
                [topic] = [topic for topic, each in self.channels.items() if each["id"] == number]
                self.messages[topic].append((stamp_ns, json.loads(came[13:])))


def test_a_client_of_foxglove_sees_the_rows_of_the_record(tmp_path):
    with Rig("step", controller=Own(), out=tmp_path / "run", summarise=False) as rig:
        words = [rig.program("bench"), "watch", "--bus", rig.url, "--telemetry", rig.telemetry, "--http", "127.0.0.1:0"]
        with (
            started(words, r"at (http://[\d.:]+)/") as page,
            bridge("--watch", page) as url,
            connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as connection,
        ):
            client = Client(connection)
            client.until(lambda: {"/row", "/state", "/log", "/histograms"} <= set(client.channels))
            schema = json.loads(client.channels["/row"]["schema"])
            assert schema["properties"]["drive_position_m"] == {"type": "number", "unit": "m"}
            rows = client.messages["/row"]

            def on():
                # Far from the end of the run, however late the rows come.
                if rig.time < 4.0:
                    rig.run_for("20 ms")
                return len(rows) > 100 and client.messages["/state"] and rows[-1][1].get("drive_set_point_m") is not None

            client.until(on)
            rig.fault("valve-stuck", "drive")
            rig.run_for("50 ms")
            client.until(lambda: any("valve-stuck" in log["message"] for _, log in client.messages["/log"]))
            client.until(lambda: client.messages["/state"][-1][1]["faults_active"])
        run = rig.end()
    measured = run.measurement.set_index("time_s")["drive_position_m"]
    times = [row["t_s"] for _, row in rows]
    assert times == sorted(set(times))
    for _, row in rows:
        assert row["drive_position_m"] == pytest.approx(measured[round(row["t_s"], 3)], abs=1e-6)
    # What is unknown is left out; the stamps advance as the rig's time does.
    assert all(value is not None for _, row in rows for value in row.values())
    for (stamp_ns, row), (next_ns, following) in zip(rows, rows[1:]):
        assert next_ns - stamp_ns == pytest.approx((following["t_s"] - row["t_s"]) * 1e9, abs=10)


def test_it_waits_for_the_page_and_ends_well_by_ctrl_c(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        words = [sys.executable, "-m", "airbench_hil.foxglove", "--port", str(port)]
        done = subprocess.run(words, capture_output=True, text=True, cwd=programs.PACKAGE.parent)
        assert done.returncode == 2 and f"no server at 127.0.0.1:{port}: " in done.stderr
    done = subprocess.run([*words, "--watch", "page"], capture_output=True, text=True, cwd=programs.PACKAGE.parent)
    assert done.returncode == 2 and "--watch page: http://ADDRESS:PORT" in done.stderr
    words = [sys.executable, "-m", "airbench_hil.foxglove", "--port", "0", "--watch", f"http://127.0.0.1:{port}"]
    program = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, cwd=programs.PACKAGE.parent)
    assert "serving ws://127.0.0.1:" in program.stderr.readline()
    assert "waiting for bench watch" in program.stderr.readline()
    assert end(program, signal.SIGINT) == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_where_a_shell_had_it_ignored(number):
    words = ["sh", "-c", f"trap '' INT TERM; exec '{sys.executable}' -m airbench_hil.foxglove --port 0 --watch http://127.0.0.1:1"]
    program = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, cwd=programs.PACKAGE.parent)
    assert "serving ws://127.0.0.1:" in program.stderr.readline() and "waiting for bench watch" in program.stderr.readline()
    assert end(program, number) == 0


def test_another_run_is_another_session():
    sessions = []
    made = Bridge(foxglove.Context(), lambda: sessions.append(1))
    made.describe({"columns": [{"name": "drive_position_m", "unit": "m"}]})
    for begins_s, count in ((0.0, 0), (0.05, 0), (20.0, 0), (19.9, 0), (0.0, 1), (0.05, 1)):
        made.take("rows", {"t_s": [begins_s, begins_s + 0.01], "columns": {"drive_position_m": [0.1, None]}})
        assert len(sessions) == count
    # A message of the past does not begin another.
    made.take("rows", {"t_s": [30.0], "columns": {"drive_position_m": [0.1]}})
    made.take("message", {"t_s": 1.0, "level": "warning", "text": "late"})
    made.take("rows", {"t_s": [30.01], "columns": {"drive_position_m": [0.1]}})
    assert len(sessions) == 1
