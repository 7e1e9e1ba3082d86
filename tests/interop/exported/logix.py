"""Reads L5X files and a tag CSV as Studio 5000 writes them, lays structures out as a Logix controller does, and runs the
structured text of a program. No code or table of binpick is used."""
import csv
import os
import re
import struct
import xml.etree.ElementTree as ElementTree

from memory import Layout, Memory, Structure, Timer
from structured_text import Parser, Wrong, expect, run

# Bytes and struct's code of the elementary types; each begins at a multiple of its size, the low byte stands first.
ELEMENTARY = {"INT": (2, "h"), "DINT": (4, "i"), "REAL": (4, "f")}
RADIX = {"BOOL": {"Decimal"}, "INT": {"Decimal", "Hex", "Binary"}, "DINT": {"Decimal", "Hex", "Binary"}, "REAL": {"Float"}}
NAME = re.compile(r"(?!.*__)[A-Za-z_]\w{0,39}(?<!_)")


def read_bytes(path):
    with open(path, "rb") as file:
        raw = file.read()
    expect(raw.count(b"\n") == raw.count(b"\r\n") == raw.count(b"\r"), f"{path}: mixed line ends")
    raw.decode("ascii")
    return raw


def attributes(element, **wanted):
    for name, value in wanted.items():
        got = element.get(name)
        expect(got is not None and re.fullmatch(value, got), f"<{element.tag}> {name}={got!r}, not {value}")


def read_l5x(path, target_type):
    """The controller of a partial export, and the name of its target."""
    read_bytes(path)
    root = ElementTree.parse(path).getroot()
    expect(root.tag == "RSLogix5000Content", f"{path}: root is {root.tag}")
    attributes(root, SchemaRevision=r"1\.0", SoftwareRevision=r"\d+\.\d+", TargetName=NAME.pattern, TargetType=target_type,
               ContainsContext="true", ExportOptions=".*Context.*")
    controller, = root
    attributes(controller, Use="Context", Name=NAME.pattern)
    targets = [e for e in root.iter() if e.get("Use") == "Target"]
    expect(len(targets) == 1 and targets[0].tag == target_type and targets[0].get("Name") == root.get("TargetName"),
           f"{path}: the target is not the one that its head names")
    return controller, root.get("TargetName")


def layout_of(data_type):
    attributes(data_type, Name=NAME.pattern, Family="NoFamily", Class="User")
    members, at, widest = {}, 0, 4
    for member in data_type.find("Members"):
        kind = member.get("DataType")
        attributes(member, Name=NAME.pattern, Dimension="0", Hidden="false", ExternalAccess="Read/Write")
        expect(kind in ELEMENTARY and member.get("Radix") in RADIX[kind], f"{member.attrib}")
        expect(member.get("Name") not in members, f"{member.get('Name')} twice")
        size = ELEMENTARY[kind][0]
        at += -at % size
        members[member.get("Name")] = (at, kind)
        at += size
    return Layout(members, at + -at % widest)


