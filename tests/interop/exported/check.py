"""Runs what `binpick export plc` wrote against a cell that runs: the sources are read, laid out as the makers' tools do,
compared with docs/plc-registers.md and with the words on the wire, and the exported program picks. The PLC is this program.

Usage: check.py s7|logix FOLDER HOST PORT BASE [--serve] [--refused | --no-devices]
--serve: the program has a Modbus server, at PORT of this machine, and the cell is its client.
--refused: the cell has the other word order; the program has to say so and must not ask for picks.
--no-devices: the other side is plc_bench_server, which finds a pick in every request: all that can happen on the line.
No code and no table of binpick is used; pymodbus 3.0.0rc1 (Debian's python3-pymodbus) and later.
"""
import os
import re
import socket
import struct
import sys
import time

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException

from logix import Controller, Project
from scl import Cpu, Source
from structured_text import Wrong, expect

OFFLINE, IDLE, REQUESTING, WAIT_SCAN_DONE, WAIT_RESULT, ACKNOWLEDGING, FINISHED, ABORTING, FAULT, RESETTING = \
    0, 10, 20, 30, 40, 50, 60, 80, 90, 95
PICK_FOUND, UNKNOWN_PART = 1, 20
ROBOT_NOT_CLEAR = 502
PROFILES_LOST = 204
# What each type of the page is with each maker.
TYPES = {"s7": {"u16": "UInt", "i16": "Int", "u32": "UDInt", "f32": "Real", "bits": "Word"},
         "logix": {"u16": "INT", "i16": "INT", "u32": "DINT", "f32": "REAL", "bits": "INT"}}
LONG = {"Real": "f32", "REAL": "f32", "UDInt": "u32", "DINT": "u32"}


def page():
    """name -> (word, type) of docs/plc-registers.md."""
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../../docs/plc-registers.md")
    with open(path, encoding="utf-8") as file:
        rows = re.findall(r"^\| (\d+) \| 4\d+ \| 4\d+ \| `(\w+)` \| (\w+) \|", file.read(), re.M)
    expect(len(rows) > 60, f"only {len(rows)} registers in {path}")
    return {name: (int(word), kind) for word, name, kind in rows}


class Network:
    """Modbus/TCP, with the faults of a plant: no line, a request bit that does not come through."""

    def __init__(self, host, port, base):
        self.host, self.port, self.base = host, port, base
        self.client, self.cut, self.deaf = None, False, False
        self.answers, self.exchanges = {}, 0  # sequence -> words of its result

    def __call__(self, function, address, words):
        if self.cut:
            if self.client:
                self.client.close()
            self.client = None
            return None
        if self.client is None:
            self.client = ModbusTcpClient(self.host, port=self.port, timeout=2)
            expect(self.client.connect(), f"no connection to {self.host}:{self.port}")
        self.exchanges += 1
        try:
            if function == 16:
                if self.deaf:
                    words = words[:7] + [words[7] & ~1]
                answer = self.client.write_registers(address, words, slave=255)
            else:
                answer = self.client.read_holding_registers(address, words, slave=255)
        except ModbusException as error:
            raise Wrong(f"function {function} at {address}: {error}") from error
        expect(not answer.isError(), f"function {function} at {address} was refused: {answer}")
        if function == 16:
            return []
        result = answer.registers[32:]
        if result[0] != 0 and result[0] == result[-1]:
            self.answers[result[0]] = result
        return answer.registers

    def words(self):
        """The whole map, as it stands."""
        return self.client.read_holding_registers(self.base, 88, slave=255).registers


