"""Signals of rig.dbc by name, and what the bus has said of them so far, in physical units.

A signal is `Message.signal` as rig.dbc names them: `DriveSensors.position` (m), `RigStatus.supply_pressure` (Pa).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import can
import cantools.database
from cantools.database.can import Database, Message

from airbench_hil import programs
from airbench_hil.errors import NotSeen, SignalUnknown

#: What is kept of each identifier, frames: 20 s of one that comes every millisecond.
KEPT = 20_000


@lru_cache(maxsize=4)
def database(path: Path | None = None) -> Database:
    """The database of the rig's frames, rig.dbc, as cantools has it."""
    loaded = cantools.database.load_file(path or programs.file("rig.dbc"))
    assert isinstance(loaded, Database)
    return loaded


@dataclass(frozen=True)
class Signal:
    """One signal; all are little endian (rig.dbc, "Intel byte order")."""

    name: str
    """`Message.signal`."""
    frame_id: int
    start: int
    mask: int
    sign: int
    """The sign bit's value; 0 for unsigned ones."""
    scale: float
    offset: float
    unit: str
    choices: dict[int, str]
    """Words of a value table; empty for numbers."""

    def of(self, word: int) -> float:
        """The physical value in a frame's data, read as a little-endian number."""
        raw = word >> self.start & self.mask
        if raw & self.sign:
            raw -= self.mask + 1
        return raw * self.scale + self.offset

    def shown(self, value: float) -> str:
        """The value for a person: the word of a value table, or six digits."""
        return self.choices.get(int(value)) or f"{value:.6g}" if self.choices else f"{value:.6g}"

    @property
    def title(self) -> str:
        """Name and unit."""
        return f"{self.name} / {self.unit}" if self.unit else self.name


class Names:
    """Names to signals and messages."""

    def __init__(self, dbc: Database) -> None:
        self.dbc = dbc
        self.signals: dict[str, Signal] = {}
        self.messages: dict[str, Message] = {message.name: message for message in dbc.messages}
        #: Identifiers that the rig itself sends.
        self.rigs = {message.frame_id for message in dbc.messages if "Rig" in message.senders}
        for message in dbc.messages:
            for each in message.signals:
                assert each.byte_order == "little_endian", each.name
                mask = (1 << each.length) - 1
                choices = {int(raw): str(word) for raw, word in (each.choices or {}).items()}
                name = f"{message.name}.{each.name}"
                self.signals[name] = Signal(
                    name, message.frame_id, each.start, mask, (mask + 1) >> 1 if each.is_signed else 0, float(each.scale),
                    float(each.offset), each.unit or "", choices,
                )

    def signal(self, name: str) -> Signal:
        """The signal `Message.signal`.

        :raises SignalUnknown: rig.dbc has none of that name; the text lists what is near.
        """
        found = self.signals.get(name)
        if found is None:
            message = name.partition(".")[0]
            near = [each for each in self.signals if each.startswith(f"{message}.")] or sorted(self.messages)
            raise SignalUnknown(f"no signal '{name}' in rig.dbc; there is {', '.join(near)}")
        return found

    def message(self, name: str) -> Message:
        """The message of that name.

        :raises SignalUnknown: rig.dbc has none.
        """
        found = self.messages.get(name)
        if found is None:
            raise SignalUnknown(f"no message '{name}' in rig.dbc; there is {', '.join(sorted(self.messages))}")
        return found

    def encoded(self, name: str, values: dict[str, Any]) -> tuple[int, bytes]:
        """Identifier and data of a message; what is not given is 0, `crc` is computed.

        :raises ValueError: a signal that it does not have, or a value out of its range.
        """
        message = self.message(name)
        unknown = set(values) - {each.name for each in message.signals}
        if unknown:
            raise ValueError(f"{name} has no {', '.join(sorted(unknown))}; it has {', '.join(s.name for s in message.signals)}")
        for each in message.signals:
            word, words = values.get(each.name), [str(word) for word in (each.choices or {}).values()]
            if isinstance(word, str) and word not in words:
                raise ValueError(f"{name}.{each.name} is never '{word}': {', '.join(words) or 'it has no words'}")
        whole = {each.name: values.get(each.name, 0) for each in message.signals}
        try:
            data = message.encode(whole, strict=True)
        except cantools.database.errors.EncodeError as error:
            raise ValueError(f"{name}: {error}") from error
        if "crc" in whole and "crc" not in values:
            data = data[:-1] + bytes([crc8(message.frame_id, data[:-1])])
        return message.frame_id, data