class Project:
    def __init__(self, folder):
        def path(name):
            return os.path.join(folder, name)
        controller, name = read_l5x(path("BinPick.L5X"), "Program")
        self.layouts = {t.get("Name"): layout_of(t) for t in controller.find("DataTypes")}
        for kind, layout in self.layouts.items():  # each alone, for those who import types one by one
            alone, target = read_l5x(path(kind + ".L5X"), "DataType")
            single, = alone.find("DataTypes")
            expect(target == kind and layout_of(single).members == layout.members, f"{kind}.L5X differs from BinPick.L5X")
        program, = controller.find("Programs")
        attributes(program, MainRoutineName="Main", Disabled="false")
        self.tags = {("", t.get("Name")): self.tag(t) for t in controller.find("Tags")}
        self.tags.update({(name, t.get("Name")): self.tag(t) for t in program.find("Tags")})
        routine, = program.find("Routines")
        attributes(routine, Name="Main", Type="ST")
        lines = list(routine.find("STContent"))
        expect([line.get("Number") for line in lines] == [str(i) for i in range(len(lines))], "line numbers")
        self.text = "\n".join((line.text or "").strip("\n") for line in lines) + "\n"
        pasted = read_bytes(path("BinPick.st")).decode().replace("\r\n", "\n")
        expect(pasted == self.text, "BinPick.st differs from the routine in BinPick.L5X")
        self.check_csv(path("BinPick_Tags.CSV"))

    def tag(self, tag):
        kind, dimension = tag.get("DataType"), tag.get("Dimensions")
        attributes(tag, Name=NAME.pattern, TagType="Base", Constant="false", ExternalAccess="Read/Write")
        expect(kind in RADIX or kind in self.layouts or kind == "FBD_TIMER", f"{tag.attrib}")
        expect(tag.get("Radix") in RADIX[kind] if kind in RADIX else tag.get("Radix") is None, f"{tag.attrib}")
        return kind + (f"[{dimension}]" if dimension else "")

    def check_csv(self, path):
        rows = list(csv.reader(read_bytes(path).decode().splitlines()))
        head = rows.index(["TYPE", "SCOPE", "NAME", "DESCRIPTION", "DATATYPE", "SPECIFIER", "ATTRIBUTES"])
        expect(rows[head - 1] == ["0.3"] and all(row[0] == "remark" for row in rows[:head - 1]), "head of the tag CSV")
        found = {}
        for kind, scope, name, text, data_type, specifier, attribute in rows[head + 1:]:
            expect(kind == "TAG" and specifier == "" and re.fullmatch(r"\((RADIX := \w+, )?Constant := false, "
                   r"ExternalAccess := Read/Write\)", attribute), f"{name}: {attribute}")
            expect(not re.search(r"\$(?![$QNT'])|'(?<!\$')", text), f"{name}: {text!r} is not escaped")
            expect(("RADIX" in attribute) == (data_type.split("[")[0] in RADIX), f"{name}: {attribute}")
            found[(scope, name)] = data_type
        expect(found == self.tags, "the tag CSV and BinPick.L5X declare other tags")

    def exchanged(self):
        """name -> (word, type): write array, then read array, as the program copies structures from and to them."""
        copies = re.findall(r"^CPS\((\w+)(?:\[(\d+)\])?, (\w+)(?:\[(\d+)\])?, (\d+)\);", self.text, re.M)
        written = sum(int(self.dimension(to)) for _, _, to, _, _ in copies if ("", to) in self.tags)
        out = {}
        for source, index, to, to_index, _ in copies:
            reads = ("", source) in self.tags
            kind = self.tags[("BinPick", to if reads else source)]
            start = written + int(index) if reads else int(to_index)
            for member, (offset, elementary) in self.layouts[kind].members.items():
                expect(member not in out, f"{member} twice")
                out[member] = (start + offset // 2, elementary)
        return out

    def dimension(self, name):
        return re.search(r"\[(\d+)\]", self.tags[("", name)]).group(1)


class Controller(Memory):
    """One Logix controller with the program, and a Modbus client that moves both arrays in every scan.
    `exchange(function, address, words)` is the network."""
    order = "<"
    types = {name: code for name, (_, code) in ELEMENTARY.items()}

    def __init__(self, project, exchange, base):
        super().__init__()
        self.exchange = exchange
        for (_, name), kind in project.tags.items():
            array = re.fullmatch(r"INT\[(\d+)\]", kind)
            value = [0] * int(array.group(1)) if array else Timer() if kind == "FBD_TIMER" else \
                Structure(project.layouts[kind], self) if kind in project.layouts else False if kind == "BOOL" else 0
            self.declare(name, value, (-32768, 32767) if kind == "INT" else None)
        self.program = Parser(project.text, literals=False).program()
        self.write_at, self.read_at = base, base + len(self.variables["BinPick_Write"])

    def scan(self, now):
        self.now = now
        if self.get(["enable"]):
            words = [v & 0xFFFF for v in self.variables["BinPick_Write"]]
            if self.exchange(16, self.write_at, words) is not None:
                answer = self.exchange(3, self.read_at, len(self.variables["BinPick_Read"]))
                if answer is not None:
                    self.variables["BinPick_Read"][:] = [w - 0x10000 if w > 0x7FFF else w for w in answer]
        run(self.program, self)

    def set(self, path, new):
        # A BOOL is written 0 or 1 here.
        target, rest = self.find(path)
        boolean = isinstance(target, bool) or rest
        if boolean and not isinstance(target, Timer) and not isinstance(new, bool) and new in (0, 1):
            new = bool(new)
        super().set(path, new)

    def input(self, name, value):
        self.set([name], value)

    def output(self, name, *members):
        return self.get([name, *members])

    def timer_output(self, timer, rest):
        expect(rest == ["DN"], f"FBD_TIMER has no {rest}")
        return timer.q

    def timer_input(self, timer, rest, value):
        if rest == ["PRE"]:
            timer.preset = value / 1000
        else:
            expect(rest == ["TimerEnable"] and isinstance(value, bool), f"FBD_TIMER has no {rest}")
            timer.enabled = value

    def call(self, path, args):
        values = [value for _, _, value in args]
        expect(all(name is None for name, _, _ in args), f"{path} with named parameters")
        if path == ["TONR"]:
            timer, = (self.find(value[1])[0] for value in values)
            timer.update(self.now)
        elif path in (["COP"], ["CPS"]):
            self.copy(values[0][1], values[1][1], values[2][1])
        else:
            raise Wrong(f"unknown instruction {path}")

    def copy(self, source, to, length):
        """COP: bytes; length counts elements of the destination."""
        target, rest = self.find(to)
        content, begin = self.find(source)
        start = begin[0][0] if begin else 0
        data = content.bytes() if isinstance(content, Structure) else struct.pack(f"<{len(content)}h", *content)[2 * start:]
        if isinstance(target, Structure):
            expect(length == 1 and len(data) >= target.layout.size, f"COP to {to} reads past its source")
            target.fill(data[:target.layout.size])
        else:
            first = rest[0][0]
            expect(first + length <= len(target) and len(data) == 2 * length, f"COP to {to}")
            target[first:first + length] = struct.unpack(f"<{length}h", data[:2 * length])
