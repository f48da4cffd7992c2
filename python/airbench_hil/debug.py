"""The same core, stepped by instructions and stopped by GDB: `airbench-mcu --gdb PORT`.

labwired's wheel has no server for GDB. Its class Machine has registers and single steps, but no way to hand a frame to the CAN
controller; here a frame goes through the controller's own loop-back, filters and all, which leaves it as one from the wire would.
One instruction is one clock, as in the other class: a run gives the same bytes with it.

While the core stands, the member is not done and the rig waits: `emulator run --lockstep-timeout` says how long.
"""

from __future__ import annotations

import select
import socket
import struct
import sys
import tempfile
from typing import Any

import labwired

from airbench_hil import core, peer

_MSR, _TSR, _RF0R, _BTR, _MAILBOX, _LOOP_BACK = 0x04, 0x08, 0x0C, 0x1C, 0x180, 1 << 30
_REQUESTS_COMPLETED = (1 << 0, 1 << 8, 1 << 16)
_ALL_FLAGS = 0x000F0F0F
_INITIALISING = 1
_CHUNK = 16  # instructions between two looks at the mailboxes; a driver takes more for a frame
_REGISTERS = 17  # r0 to r15, xpsr
_TARGET = (
    '<?xml version="1.0"?><!DOCTYPE target SYSTEM "gdb-target.dtd"><target version="1.0"><architecture>arm</architecture>'
    '<feature name="org.gnu.gdb.arm.m-profile">'
    + "".join(f'<reg name="r{n}" bitsize="32"/>' for n in range(13))
    + '<reg name="sp" bitsize="32" type="data_ptr"/><reg name="lr" bitsize="32"/><reg name="pc" bitsize="32" type="code_ptr"/>'
    '<reg name="xpsr" bitsize="32"/></feature></target>'
)


class DebugCore(core.Core):
    """A core that stops where a debugger says."""

    def __init__(self, elf: str, chip: str, port: int) -> None:
        """Listens on 127.0.0.1 at `port`; raises what Core raises, and ValueError when the port cannot be had."""
        super().__init__(elf, chip)
        with tempfile.TemporaryDirectory(prefix="airbench-mcu-") as folder:
            self.machine = labwired.Machine(str(elf), str(core.system_file(chip, folder)))
        self._clocks = 0
        self._sent: list[tuple[int, list[int], int]] = []
        self.server = GdbServer(self.machine, port)

    @property
    def cycles(self) -> int:
        """Clocks since reset."""
        return self._clocks

    def _read(self, register: int) -> int:
        return int.from_bytes(bytes(self.machine.read_memory(self._can + register, 4)), "little")

    def _write(self, register: int, word: int) -> None:
        self.machine.write_memory(self._can + register, list(struct.pack("<I", word)))

    def run_ns(self, duration_ns: int) -> None:
        """Runs for that time of its own; stands still as long as a debugger wants."""
        left = duration_ns * core.CHIPS[self.chip]["hz"] // 1_000_000_000
        self.server.look()
        while left > 0:
            watched = self.server.before(self.machine.get_pc() & ~1)
            count = 1 if watched else min(_CHUNK, left)
            self.machine.step(count)
            self._clocks += count
            left -= count
            flags = self._read(_TSR)
            for mailbox, done in enumerate(_REQUESTS_COMPLETED):
                if flags & done:
                    self._take(mailbox)

    def _take(self, mailbox: int) -> None:
        registers = self.machine.read_memory(self._can + _MAILBOX + 16 * mailbox, 16)
        identifier, length, low, high = struct.unpack("<4I", bytes(registers))
        raw_id = identifier >> 3 | peer.EXTENDED if identifier & 4 else identifier >> 21
        data = struct.pack("<2I", low, high)[: min(length & 15, 8)]
        self._sent.append((raw_id | (peer.REMOTE if identifier & 2 else 0), list(data), self._clocks))
        self._write(_TSR, _ALL_FLAGS)

    def hear(self, frame: peer.Frame) -> None:
        """A frame that comes to its end on the wire. What the chip does not take is counted."""
        waiting = self._read(_RF0R) & 3
        if frame.raw_id & peer.ERROR:
            return
        if waiting == 3:
            self.lost_at_fifo += 1
            return
        if self._read(_MSR) & _INITIALISING:
            self.refused += 1
            self.why_refused = "it is in initialisation"
            return
        timing = self._read(_BTR)
        self._write(_BTR, timing | _LOOP_BACK)
        last = _MAILBOX + 32
        kept = [self._read(last + 4 * n) for n in range(4)]
        low, high = struct.unpack("<2I", bytes(frame.data).ljust(8, b"\0"))
        for offset, word in ((4, min(frame.length, 8)), (8, low), (12, high)):
            self._write(last + offset, word)
        word = (frame.raw_id & 0x1FFFFFFF) << 3 | 4 if frame.raw_id & peer.EXTENDED else (frame.raw_id & 0x7FF) << 21
        word |= 2 if frame.raw_id & peer.REMOTE else 0
        # The lowest byte has the request in it, and goes last.
        request = struct.pack("<I", word | 1)
        self.machine.write_memory(self._can + last + 1, list(request[1:]))
        self.machine.write_memory(self._can + last, list(request[:1]))
        for n, old in enumerate(kept):
            self._write(last + 4 * n, old & ~1 if n == 0 else old)
        self._write(_TSR, _ALL_FLAGS)
        self._write(_BTR, timing)
        if self._read(_RF0R) & 3 == waiting:
            self.not_taken += 1

    def said(self) -> list[tuple[int, list[int], int]]:
        """Frames that it has sent since the last call."""
        sent, self._sent = self._sent, []
        return sent

    def word(self, address: int) -> int:
        """Four bytes of its memory."""
        return int.from_bytes(bytes(self.machine.read_memory(address, 4)), "little")

    def close(self) -> None:
        """Reports to the debugger that the program has ended."""
        self.server.close()


