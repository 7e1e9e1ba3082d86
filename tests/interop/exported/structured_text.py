"""Structured text as S7 (SCL) and Logix write it: parsed and run. Enough of the language for a handshake; what is not
understood is an error. Written from the languages' public descriptions; no code or table of binpick is used."""
import re

TOKEN = re.compile(r"""(?P<space>\s+)|(?P<comment>//[^\n]*|\(\*.*?\*\))
    |(?P<time>T\#\d+ms)|(?P<hex>16\#[0-9A-Fa-f]+)|(?P<real>\d+\.\d+)|(?P<int>\d+)
    |(?P<quoted>"[^"]+")|(?P<bit>%X\d+)|(?P<name>[A-Za-z_]\w*)
    |(?P<mark>:=|=>|<>|<=|>=|[-+*/=<>()\[\],;:.\#])""", re.X | re.S)
KEYWORDS = {"IF", "THEN", "ELSIF", "ELSE", "END_IF", "CASE", "OF", "END_CASE", "AND", "OR", "NOT", "TRUE", "FALSE"}


class Wrong(Exception):
    """The text is no structured text, or does what it must not."""


def expect(condition, what):
    if not condition:
        raise Wrong(what)


def tokens(text):
    at, out = 0, []
    while at < len(text):
        m = TOKEN.match(text, at)
        expect(m, f"cannot read {text[at:at + 40]!r}")
        at = m.end()
        if m.lastgroup not in ("space", "comment"):
            kind = "keyword" if m.lastgroup == "name" and m.group() in KEYWORDS else m.lastgroup
            out.append((kind, m.group()))
    return out + [("end", "")]


class Parser:
    """Builds tuples: ("set", path, expr), ("call", path, args), ("if", [(expr, block)…]), ("case", expr, {number: block})."""

    def __init__(self, text, literals):
        self.tokens, self.at, self.literals = tokens(text), 0, literals  # literals: are TRUE and FALSE words here

    def peek(self, ahead=0):
        return self.tokens[min(self.at + ahead, len(self.tokens) - 1)]

    def take(self, text=None):
        kind, value = self.peek()
        expect(text is None or value == text, f"expected {text!r}, found {value!r} before "
               f"{' '.join(v for _, v in self.tokens[self.at:self.at + 12])!r}")
        self.at += 1
        return value

    def program(self):
        block = self.block()
        expect(self.peek()[0] == "end", f"left over: {self.peek()[1]!r}")
        return block

    def block(self):
        out = []
        while True:
            kind, value = self.peek()
            label = kind == "int" and self.peek(1)[1] == ":"
            if kind == "end" or value in ("ELSIF", "ELSE", "END_IF", "END_CASE") or label:
                return out
            out.append(self.statement())

    def statement(self):
        if self.peek()[1] == "IF":
            return self.choice()
        if self.peek()[1] == "CASE":
            return self.case()
        path = self.path()
        if self.peek()[1] == "(":
            args = self.arguments()
            self.take(";")
            return ("call", path, args)
        self.take(":=")
        value = self.expression()
        self.take(";")
        return ("set", path, value)

    def choice(self):
        arms = []
        word = "IF"
        while word != "END_IF":
            self.take(word)
            condition = ("value", True)
            if word != "ELSE":
                condition = self.expression()
                self.take("THEN")
            arms.append((condition, self.block()))
            word = self.peek()[1]
        self.take("END_IF")
        self.take(";")
        return ("if", arms)

    def case(self):
        self.take("CASE")
        selector = self.expression()
        self.take("OF")
        arms = {}
        while self.peek()[1] != "END_CASE":
            number = int(self.take())
            self.take(":")
            expect(number not in arms, f"two branches for {number}")
            arms[number] = self.block()
        self.take("END_CASE")
        self.take(";")
        return ("case", selector, arms)

    def path(self):
        """Names, [index] and bit numbers; the first has its mark: '#x', '"x"', 'x'."""
        if self.peek()[1] == "#":
            self.take()
            first = "#" + self.take()
        else:
            kind, first = self.peek()
            expect(kind in ("name", "quoted"), f"{first!r} is no variable")
            self.take()
        out = [first]
        while True:
            if self.peek()[1] == ".":
                self.take()
                kind, value = self.peek()
                expect(kind in ("name", "bit", "int"), f"{value!r} is no member")
                out.append(int(value[2:]) if kind == "bit" else int(value) if kind == "int" else value)
                self.take()
            elif self.peek()[1] == "[":
                self.take()
                out.append([int(self.take())])
                self.take("]")
            else:
                return out

    def arguments(self):
        self.take("(")
        out = []
        while self.peek()[1] != ")":
            named = self.peek()[0] == "name" and self.peek(1)[1] in (":=", "=>")
            name, way = (self.take(), self.take()) if named else (None, ":=")
            out.append((name, way, self.path() if way == "=>" else self.expression()))
            if self.peek()[1] != ")":
                self.take(",")
        self.take(")")
        return out

    def expression(self, level=0):
        levels = [("OR",), ("AND",), ("=", "<>", "<", ">", "<=", ">="), ("+", "-")]
        if level == len(levels):
            return self.factor()
        left = self.expression(level + 1)
        while self.peek()[1] in levels[level] and self.peek()[0] in ("keyword", "mark"):
            operator = self.take()
            left = (operator, left, self.expression(level + 1))
        return left

    def factor(self):
        kind, value = self.peek()
        if value == "NOT":
            self.take()
            return ("NOT", self.factor())
        if value == "(":
            self.take()
            inner = self.expression()
            self.take(")")
            return inner
        if kind in ("name", "quoted") or value == "#":
            return ("get", self.path())
        self.take()
        if kind == "keyword":
            expect(value in ("TRUE", "FALSE") and self.literals, f"{value!r} is no value here")
            return ("value", value == "TRUE")
        readers = {"int": int, "real": float, "hex": lambda v: int(v[3:], 16), "time": lambda v: int(v[2:-2]) / 1000}
        expect(kind in readers, f"{value!r} is no value")
        return ("value", readers[kind](value))


def evaluate(expr, memory):
    what = expr[0]
    if what == "value":
        return expr[1]
    if what == "get":
        return memory.get(expr[1])
    if what == "NOT":
        value = evaluate(expr[1], memory)
        expect(isinstance(value, bool), f"NOT of {value!r}")
        return not value
    left, right = evaluate(expr[1], memory), evaluate(expr[2], memory)
    if what in ("AND", "OR"):
        expect(isinstance(left, bool) and isinstance(right, bool), f"{left!r} {what} {right!r}")
        return (left and right) if what == "AND" else (left or right)
    expect(not isinstance(left, bool) and not isinstance(right, bool), f"{left!r} {what} {right!r}")
    return {"=": left == right, "<>": left != right, "<": left < right, ">": left > right, "<=": left <= right,
            ">=": left >= right, "+": left + right, "-": left - right}[what]


def run(block, memory):
    for statement in block:
        what = statement[0]
        if what == "set":
            memory.set(statement[1], evaluate(statement[2], memory))
        elif what == "call":
            memory.call(statement[1], statement[2])
        elif what == "if":
            for condition, inner in statement[1]:
                value = evaluate(condition, memory)
                expect(isinstance(value, bool), f"IF {value!r}")
                if value:
                    run(inner, memory)
                    break
        else:
            selected = evaluate(statement[1], memory)
            expect(selected in statement[2], f"CASE has no branch for {selected}")
            run(statement[2][selected], memory)
