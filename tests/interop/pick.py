"""Plays the PLC for whole picks with pymodbus, written from docs/plc-registers.md alone. No code of binpick is used.

Usage: pick.py HOST PORT s7|logix [PART [SUPPLY [PICKS]]] [--serve]
--serve: HOST and PORT are where this PLC's own Modbus server listens; the cell is its client (plc.role = "client").
Prints one line per pick; exit 0 when the whole handshake went as the page says, 1 with the reason when not.
Runs with pymodbus 3.0.0rc1 (Debian's python3-pymodbus) and later.
"""
import struct
import sys
import threading
import time

from pymodbus.client import ModbusTcpClient
from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext
from pymodbus.server import StartTcpServer

# Words of the request block, bits and codes: docs/plc-registers.md.
REQUEST, ABORT, RESET, ROBOT_CLEAR = 1, 2, 4, 8
READY, ACK, BUSY, RESULT_VALID, SCAN_DONE, FAULT, ABORT_ACK, RESET_ACK = (1 << n for n in range(8))
PICK_FOUND, UNKNOWN_PART, BAD_SEQUENCE = 1, 20, 22


class Wrong(Exception):
    """The cell did not do what the page says."""


def expect(condition, what):
    if not condition:
        raise Wrong(what)


class Plc:
    def __init__(self, host, port, order):
        self.order = order
        self.block = [0] * 8
        self.words = []
        self.connect(host, port)

    def connect(self, host, port):
        self.client = ModbusTcpClient(host, port=port, timeout=2)
        expect(self.client.connect(), f"no connection to {host}:{port}")

    def poll(self):
        """One write of the whole request block, one read of status and result."""
        self.block[0] = (self.block[0] + 1) & 0xFFFF
        answer = self.client.write_registers(0, self.block, slave=255)
        expect(not answer.isError(), f"write refused: {answer}")
        answer = self.client.read_holding_registers(8, 80, slave=255)
        expect(not answer.isError(), f"read refused: {answer}")
        self.words = answer.registers
        time.sleep(0.03)

    def word(self, n):
        return self.words[n - 8]

    def double(self, n):
        first, second = self.word(n), self.word(n + 1)
        return struct.pack(">HH", first, second) if self.order == "s7" else struct.pack(">HH", second, first)

    def f32(self, n):
        return struct.unpack(">f", self.double(n))[0]

    def u32(self, n):
        return struct.unpack(">I", self.double(n))[0]

    def status(self, bit):
        return bool(self.word(17) & bit)

    def wait(self, what, condition, seconds=60.0):
        end = time.monotonic() + seconds
        while True:
            self.poll()
            if condition():
                return
            expect(time.monotonic() < end,
                   f"waited {seconds:.0f} s for {what}; status {self.word(17):#06x}, state {self.word(16)}, "
                   f"not_ready {self.word(19):#06x}, first_alarm {self.word(20)}, result_code {self.word(41)}")

    def meet(self):
        """Steps 1 and 2: do map and word order fit; show request 0 once; start from a clean state."""
        self.block[7] = ROBOT_CLEAR
        self.poll()
        expect(self.word(8) == 2 and self.word(9) == 88, f"map version {self.word(8)}, length {self.word(9)}")
        expect(self.f32(10) == 123456.0, f"test_f32 is {self.f32(10)}")
        expect(self.u32(12) == 0x01020304, f"test_u32 is {self.u32(12):#x}")
        expect(self.word(34) == (0 if self.order == "s7" else 1), "word_order")
        heartbeat = self.word(15)
        self.wait("the cell's heartbeat", lambda: self.word(15) != heartbeat, 3)
        self.block[1] = self.word(18)
        if self.status(FAULT) or self.word(20) != 0:
            self.level(RESET, RESET_ACK)
        if self.status(RESULT_VALID):
            self.acknowledge(self.word(40))

    def level(self, bit, ack):
        self.block[7] |= bit
        self.wait("the acknowledge of a level", lambda: self.status(ack), 2)
        self.block[7] &= ~bit
        self.wait("the acknowledge to fall", lambda: not self.status(ack), 2)

    def raise_request(self, part, supply, again=False):
        """Steps 5 and 6."""
        if not again:
            self.block[1] = self.block[1] % 65535 + 1
        self.block[2], self.block[3], self.block[4] = part, supply, 0
        self.block[7] |= REQUEST
        self.wait("ack", lambda: self.status(ACK) and self.word(18) == self.block[1], 2)
        self.block[7] &= ~REQUEST

    def result(self, seconds=60.0):
        """Step 8."""
        def there():
            expect(not self.status(FAULT), f"fault, first_alarm {self.word(20)}")
            return self.status(RESULT_VALID) and self.word(40) == self.word(87) == self.block[1]
        self.wait("the result", there, seconds)
        return self.words[40 - 8:]

    def acknowledge(self, sequence):
        """Step 10."""
        self.block[4] = sequence
        self.wait("the result to be cleared", lambda: not self.status(RESULT_VALID), 2)
        expect(not any(self.words[40 - 8:]), "result block is not zero after the acknowledge")