class Registers(Network):
    """The PLC's own Modbus server: one connection, the map as holding registers, functions 3, 6 and 16 (MODBUS Application
    Protocol V1.1b3). Called by the program as a network is, so that one runs in either role."""

    def __init__(self, host, port, base):
        super().__init__(host, port, base)
        self.registers = [0] * 88
        self.listener = socket.create_server((host, port))
        self.listener.setblocking(False)
        self.peer, self.received = None, b""

    def __call__(self, function, address, words):
        at = address - self.base
        if function == 16:
            self.registers[at:at + len(words)] = words
        self.pump()
        if self.cut:
            return None
        return [] if function == 16 else self.registers[at:at + words]

    def words(self):
        self.pump()
        return list(self.registers)

    def close(self):
        if self.peer:
            self.peer.close()
        self.peer, self.received = None, b""

    def pump(self):
        try:
            peer, _ = self.listener.accept()
            self.close()
            self.peer = peer
            self.peer.setblocking(False)
        except BlockingIOError:
            pass
        if self.cut:
            self.close()
        while self.peer:
            try:
                chunk = self.peer.recv(4096)
            except BlockingIOError:
                return
            except ConnectionError:
                chunk = b""
            if not chunk:
                return self.close()
            self.received += chunk
            while self.peer and len(self.received) >= 8 and len(self.received) >= 6 + int.from_bytes(self.received[4:6], "big"):
                length = 6 + int.from_bytes(self.received[4:6], "big")
                frame, self.received = self.received[:length], self.received[length:]
                pdu = self.answer(frame[7:])
                self.peer.sendall(frame[:4] + struct.pack(">HB", 1 + len(pdu), frame[6]) + pdu)

    def answer(self, pdu):
        self.exchanges += 1
        function, address, count = struct.unpack(">BHH", pdu[:5])
        at = address - self.base
        if function == 3:
            if at < 0 or at + count > 88:
                return bytes([0x83, 2])
            words = list(self.registers)
            if self.deaf:
                words[7] &= ~1
            return struct.pack(f">BB{count}H", 3, 2 * count, *words[at:at + count])
        expect(function == 16 and len(pdu) == 6 + 2 * count and pdu[5] == 2 * count, f"the cell sends {pdu.hex()}")
        if at < 8 or at + count > 88:
            return bytes([0x90, 2])
        self.registers[at:at + count] = struct.unpack(f">{count}H", pdu[6:])
        result = self.registers[40:]
        if self.registers[17] & 8:
            expect(result[0] != 0 and result[0] == result[-1], "result_valid over half a result")
            self.answers[result[0]] = result
        return pdu[:5]


class Plc:
    """The exported program, scan after scan, with the hand of a user program."""

    def __init__(self, load, network):
        self.load, self.machine, self.network, self.speed = load, load(), network, 1.0
        self.now = self.real = time.monotonic()
        self.steps = []

    def scan(self):
        time.sleep(0.01)
        real = time.monotonic()
        self.now += (real - self.real) * self.speed
        self.real = real
        self.machine.scan(self.now)
        step = self.machine.output("step")
        if not self.steps or self.steps[-1] != step:
            self.steps.append(step)

    def say(self, **inputs):
        for name, value in inputs.items():
            self.machine.input(name, value)

    def __getitem__(self, name):
        return self.machine.output(name)

    def restart(self):
        """Power off and on: all variables begin anew, the inputs stay wired."""
        wired = {name: self[name] for name in ("enable", "robot_clear", "part_id", "supply_id")}
        self.machine = self.load()
        self.say(**wired)

    def wait(self, what, condition, seconds=30.0):
        end = time.monotonic() + seconds
        while True:
            self.scan()
            if condition():
                return
            expect(time.monotonic() < end, f"waited {seconds:.0f} s for {what}; steps {self.steps[-8:]}, problem "
                   f"{self['problem']}, not_ready {self['not_ready']:#x}, first_alarm {self['first_alarm']}, "
                   f"result_code {self['result_code']}")

    def for_seconds(self, seconds, what, condition):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.scan()
            expect(condition(), f"{what}; steps {self.steps[-8:]}")

    def wait_step(self, step, seconds=30.0):
        self.wait(f"step {step}", lambda: self["step"] == step, seconds)

    def finish(self):
        self.say(start=False)
        self.wait_step(IDLE)

    def through_the_robot(self):
        self.say(robot_clear=False)
        for _ in range(5):
            self.scan()
        self.say(robot_clear=True)


def check_map(make, exported):
    expected = {name: (word, TYPES[make][kind]) for name, (word, kind) in page().items()}
    for name in sorted(set(expected) | set(exported)):
        expect(exported.get(name) == expected.get(name),
               f"{name}: exported {exported.get(name)}, the page has {expected.get(name)}")


