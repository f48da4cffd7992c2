"""Checks the frames of codec_cantools.rs with cantools, and their checksums with crccheck.

    cantools_reference.py RIG_DBC FRAMES_JSONL

Each line holds a message, the physical value of each signal, and what our codec made of them: bytes and decoded values, which
must be those of cantools, or a refusal, which cantools must share. A warning or log record while the DBC is
loaded is an error. Bytes and decoded values must be equal exactly: both sides do the same two operations on the same numbers.
"""

import json
import logging
import sys

import cantools
from crccheck.crc import Crc8SaeJ1850


class Refuse(logging.Handler):
    def emit(self, record):
        sys.exit(f"cantools logged: {record.getMessage()}")


def fail(number, problem):
    sys.exit(f"line {number}: {problem}")


def with_checksum(message, values):
    """The values with the checksum that the message's attributes ask for."""
    attributes = message.dbc.attributes
    if "Checksum" not in attributes:
        return values
    assert attributes["Checksum"].value == "SAE J1850", attributes["Checksum"]
    signal = attributes["ChecksumSignal"].value
    before = message.encode({**values, signal: 0}, strict=True)[:-1]
    checksum = Crc8SaeJ1850.calc(message.frame_id.to_bytes(2, "little") + before)
    return {**values, signal: checksum}


def check(number, database, line):
    message = database.get_message_by_name(line["message"])
    try:
        values = with_checksum(message, line["values"])
        data = message.encode(values, strict=True)
    except cantools.database.EncodeError as error:
        if not line.get("refused"):
            fail(number, f"cantools refuses {line}: {error}")
        return
    if line.get("refused"):
        fail(number, f"cantools takes {line}")
    if data.hex() != line["hex"]:
        fail(number, f"cantools gives {data.hex()} for {line}")
    decoded = message.decode(data, decode_choices=False)
    for name, value in line["decoded"].items():
        if decoded[name] != value:
            fail(number, f"cantools reads {name} as {decoded[name]} in {line}")


def main():
    logging.getLogger().addHandler(Refuse())
    logging.getLogger().setLevel(logging.INFO)
    database = cantools.database.load_file(sys.argv[1], strict=True)
    with open(sys.argv[2], encoding="utf-8") as file:
        lines = [json.loads(line) for line in file]
    for number, line in enumerate(lines, start=1):
        check(number, database, line)
    print(len(lines), "frames agree")


main()