class ServingPlc(Plc):
    """The same program on registers of its own, which the cell reads and writes."""

    def connect(self, host, port):
        self.registers = ModbusSequentialDataBlock(0, [0] * 88)
        context = ModbusServerContext(ModbusSlaveContext(hr=self.registers, zero_mode=True), single=True)
        threading.Thread(target=StartTcpServer, kwargs={"context": context, "address": (host, port)}, daemon=True).start()

    def poll(self):
        self.block[0] = (self.block[0] + 1) & 0xFFFF
        self.registers.setValues(0, self.block)
        time.sleep(0.03)
        words = self.registers.getValues(8, 80)
        # A flag never stands over half of its words.
        if words[17 - 8] & RESULT_VALID:
            expect(words[40 - 8] == words[87 - 8] != 0, f"result_valid over sequence {words[40 - 8]} and {words[87 - 8]}")
        self.words = words

    def meet(self):
        self.block[7] = ROBOT_CLEAR
        self.words = [0] * 80
        self.wait("the cell to write its map", lambda: self.word(8) != 0, 20)
        super().meet()

    def raise_request(self, part, supply, again=False):
        self.wait("ack to fall", lambda: not self.status(ACK), 2)
        super().raise_request(part, supply, again)


def one_pick(plc, part, supply):
    plc.wait("ready", lambda: plc.status(READY))
    expect(plc.word(19) == 0, "ready, and yet not_ready gives a reason")
    plc.raise_request(part, supply)
    plc.wait("scan_done", lambda: plc.status(SCAN_DONE) or plc.status(FAULT))
    result = plc.result()
    expect(plc.word(43) == part and plc.word(44) == supply, "part or supply is not echoed")
    line = f"sequence {plc.word(40)} code {plc.word(41)}"
    if plc.word(41) == PICK_FOUND:
        grasp = [plc.f32(n) for n in range(62, 74, 2)]
        approach = [plc.f32(n) for n in range(50, 62, 2)]
        retreat = [plc.f32(n) for n in range(74, 80, 2)]
        expect(plc.word(42) != 0, "a pick without a number")
        expect(0.0 <= plc.f32(48) <= 1.0, f"score {plc.f32(48)}")
        expect(grasp[:3] != [0.0, 0.0, 0.0] and approach[:3] != grasp[:3], "no poses")
        expect(retreat[2] > grasp[2], f"the retreat position {retreat} is not above the grasp {grasp[:3]}")
        line += (f" pick {plc.word(42)} score {plc.f32(48):.3f} left {plc.word(45)} fill {plc.word(46)} %"
                 f" grasp {' '.join(f'{v:.4f}' for v in grasp)}"
                 f" retreat {' '.join(f'{v:.4f}' for v in retreat)}")
    line += f" sweep {plc.word(80)} ms profiles {plc.word(81)} points {plc.u32(82)} hypotheses {plc.u32(84)}"
    print(f"{line} detection {plc.word(86)} ms")
    plc.acknowledge(plc.block[1])

    # The same number again: the same answer, no second sweep.
    cycles = plc.word(33)
    plc.raise_request(part, supply, again=True)
    expect(plc.result(2) == result, "a retry was answered differently")
    expect(plc.word(33) == cycles, "a retry made a sweep")
    plc.acknowledge(plc.block[1])


def main(arguments):
    serve = "--serve" in arguments
    arguments = [a for a in arguments if a != "--serve"]
    if len(arguments) < 3 or arguments[2] not in ("s7", "logix"):
        print(__doc__.strip(), file=sys.stderr)
        return 2
    part, supply, picks = (int(v) for v in (arguments[3:] + ["1", "1", "1"][len(arguments) - 3:]))
    try:
        plc = (ServingPlc if serve else Plc)(arguments[0], int(arguments[1]), arguments[2])
        plc.meet()
        for _ in range(picks):
            one_pick(plc, part, supply)
        # A part that does not exist is answered at once.
        plc.wait("ready", lambda: plc.status(READY))
        plc.raise_request(65535, supply)
        expect(plc.result(2)[1] == UNKNOWN_PART, f"an unknown part gave code {plc.word(41)}")
        plc.acknowledge(plc.block[1])
        # Abort and reset are acknowledged by level in any state.
        plc.level(ABORT, ABORT_ACK)
        plc.level(RESET, RESET_ACK)
        if not serve:
            # A write outside the request block is refused with exception 2.
            answer = plc.client.write_register(17, 1, slave=255)
            expect(answer.isError() and answer.exception_code == 2, f"a write to status gave {answer}")
            plc.client.close()
    except Wrong as wrong:
        print(f"pick.py: {wrong}", file=sys.stderr)
        return 1
    print(f"{picks} picks over pymodbus{' as server' if serve else ''}, {arguments[2]}: good")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
