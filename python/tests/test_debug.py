"""The server for GDB by its own protocol: what gdb-multiarch does not use, and a debugger that is killed."""

import re
import socket
import struct
import threading
import time

from airbench_hil import debug

FIRST = 0x08000008  # of the nops


class Debugger:
    """Speaks the protocol to a core that runs 1 ms in a thread of its own."""

    def __init__(self, elf, capfd):
        self.ended = threading.Event()

        def run():
            core = debug.DebugCore(elf, "stm32f103", 0)
            core.run_ns(1_000_000)
            self.clocks = core.cycles
            self.ended.set()

        threading.Thread(target=run, daemon=True).start()
        said, until = "", time.monotonic() + 60
        while not (port := re.search(r"target remote :(\d+)", said)):
            assert time.monotonic() < until, said
            time.sleep(0.01)
            said += capfd.readouterr().err
        self.socket = socket.create_connection(("127.0.0.1", int(port[1])), 60)

    def send(self, text):
        self.socket.sendall(f"${text}#{sum(text.encode()) & 0xFF:02x}".encode())

    def ask(self, text):
        self.send(text)
        got = b""
        while not (answer := re.search(rb"\$(.*)#..", got)):
            got += self.socket.recv(4096)
        return answer[1].decode()

    def pc(self):
        return int.from_bytes(bytes.fromhex(self.ask("pf")), "little")


def test_a_step_is_one_instruction_and_a_breakpoint_stops_in_front_of_its_own(elf, capfd):
    debugger = Debugger(elf, capfd)
    assert debugger.pc() == FIRST
    for n in range(1, 4):
        assert debugger.ask("s") == "S05"
        assert debugger.pc() == FIRST + 2 * n
    assert debugger.ask(f"Z0,{FIRST + 40:x},2") == "OK"
    # The second time after a whole round.
    for _ in range(2):
        assert debugger.ask("c") == "S05"
        assert debugger.pc() == FIRST + 40
    assert debugger.ask("D") == "OK"
    assert debugger.ended.wait(60)
    assert debugger.clocks == 8000


def test_a_debugger_that_is_killed_lets_the_core_go_on(elf, capfd):
    debugger = Debugger(elf, capfd)
    assert debugger.ask("s") == "S05"
    # The connection is reset, as by a kernel that ends a process with unread data.
    debugger.send("c")
    debugger.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    debugger.socket.close()
    assert debugger.ended.wait(60)
    assert debugger.clocks == 8000