def number(words, at, kind, make):
    """A value out of words on the wire, by what the page says of this make's word order."""
    if kind in ("u16", "bits"):
        return words[at]
    pair = words[at:at + 2] if make == "s7" else [words[at + 1], words[at]]
    return struct.unpack(">f" if kind == "f32" else ">I", struct.pack(">HH", *pair))[0]


def check_result(plc, make, sequence):
    """The structure that the program hands on is what stood on the wire, name by name."""
    words = [0] * 40 + plc.network.answers[sequence]
    for name, (at, kind) in page().items():
        if at < 40:
            continue
        got, wire = plc.machine.output("result", name), number(words, at, kind, make)
        if kind in ("u16", "bits"):
            got &= 0xFFFF
        expect(got == wire, f"result.{name} is {got}, the wire had {wire}")


def check_constants(plc, make, exported):
    """Read at the exported offsets: what the page says is always there; and the cell's heartbeat beats."""
    words = plc.network.words()

    def value(name):
        at, kind = exported[name]
        return number(words, at, LONG.get(kind, "u16"), make)
    expect((value("map_version"), value("map_length")) == (2, 88), "map_version, map_length")
    expect(value("test_f32") == 123456.0 and value("test_u32") == 0x01020304, "test values")
    expect(value("word_order") == (0 if make == "s7" else 1), "word_order")
    beat, end = value("cell_heartbeat"), time.monotonic() + 3
    while value("cell_heartbeat") == beat:
        expect(time.monotonic() < end, "cell_heartbeat stands still at the exported offset")
        time.sleep(0.1)
        words = plc.network.words()


def pick(plc, make, found=True):
    """A pick through all steps. found=False: what the scan shows is the machine's affair (a busy one loses profiles)."""
    plc.say(part_id=1, supply_id=1, robot_clear=True, start=True)
    plc.steps = []
    plc.wait("done", lambda: plc["done"], 60)
    expect(plc["robot_may_enter"], "the robot may not enter after the scan")
    expect(plc["result_code"] == PICK_FOUND or not found, f"result code {plc['result_code']}")
    wanted = [REQUESTING, WAIT_SCAN_DONE, WAIT_RESULT, ACKNOWLEDGING, FINISHED]
    expect(plc.steps[-5:] == wanted, f"a pick went through the steps {plc.steps}")
    sequence = plc.machine.output("result", "result_sequence")
    check_result(plc, make, sequence)
    # A cell that writes into the PLC's server lets the flag fall first, and the words a telegram later.
    end = time.monotonic() + 2
    while any(plc.network.words()[40:]):
        expect(time.monotonic() < end, "the result was not acknowledged")
        time.sleep(0.01)
    plc.finish()
    return sequence


def fault_and_reset(plc):
    """The robot goes into the sweep: a fault of the cell, its alarm, reset."""
    plc.say(start=True)
    plc.wait_step(WAIT_SCAN_DONE)
    plc.say(robot_clear=False)
    plc.wait_step(FAULT)
    expect(plc["failed"] and plc["fault"] and plc["problem"] == 5, "a fault is not said")
    # (first_alarm may be another one: on a busy machine the emulated scanner loses profiles.)
    expect(plc["first_alarm"] != 0 and plc.machine.output("status", "last_alarm") == ROBOT_NOT_CLEAR,
           f"last alarm {plc.machine.output('status', 'last_alarm')}")
    plc.say(robot_clear=True, start=False, reset=True)
    plc.wait_step(RESETTING, 5)
    plc.say(reset=False)
    # Lost profiles are told until the next sweep; they are no fault.
    plc.wait("idle without fault",
             lambda: plc["step"] == IDLE and not plc["fault"] and plc["first_alarm"] in (0, PROFILES_LOST), 10)


def with_devices(plc, make):
    first = pick(plc, make, found=False)
    plc.through_the_robot()
    fault_and_reset(plc)
    expect(pick(plc, make, found=False) > first, "the sequence number did not count up")