class GdbServer:
    """The part of GDB's remote serial protocol that one halted or running core needs."""

    def __init__(self, machine: Any, port: int) -> None:
        self._machine = machine
        try:
            listener = socket.create_server(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            raise ValueError(f"--gdb {port}: {error}") from error
        self.port: int = listener.getsockname()[1]
        print(f"mcu: halted at reset; gdb-multiarch ELF -ex 'target remote :{self.port}'", file=sys.stderr, flush=True)
        connection, _ = listener.accept()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        listener.close()
        self._socket: socket.socket | None = connection
        self._bytes = b""
        self._breakpoints: set[int] = set()
        self._halted, self._step = True, False

    def look(self) -> None:
        """Whether the debugger has interrupted the core meanwhile."""
        if self._socket and not self._halted and select.select([self._socket], [], [], 0)[0]:
            got = self._more()
            if not got:
                self._leave()
            elif b"\x03" in got:
                self._halted = True
                self._reply("S02")

    def before(self, pc: int) -> bool:
        """Called before an instruction; returns when it may go, and says whether the next one has to be asked for."""
        if self._socket is None:
            return False
        if not self._halted and (self._step or pc in self._breakpoints):
            self._halted, self._step = True, False
            self._reply("S05")
        if self._halted:
            self._serve()
            # The instruction where it stood goes without asking again.
            return True
        return bool(self._breakpoints)

    def _serve(self) -> None:
        while self._socket and self._halted:
            packet = self._packet()
            if packet is None:
                self._leave()
                return
            answer = self._answer(packet)
            if answer is not None:
                self._reply(answer)

    def _packet(self) -> str | None:
        while True:
            begin, end = self._bytes.find(b"$"), self._bytes.find(b"#")
            if 0 <= begin < end and len(self._bytes) >= end + 3:
                packet, self._bytes = self._bytes[begin + 1 : end], self._bytes[end + 3 :]
                self._write(b"+")
                return packet.decode("latin-1")
            got = self._more()
            if not got:
                return None
            self._bytes += got

    def _more(self) -> bytes:
        """What the debugger has sent; nothing when it is gone, killed too."""
        try:
            return self._socket.recv(4096) if self._socket else b""
        except OSError:
            return b""

    def _reply(self, text: str) -> None:
        self._write(f"${text}#{sum(text.encode()) & 0xFF:02x}".encode())

    def _write(self, packet: bytes) -> None:
        try:
            if self._socket:
                self._socket.sendall(packet)
        except OSError:
            self._leave()

    def _answer(self, packet: str) -> str | None:
        kind, rest = packet[:1], packet[1:]
        try:
            if packet.startswith("qSupported"):
                return "PacketSize=1000;qXfer:features:read+;hwbreak+"
            if packet.startswith("qXfer:features:read:target.xml:"):
                offset, length = (int(word, 16) for word in packet.rsplit(":", 1)[1].split(","))
                part = _TARGET[offset : offset + length]
                return ("m" if offset + length < len(_TARGET) else "l") + part
            if kind in "cs":
                self._halted, self._step = False, kind == "s"
                return None
            if kind in "Dk":
                self._reply("OK")
                self._leave()
                return None
            return self._state(kind, rest)
        except (ValueError, OverflowError, RuntimeError, OSError):
            return "E01"

    def _state(self, kind: str, rest: str) -> str:
        """Registers, memory and breakpoints."""
        if kind == "?":
            return "S05"
        if kind == "g":
            return "".join(self._register(n) for n in range(_REGISTERS))
        if kind == "p":
            return self._register(int(rest, 16))
        if kind == "P":
            number, value = rest.split("=")
            self._machine.write_register(int(number, 16), int.from_bytes(bytes.fromhex(value), "little"))
            return "OK"
        if kind == "m":
            address, length = (int(word, 16) for word in rest.split(","))
            return bytes(self._machine.read_memory(address, length)).hex()
        if kind == "M":
            place, data = rest.split(":")
            self._machine.write_memory(int(place.split(",")[0], 16), list(bytes.fromhex(data)))
            return "OK"
        if kind in "Zz" and rest[:1] in "01":
            address = int(rest.split(",")[1], 16) & ~1
            (self._breakpoints.add if kind == "Z" else self._breakpoints.discard)(address)
            return "OK"
        return "OK" if kind == "H" else ""

    def _register(self, number: int) -> str:
        value = self._machine.get_pc() & ~1 if number == 15 else self._machine.read_register(number)
        return struct.pack("<I", value & 0xFFFFFFFF).hex()

    def _leave(self) -> None:
        if self._socket:
            self._socket.close()
        self._socket, self._halted, self._step = None, False, False
        self._breakpoints.clear()

    def close(self) -> None:
        """The program has ended."""
        if self._socket:
            self._reply("W00")
            self._leave()
