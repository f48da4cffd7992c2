"""Unmodified pyXCP and pya2l at the controllers: connects, reads, writes, is refused, unlocks, measures, triggers.

    xcp_client.py SCENARIO BUS FOLDER AXIS SEEN [MEMBER]

BUS is the path of the embedded bus, FOLDER that of the controller's files with its A2L file, of which all addresses are taken. With
MEMBER it takes part in the lockstep barrier. What was seen becomes one JSON object in the file SEEN; the test that started it judges.
"""

import hashlib
import hmac
import json
import logging
import os
import struct
import sys
import time
import zlib
from pathlib import Path

import pya2l.model as model
from pya2l import import_a2l
from pyxcp.config import create_application_from_config, set_application
from pyxcp.daq_stim import DaqList, DaqOnlinePolicy
from pyxcp.master import Master
from pyxcp.types import XcpResponseError

from airbench_hil import can_bus

SECRET = bytes.fromhex("000102030405060708090a0b0c0d0e0f")
IDENTIFIERS = {"drive": (0x1E0, 0x1E1), "load": (0x1E2, 0x1E3)}
STATES = {"ready": 4}
WIRE = {"FLOAT32_IEEE": "F32", "UBYTE": "U8", "ULONG": "U32"}


class A2l:
    """Addresses and formats by name, as pya2l reads them."""

    def __init__(self, path):
        session = import_a2l(str(path), in_memory=True, loglevel="ERROR")
        self.characteristics = {each.name: each for each in session.query(model.Characteristic).all()}
        self.measurements = {each.name: each for each in session.query(model.Measurement).all()}
        module = session.query(model.Module).first()
        self.epk = module.mod_par.epk.identifier
        self.address_of_epk = module.mod_par.addr_epk[0].address


class Rows(DaqOnlinePolicy):
    """Keeps what a DAQ list brings."""

    def __init__(self, lists):
        super().__init__(lists)
        self.rows = []

    def initialize(self):
        pass

    def on_daq_list(self, daq_list, timestamp0, timestamp1, payload):
        self.rows.append(payload)

    def finalize(self):
        pass


class Client:
    """A session with the controller of an axis."""

    def __init__(self, bus, folder, axis, member):
        self.axis, self.folder = axis, Path(folder)
        self.file = self.folder / f"controller-{axis}.a2l"
        self.a2l = A2l(self.file)
        self.bus = can_bus.AirbenchBus(bus, member=member)
        self.master = None
        self.rows = None
        self.secret = SECRET

    def open(self, lists=()):
        master, slave = IDENTIFIERS[self.axis]
        application = create_application_from_config(
            {"Transport": {"CAN": {"can_id_master": master, "can_id_slave": slave, "max_dlc_required": True}}},
            log_level=logging.CRITICAL,
        )
        application.transport.layer = "CAN"
        application.transport.timeout = 120.0  # others of the barrier may still be starting
        application.general.disable_error_handling = True
        application.general.seed_n_key_function = lambda _, seed: self.key(seed)
        set_application(application)
        self.rows = Rows(list(lists)) if lists else None
        self.master = Master("can", application, policy=self.rows, transport_layer_interface=self.bus)
        self.master.transport.connect()
        return self.master.connect()

    def close(self):
        self.master.disconnect()
        self.leave()

    def leave(self):
        """Without a word; and waits for the thread that reads, which would take what is for the next one."""
        self.master.close()
        self.master.transport.listener.join()

    def key(self, seed):
        return hmac.new(self.secret, bytes(seed), hashlib.sha256).digest()[:8]

    def address(self, name):
        name = f"{self.axis}.{name}"
        if name in self.a2l.characteristics:
            return self.a2l.characteristics[name].address
        return self.a2l.measurements[name].ecu_address.address

    def read(self, address, count):
        self.master.setMta(address)
        return self.master.fetch(count)

    def number(self, name):
        return struct.unpack("<d", self.read(self.address(name), 8))[0]

    def count(self, name):
        return struct.unpack("<I", bytes(self.master.shortUpload(4, self.address(name))[:4]))[0]

    def write(self, address, data):
        """Returns what the slave says: nothing, or the name of its refusal."""
        try:
            self.master.setMta(address)
            for at in range(0, len(data), 6):
                self.master.download(data[at : at + 6])
        except XcpResponseError as refusal:
            return str(refusal.get_error_code())
        return None

    def set(self, name, value):
        return self.write(self.address(name), struct.pack("<d", value))

    def set_count(self, name, value):
        return self.write(self.address(name), struct.pack("<I", value))

    @staticmethod
    def refusal_of(ask):
        try:
            ask()
        except XcpResponseError as refusal:
            return str(refusal.get_error_code())
        return None

    def clock(self):
        return self.master.getDaqClock().timestamp

    def wait_cycles(self, cycles):
        until = self.clock() + cycles
        while self.clock() < until:
            time.sleep(0.002)

    def wait_for(self, name, value):
        for _ in range(20_000):
            if self.count(name) == value:
                return
            time.sleep(0.001)
        raise SystemExit(f"{name} does not come to {value}")