def without_devices(plc, make):
    cycles = page()["cycles_total"][0]
    first = pick(plc, make)
    # The robot has to go in and come out before the next request.
    plc.say(start=True)
    plc.for_seconds(0.5, "a request before the robot was in", lambda: plc["step"] == IDLE)
    plc.through_the_robot()
    expect(pick(plc, make) == first + 1, "the sequence number did not count up")
    plc.through_the_robot()

    plc.say(part_id=999, start=True)
    plc.wait("the refusal of an unknown part", lambda: plc["done"], 5)
    expect(plc["result_code"] == UNKNOWN_PART, f"an unknown part gave {plc['result_code']}")
    plc.finish()

    # Abort in the sweep, held; then the next request.
    plc.say(part_id=1, start=True)
    plc.wait_step(WAIT_SCAN_DONE)
    plc.say(abort=True)
    plc.for_seconds(1, "an abort is held until it is taken back", lambda: plc["step"] == ABORTING)
    plc.say(abort=False)
    plc.wait("the end of the abort", lambda: plc["failed"], 5)
    plc.finish()

    # The line breaks with a request under way: asked again with the same number, one sweep in all.
    plc.wait("ready", lambda: plc["ready"])
    before = plc.network.words()[cycles]
    plc.say(start=True)
    plc.wait_step(WAIT_SCAN_DONE)
    asked = plc.machine.output("request", "sequence")
    plc.network.cut = True
    plc.wait_step(OFFLINE, 10)
    expect(plc["problem"] == 1 and not plc["connected"] and not plc["robot_may_enter"], "a broken line is not said")
    plc.network.cut = False
    plc.wait("the answer after the break", lambda: plc["done"])
    expect(plc.machine.output("result", "result_sequence") == asked, "another number after the break")
    check_result(plc, make, asked)
    expect(plc.network.words()[cycles] == before + 1, "a second sweep after the break")
    plc.finish()
    plc.through_the_robot()

    # The program is restarted with a request under way: nobody waits for its answer any more, and it is in nobody's way.
    plc.wait("ready", lambda: plc["ready"])
    plc.say(start=True)
    plc.wait_step(WAIT_SCAN_DONE)
    plc.restart()
    plc.wait_step(IDLE)
    plc.wait("the old answer to be gone", lambda: plc["ready"], 10)
    pick(plc, make)
    plc.through_the_robot()

    # The cell does not see the request: the program's own time-out, abort, and on. Its clock runs faster meanwhile.
    plc.wait("ready", lambda: plc["ready"])
    plc.network.deaf, plc.speed = True, 3.0
    plc.say(start=True)
    plc.steps = []
    plc.wait("the time-out", lambda: plc["failed"])
    expect(plc["timed_out"] and plc["problem"] == 4 and plc.steps[-3:] == [REQUESTING, ABORTING, FINISHED],
           f"steps {plc.steps}, problem {plc['problem']}")
    plc.network.deaf, plc.speed = False, 1.0
    plc.finish()
    pick(plc, make)


def main(arguments):
    if len(arguments) < 5 or arguments[0] not in TYPES:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    make, folder, host, port, base = arguments[0], arguments[1], arguments[2], int(arguments[3]), int(arguments[4])
    network = (Registers if "--serve" in arguments else Network)(host, port, base)
    try:
        if make == "s7":
            source = Source(os.path.join(folder, "BinPick.scl"))
            exported = source.exchanged()[2]
            plc = Plc(lambda: Cpu(source, network, port, base), network)
        else:
            source = Project(folder)
            exported = source.exchanged()
            plc = Plc(lambda: Controller(source, network, base), network)
        check_map(make, exported)
        plc.say(enable=True, robot_clear=True, part_id=1, supply_id=1)
        if "--refused" in arguments:
            plc.say(start=True)
            plc.wait("the word order to be refused", lambda: plc["problem"] == 3, 5)
            plc.for_seconds(2, "it went on with the wrong word order", lambda: plc["step"] == OFFLINE)
            print(f"{make}: the other word order is refused")
            return 0
        plc.wait_step(IDLE, 10)
        check_constants(plc, make, exported)
        (without_devices if "--no-devices" in arguments else with_devices)(plc, make)
    except Wrong as wrong:
        print(f"check.py {make}: {wrong}", file=sys.stderr)
        return 1
    print(f"{make}: {len(exported)} registers as the page has them, the exported program picks; {network.exchanges} exchanges")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