def crc8(frame_id: int, data: bytes) -> int:
    """CRC-8 SAE J1850 over the identifier, two bytes little endian, and data: the checksum of valve commands."""
    crc = 0xFF
    for byte in frame_id.to_bytes(2, "little") + data:
        crc = _CRC[crc ^ byte]
    return crc ^ 0xFF


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ (0x11D if byte & 0x80 else 0)
        table.append(byte & 0xFF)
    return tuple(table)


_CRC = _crc_table()


#: A frame as it is kept: the rig's time, s; its data, little endian; its length. The collector of garbage leaves plain tuples of
#: numbers alone, and would visit each of these hundred thousands again and again were they a NamedTuple.
Sample = tuple[float, int, int]


class Seen:
    """The newest frame of each identifier, and the last seconds of all."""

    def __init__(self, names: Names) -> None:
        self.names = names
        self.kept: dict[int, deque[Sample]] = {}
        self.latest: dict[int, Sample] = {}
        self.counts: dict[int, int] = {}

    def take(self, raw_id: int, data: bytes, length: int, time_s: float) -> None:
        """A frame that came at this time, s."""
        sample = time_s, int.from_bytes(data, "little"), length
        self.latest[raw_id] = sample
        kept = self.kept.get(raw_id)
        if kept is None:
            kept = self.kept[raw_id] = deque(maxlen=KEPT)
            self.counts[raw_id] = 0
        kept.append(sample)
        self.counts[raw_id] += 1

    def value(self, signal: Signal) -> float | None:
        """Its newest value in its unit; None before its first frame."""
        sample = self.latest.get(signal.frame_id)
        return None if sample is None else signal.of(sample[1])

    def read(self, signal: Signal) -> float:
        """Its newest value in its unit.

        :raises NotSeen: its frame has not come yet.
        """
        value = self.value(signal)
        if value is None:
            raise NotSeen(f"{signal.name}: no such frame has come yet")
        return value

    def course(self, signal: Signal, from_s: float, to_s: float) -> list[tuple[float, float]]:
        """Times, s, and values of what came between them, as far as it is kept."""
        kept = self.kept.get(signal.frame_id, ())
        return [(time_s, signal.of(word)) for time_s, word, _ in kept if from_s <= time_s <= to_s]

    def messages(self, name: str | None, from_s: float, to_s: float) -> list[can.Message]:
        """Frames of that name, or all, that came between these times, s, in their order."""
        wanted = list(self.kept) if name is None else [self.names.message(name).frame_id]
        came = ((each, frame_id) for frame_id in wanted for each in self.kept.get(frame_id, ()) if from_s <= each[0] <= to_s)
        return [_as_python_can(frame_id, each) for each, frame_id in sorted(came, key=lambda pair: (pair[0][0], pair[1]))]

    def message(self, name: str) -> can.Message:
        """The newest frame of that name as python-can has it; its stamp is the rig's time, s.

        :raises NotSeen: none has come yet.
        """
        frame_id = self.names.message(name).frame_id
        sample = self.latest.get(frame_id)
        if sample is None:
            raise NotSeen(f"{name}: no such frame has come yet")
        return _as_python_can(frame_id, sample)


def _as_python_can(raw_id: int, sample: Sample) -> can.Message:
    time_s, word, length = sample
    data = word.to_bytes(8, "little")[: min(length, 8)]
    extended, remote = bool(raw_id & 0x80000000), bool(raw_id & 0x40000000)
    return can.Message(
        timestamp=time_s, arbitration_id=raw_id & 0x1FFFFFFF, data=b"" if remote else data, dlc=length,
        is_extended_id=extended, is_remote_frame=remote, is_error_frame=bool(raw_id & 0x20000000),
    )