def identity(client):
    seen = {"slave": client.open()}
    seen["epk"] = client.master.identifier(5)
    seen["epk_in_memory"] = client.read(client.a2l.address_of_epk, len(client.a2l.epk)).decode()
    seen["epk_in_file"] = client.a2l.epk
    text = client.file.read_bytes()
    seen["a2l_bytes"] = [client.master.getId(4).length, len(text)]
    sums = []
    for at in range(0, len(text), 4096):
        piece = text[at : at + 4096]
        sums.append(client.master.buildChecksum(len(piece)).checksum == zlib.crc32(piece))
    seen["a2l_sums_agree"] = all(sums)
    seen["slave"] = {key: str(value) for key, value in seen["slave"].items() if not key.startswith("_")}
    return seen


def protection(client):
    """What is refused before the key, with a wrong one, and for values that are not allowed."""
    gain = "algorithm.gain_per_s"
    seen = {"gain": client.number(gain), "locked": client.set(gain, 20.0)}
    seen["protected"] = bool(client.master.getStatus().resourceProtectionStatus.calpag)
    client.secret = b"not the secret, that much is sure"
    seen["wrong_key"] = client.refusal_of(lambda: client.master.cond_unlock("calpag"))
    client.leave()
    client.secret = SECRET
    client.open()
    client.wait_cycles(1001)
    client.master.cond_unlock("calpag")
    seen["unlocked"] = not client.master.getStatus().resourceProtectionStatus.calpag
    seen["too_large"] = client.set(gain, 200.5)
    seen["no_number"] = client.set(gain, float("nan"))
    seen["at_start_only"] = client.set("settled.still_m", 0.004)
    seen["signal"] = client.write(client.address("position_m"), bytes(4))
    seen["nowhere"] = client.write(0x7000_0000, bytes(4))
    seen["gain_after_refusals"] = client.number(gain)
    seen["written"] = client.set(gain, 17.125)
    seen["gain_written"] = client.number(gain)
    return seen


def parameter_set(client):
    """Stored by XCP, changed, loaded by XCP; and the whole set in one block each way."""
    gain = "algorithm.gain_per_s"
    stored = client.folder / f"controller-{client.axis}-parameters.toml"
    client.master.setRequest(1, 0)
    while client.master.getStatus().sessionStatus.storeCalRequest:
        time.sleep(0.002)
    seen = {"stored": stored.read_text(encoding="utf-8")}
    seen["changed"] = client.set(gain, 33.0)
    seen["load"] = client.set_count("set.load", 1)
    while client.number(gain) != 17.125:
        time.sleep(0.002)
    seen["gain_loaded"] = client.number(gain)
    prefix = f"{client.axis}."
    places = [
        each.address
        for name, each in client.a2l.characteristics.items()
        if 0x1000_0000 <= each.address < 0x2000_0000 and name.startswith(prefix)
    ]
    start, length = min(places), 8 * len(places)
    before = client.read(start, length)
    assert sorted(places) == list(range(start, start + length, 8)), places
    client.set(gain, 44.0)
    client.master.getCommModeInfo()
    one = struct.pack("<d", 45.0)
    seen["push_of_one"] = client.refusal_of(lambda: client.master.push(client.address(gain), 0, one))
    seen["gain_after_push"] = client.number(gain)
    block = before[:240]
    client.master.setMta(start)
    client.master.push(start, 0, block)
    seen["block_restores"] = client.read(start, length) == before
    return seen


