"""A PLC's memory: structures as bytes in the maker's own layout, plain values, on-delay timers."""
import struct

from structured_text import expect, evaluate, Wrong


class Layout:
    """Members of a structure: name -> (byte offset, type). `types` knows the elementary ones (size, code)."""

    def __init__(self, members, size):
        self.members, self.size = members, size


class Structure:
    def __init__(self, layout, machine, data=None, at=0):
        self.layout, self.machine, self.at = layout, machine, at
        self.data = bytearray(layout.size) if data is None else data

    def bytes(self):
        return bytes(self.data[self.at:self.at + self.layout.size])

    def fill(self, content):
        expect(len(content) == self.layout.size, f"{len(content)} bytes into a structure of {self.layout.size}")
        self.data[self.at:self.at + self.layout.size] = content

    def member(self, name):
        expect(name in self.layout.members, f"there is no member {name}")
        offset, kind = self.layout.members[name]
        if isinstance(kind, Layout):
            return Structure(kind, self.machine, self.data, self.at + offset)
        return Cell(self, self.at + offset, self.machine.types[kind])


class Cell:
    """One elementary value in a structure."""

    def __init__(self, owner, at, code):
        self.owner, self.at, self.code = owner, at, owner.machine.order + code

    def read(self):
        return struct.unpack_from(self.code, self.owner.data, self.at)[0]

    def write(self, value):
        try:
            struct.pack_into(self.code, self.owner.data, self.at, value)
        except struct.error as error:
            raise Wrong(f"{value!r} does not fit: {error}") from error


class Timer:
    """On-delay: Q is 1 once IN has been 1 for the preset; IN = 0 resets."""

    def __init__(self):
        self.preset, self.enabled, self.since, self.q = 0.0, False, None, False

    def update(self, now):
        if not self.enabled:
            self.since = None
        elif self.since is None:
            self.since = now
        self.q = self.since is not None and now - self.since >= self.preset


class Memory:
    """Variables by name. A machine gives `order` (struct's), `types`, and what calls do."""

    def __init__(self):
        self.variables, self.ranges, self.now = {}, {}, 0.0

    def declare(self, name, value, value_range=None):
        expect(name not in self.variables, f"{name} is declared twice")
        self.variables[name] = value
        self.ranges[name] = value_range

    def find(self, path):
        expect(path[0] in self.variables, f"{path[0]} is not declared")
        value = self.variables[path[0]]
        for i, part in enumerate(path[1:], 1):
            if isinstance(value, Structure) and isinstance(part, str):
                value = value.member(part)
            else:
                return value, path[i:]
        return value, []

    def get(self, path):
        value, rest = self.find(path)
        if isinstance(value, Timer):
            return self.timer_output(value, rest)
        if isinstance(value, Cell):
            value = value.read()
        if rest:
            expect(len(rest) == 1 and isinstance(rest[0], int) and 0 <= rest[0] < 16 and isinstance(value, int),
                   f"{path} is no bit")
            return bool((value & 0xFFFF) >> rest[0] & 1)
        return value

    def set(self, path, new):
        target, rest = self.find(path)
        if isinstance(target, Timer):
            self.timer_input(target, rest, new)
        elif isinstance(target, Structure):
            expect(not rest and isinstance(new, Structure) and new.layout is target.layout, f"{path}: other structure")
            target.fill(new.bytes())
        elif isinstance(target, Cell) and rest:
            expect(isinstance(new, bool), f"{path} := {new!r}")
            word = target.read() & 0xFFFF
            word = word | 1 << rest[0] if new else word & ~(1 << rest[0])
            target.write(word if target.code[-1].isupper() or word < 0x8000 else word - 0x10000)
        elif isinstance(target, Cell):
            expect(not isinstance(new, bool), f"{path} := {new!r}")
            target.write(new)
        else:
            expect(not rest and isinstance(new, bool) == isinstance(target, bool), f"{path} := {new!r}")
            low, high = self.ranges[path[0]] or (False, True)
            expect(low <= new <= high, f"{path} := {new} is out of range")
            self.variables[path[0]] = new

    def argument(self, expr):
        return evaluate(expr, self)

    def timer_output(self, timer, rest):
        raise Wrong(f"a timer has no {rest}")

    def timer_input(self, timer, rest, value):
        raise Wrong(f"a timer has no {rest}")

    def call(self, path, args):
        raise Wrong(f"unknown call {path}")
