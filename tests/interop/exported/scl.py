"""Reads an SCL source as TIA Portal's external sources are written, lays its standard data blocks out and runs its
function block. MB_CLIENT is played as its help describes it: jobs by level, inputs unchanged while one runs; MB_SERVER
likewise: the area is what it serves, from HR_Start_Offset on."""
import re

from memory import Layout, Memory, Structure, Timer
from structured_text import Parser, Wrong, expect, run

# Bytes and struct's code of the elementary types; all begin at an even byte, S7 has the high byte first.
ELEMENTARY = {"UInt": (2, "H"), "Word": (2, "H"), "Int": (2, "h"), "UDInt": (4, "I"), "DInt": (4, "i"),
              "DWord": (4, "I"), "Real": (4, "f")}
RANGES = {"UInt": (0, 65535), "Word": (0, 65535), "Int": (-32768, 32767)}
MEMBER = re.compile(r'^\s*(\w+)(?:\s*\{[^}]*\})?\s*:\s*("?)(\w+)\2;', re.M)


class Source:
    def __init__(self, path):
        with open(path, "rb") as file:
            raw = file.read()
        expect(raw.startswith(b"\xef\xbb\xbf"), "no byte order mark: TIA Portal would take it for the local code page")
        raw = raw[3:]
        expect(raw.count(b"\n") == raw.count(b"\r\n") == raw.count(b"\r"), "mixed line ends")
        self.text = re.sub(r"//[^\n]*", "", raw.decode("ascii").replace("\r\n", "\n"))
        self.layouts = {}
        blocks = re.findall(r'^(TYPE|DATA_BLOCK|FUNCTION_BLOCK) "(\w+)"(.*?)^END_\1$', self.text, re.M | re.S)
        expect([kind for kind, _, _ in blocks] == sorted((k for k, _, _ in blocks),
               key=["TYPE", "DATA_BLOCK", "FUNCTION_BLOCK"].index), "a block stands before what it uses")
        self.data_blocks, self.functions = {}, {}
        for kind, name, body in blocks:
            if kind == "TYPE":
                self.layouts[name] = self.layout(self.struct(body))
            elif kind == "DATA_BLOCK":
                self.data_blocks[name] = body
            else:
                self.functions[name] = body

    @staticmethod
    def struct(body):
        return re.search(r"^\s*STRUCT$(.*?)^\s*END_STRUCT;", body, re.M | re.S).group(1)

    def layout(self, text):
        """Standard access: in the order of declaration, each member at an even byte, structures padded to one."""
        members, at = {}, 0
        rest = MEMBER.sub("", text)
        expect(not rest.strip(), f"members that cannot be read: {rest.strip()[:80]!r}")
        for name, quoted, kind in MEMBER.findall(text):
            expect(name not in members, f"{name} twice in one structure")
            if quoted:
                expect(kind in self.layouts, f'"{kind}" is used before it is declared')
                size, kind = self.layouts[kind].size, self.layouts[kind]
            else:
                expect(kind in ELEMENTARY, f"{kind} in a block that is exchanged")
                size = ELEMENTARY[kind][0]
            at += at % 2
            members[name] = (at, kind)
            at += size
        return Layout(members, at + at % 2)

    def exchanged(self):
        """Layout of the data block with standard access; name -> (word, type) over all its structures."""
        name, body = next((n, b) for n, b in self.data_blocks.items() if "S7_Optimized_Access := 'FALSE'" in b)
        layout = self.layout(self.struct(body))
        out = {}

        def walk(inner, at):
            for member, (offset, kind) in inner.members.items():
                if isinstance(kind, Layout):
                    walk(kind, at + offset)
                else:
                    expect(member not in out, f"{member} twice")
                    out[member] = ((at + offset) // 2, kind)
        walk(layout, 0)
        return name, layout, out


class Service:
    """An instance of MB_SERVER."""
    offset = 0


class Cpu(Memory):
    """One S7 CPU with the function block of the source. `exchange(function, address, words)` is the network."""
    order = ">"
    types = {name: code for name, (_, code) in ELEMENTARY.items()}

    def __init__(self, source, exchange, port, base):
        super().__init__()
        self.exchange, self.port, self.base = exchange, port, base
        block, layout, _ = source.exchanged()
        self.declare(f'"{block}"', Structure(layout, self))
        self.connection = dict(re.findall(r"connect\.([\w.\[\]]+) := ([^;]+);", source.data_blocks["BinPick_Connection"]))
        (self.name, body), = source.functions.items()
        declared, statements = body.split("\nBEGIN\n")
        for section, text in re.findall(r"^\s*VAR(_\w+)?$(.*?)^\s*END_VAR$", declared, re.M | re.S):
            rest = MEMBER.sub("", text)
            expect(not rest.strip(), f"declarations that cannot be read: {rest.strip()[:80]!r}")
            for name, quoted, kind in MEMBER.findall(text):
                if quoted:
                    value = Structure(source.layouts[kind], self)
                else:
                    value = Timer() if kind == "TON_TIME" else "client" if kind == "MB_CLIENT" else \
                        Service() if kind == "MB_SERVER" else False if kind == "Bool" else 0
                    expect(kind in ("TON_TIME", "MB_CLIENT", "MB_SERVER", "Bool") or kind in RANGES, f"{name} : {kind}")
                self.declare("#" + name, value, RANGES.get(kind))
        self.program = Parser(statements, literals=True).program()
        self.running, self.job_ended = None, None

    def scan(self, now):
        self.now = now
        run(self.program, self)

    def input(self, name, value):
        self.set(["#" + name], value)

    def output(self, name, *members):
        return self.get(["#" + name, *members])

    def timer_output(self, timer, rest):
        expect(rest == ["Q"], f"a timer has no {rest}")
        return timer.q

    def call(self, path, args):
        instance, rest = self.find(path)
        expect(not rest, f"{path} cannot be called")
        if isinstance(instance, Timer):
            values = {name: self.argument(value) for name, _, value in args}
            instance.enabled, instance.preset = values["IN"], values["PT"]
            instance.update(self.now)
            return
        serves = isinstance(instance, Service)
        expect(serves or instance == "client", f"{path} cannot be called")
        inputs = {name: value for name, way, value in args if way == ":="}
        outputs = {name: target for name, way, target in args if way == "=>"}
        answer = self.mb_server(instance, inputs) if serves else self.mb_client(inputs)
        for name, value in answer.items():
            self.set(outputs[name], value)

    def set(self, path, new):
        instance = self.variables.get(path[0])
        if isinstance(instance, Service):
            expect(path[1:] == ["HR_Start_Offset"] and 0 <= new <= 65535, f"{path} := {new}")
            instance.offset = new
            return
        super().set(path, new)

    def mb_server(self, service, inputs):
        expect(inputs["CONNECT"] == ("get", ['"BinPick_Connection"', "connect"]), "CONNECT")
        c = self.connection
        expect(int(c["ConnectionType"].replace("16#", ""), 16) == 11 and c["ActiveEstablished"] == "FALSE", f"{c}")
        expect(int(c["LocalPort"]) == self.port and c["RemotePort"] == "0" and 1 <= int(c["ID"]) <= 4095, f"{c}")
        expect(service.offset == self.base, f"HR_Start_Offset is {service.offset}")
        area = self.get(inputs["MB_HOLD_REG"][1])
        expect(isinstance(area, Structure) and area.layout.size == 2 * 88, "MB_HOLD_REG has not 88 words")
        answer = {"NDR": False, "DR": False, "ERROR": False, "STATUS": 0x7002}
        if self.argument(inputs["DISCONNECT"]):
            return answer
        first = service.offset
        words = [int.from_bytes(area.bytes()[i:i + 2], "big") for i in range(0, 16, 2)]
        self.exchange(16, first, words)
        read = self.exchange(3, first + 8, 80)
        if read is not None:
            area.fill(area.bytes()[:16] + b"".join(w.to_bytes(2, "big") for w in read))
        return answer

    def mb_client(self, inputs):
        expect(inputs["CONNECT"] == ("get", ['"BinPick_Connection"', "connect"]), "CONNECT")
        area_path = inputs["MB_DATA_PTR"][1]
        key = tuple(self.argument(inputs[n]) for n in ("MB_MODE", "MB_DATA_ADDR", "MB_DATA_LEN")) + tuple(area_path)
        idle = {"DONE": False, "BUSY": False, "ERROR": False, "STATUS": 0x7000}
        if self.running is not None:
            expect(self.running == key, f"an input changed while BUSY: {self.running} to {key}")
            self.running = None
            ended, self.job_ended = self.job_ended, None
            return {**idle, **ended}
        if self.argument(inputs["DISCONNECT"]) or not self.argument(inputs["REQ"]):
            return idle
        c = self.connection
        expect(int(c["ConnectionType"].replace("16#", ""), 16) == 11 and c["ActiveEstablished"] == "TRUE", f"{c}")
        expect(int(c["RemotePort"]) == self.port and 1 <= int(c["ID"]) <= 4095, f"{c}")
        self.running = key
        mode, address, length = key[:3]
        first = address - (400001 if address > 400000 else 40001)
        area = self.get(area_path)
        expect(isinstance(area, Structure) and area.layout.size == 2 * length, f"{area_path} has not {length} words")
        if mode == 2:
            answer = self.exchange(16, first, [int.from_bytes(area.bytes()[i:i + 2], "big")
                                               for i in range(0, 2 * length, 2)])
        elif mode == 0:
            answer = self.exchange(3, first, length)
            if answer is not None:
                area.fill(b"".join(w.to_bytes(2, "big") for w in answer))
        else:
            raise Wrong(f"MB_MODE {mode}")
        self.job_ended = {"DONE": True, "STATUS": 0} if answer is not None else {"ERROR": True, "STATUS": 0x80C4}
        return {**idle, "BUSY": True, "STATUS": 0x7002}