def trace(client, setting):
    """Arms, waits, and reads the buffer as memory."""
    for name, value in setting["counts"].items():
        refused = client.set_count(f"trace.{name}", value)
        assert refused is None, f"{name}: {refused}"
    client.set("trace.threshold", setting["threshold"])
    seen = {"arm": client.set_count("trace.arm", 1), "running": client.count("trace.arm")}
    client.wait_for("trace.state", STATES["ready"])
    samples = client.count("trace.samples")
    seen["trigger_cycle"] = client.count("trace.trigger_cycle")
    seen["cycles"] = struct.unpack(f"<{samples}I", client.read(client.address("trace.cycles"), 4 * samples))
    for channel in range(1, 5):
        block = client.read(client.address(f"trace.samples_{channel}"), 8 * samples)
        seen[f"channel_{channel}"] = struct.unpack(f"<{samples}d", block)
    return seen


def daq_list(client, names):
    def measured(name):
        each = client.a2l.measurements[f"{client.axis}.{name}"]
        return (name, each.ecu_address.address, 0, WIRE[each.datatype])

    return DaqList(
        name="cycle",
        event_num=0,
        stim=False,
        enable_timestamps=True,
        measurements=[measured(name) for name in names],
        priority=0,
        prescaler=1,
    )


def daq(client, names, rows):
    """A list at 1 kHz until so many rows are there."""
    client.open([daq_list(client, names)])
    client.rows.setup()
    client.rows.start()
    while len(client.rows.rows) < rows and client.master.transport.listener.is_alive():
        time.sleep(0.01)
    client.rows.stop()
    return {"headers": [header[0] for header in client.rows.daq_lists[0].headers], "rows": client.rows.rows}


POSITION, FORCE, OPENING = 1, 2, 17
TRACE = {
    "threshold": 0.25,
    "counts": {
        "source": POSITION,
        "slope": 0,
        "pre_trigger_samples": 60,
        "length_samples": 200,
        "sample_time_cycles": 1,
        "channel_1": POSITION,
        "channel_2": FORCE,
        "channel_3": 15,
        "channel_4": OPENING,
    },
}


def whole(client):
    seen = {"identity": identity(client), "protection": protection(client)}
    seen["parameter_set"] = parameter_set(client)
    seen["trace"] = trace(client, TRACE)
    client.close()
    seen["daq"] = daq(client, ["cycle", "position_m", "main_chain"], 10_000)
    client.close()
    return seen


def measure(client, names=("cycle", "position_m", "main_chain"), rows=1000):
    """What needs no key, for a controller among others."""
    seen = {"identity": identity(client)}
    client.close()
    seen["daq"] = daq(client, names, rows)
    client.close()
    return seen


def watch(client):
    """The same for 10 s, with one packet a cycle: one that is lost on the way to a slow client takes no other along."""
    return measure(client, ("cycle", "main_chain"), 10_000)


def main():
    scenario, bus, folder, axis, file, *member = sys.argv[1:]
    client = Client(bus, folder, axis, member[0] if member else None)
    seen = {"whole": whole, "measure": measure, "watch": watch}[scenario](client)
    Path(file).write_text(json.dumps(seen), encoding="utf-8")
    sys.stdout.flush()
    # It leaves the bus by its end: once it has left the rig waits for nobody, and simulates minutes while Python takes itself down.
    os._exit(0)


main()
