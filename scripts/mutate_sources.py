"""Mutants of a C++ source: libclang says where they stand, and the rewritten source holds all of them, each behind a number.

`a - b` becomes `(espalier_mutants::on(17) ? (a + b) : (a - b))`, so one compilation serves every mutant of a file.
"""

import re
from dataclasses import asdict, dataclass

from clang.cindex import Config, CursorKind, Index, TranslationUnit

Config.set_library_file("/usr/lib/llvm-14/lib/libclang-14.so.1")
OTHER = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "&&": "||", "||": "&&", "+": "-", "-": "+",
         "/": "*", "*": "/", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "min": "max", "max": "min"}
RULES = {"<": "comparison", "<=": "comparison", ">": "comparison", ">=": "comparison", "==": "comparison", "!=": "comparison",
         "&&": "and/or", "||": "and/or"}
# Text of messages and what is known when compiling have no mutants.
LEFT_OUT = {CursorKind.CXX_THROW_EXPR, CursorKind.STATIC_ASSERT, CursorKind.ENUM_DECL, CursorKind.PARM_DECL,
            CursorKind.DECL_REF_EXPR, CursorKind.TEMPLATE_TYPE_PARAMETER, CursorKind.TEMPLATE_NON_TYPE_PARAMETER,
            CursorKind.TYPE_ALIAS_DECL}
MESSAGES = re.compile(r"^(fmt::)?(format|print|format_to)\b|^(static_assert|assert)\b|.*(reserve|shrink_to_fit)\(")
NAME = "espalier_mutants::"


@dataclass
class Mutant:
    path: str  # of the source
    line: int
    begin: int  # the bytes of the source that are changed
    end: int
    rule: str
    before: str
    after: str
    form: str  # the new text; NUMBER, and INNER for the text of these bytes with the mutants inside them
    room: str = ""
    number: int = 0
    part: tuple = (0, 0)  # where it stands in the rewritten source

    def json(self):
        return {k: v for k, v in asdict(self).items() if k in ("room", "path", "line", "rule", "before", "after", "number")}


def one_line(text):
    return re.sub(r"\s+", " ", re.sub(r"//[^\n]*", " ", text)).strip()


class Finder:
    """All mutants of a source, in the order of the file."""

    def __init__(self, path, text, unit):
        self.path, self.text, self.mutants = path, text, []
        self.macros = [self.range(c) for c in unit.cursor.get_children()
                       if c.kind == CursorKind.MACRO_INSTANTIATION and self.inside(c)]
        for child in unit.cursor.get_children():
            if self.inside(child) and not child.kind.is_preprocessing():
                self.visit(child, None)
        self.mutants = list({(m.begin, m.end, m.after): m for m in self.mutants}.values())

    def inside(self, cursor):
        return cursor.location.file is not None and cursor.location.file.name == str(self.path)

    @staticmethod
    def range(cursor):
        return cursor.extent.start.offset, cursor.extent.end.offset

    def of(self, cursor):
        begin, end = self.range(cursor)
        return self.text[begin:end]

    def add(self, cursor, rule, after, form, begin=None, end=None):
        first, last = self.range(cursor)
        begin, end = first if begin is None else begin, last if end is None else end
        if end <= begin or any(b <= begin and end <= e for b, e in self.macros):
            return
        before = one_line(self.text[begin:end])
        self.mutants.append(Mutant(str(self.path), self.text.count("\n", 0, begin) + 1, begin, end, rule, before, after, form))

    def choice(self, cursor, rule, after, wrap="({})"):
        text = wrap.format(after) if after else "void()"
        self.add(cursor, rule, one_line(after) or "nothing", f"({NAME}on(NUMBER) ? {text} : {wrap.format('INNER')})")

    def negated(self, cursor):
        self.add(cursor, "negated condition", f"!({one_line(self.of(cursor))})", f"({NAME}on(NUMBER) != bool(INNER))")

    def visit(self, cursor, parent):
        kind = cursor.kind
        head = self.of(cursor).split("{", 1)[0] if kind.is_declaration() else ""
        if kind in LEFT_OUT or re.search(r"\b(constexpr|consteval)\b|^(static )?const .*= *[-\d.e]+$", head):
            return
        if kind == CursorKind.CALL_EXPR and MESSAGES.match(self.of(cursor)):
            return
        children = list(cursor.get_children())
        if kind == CursorKind.UNEXPOSED_EXPR and len(children) == 1 and self.range(children[0]) == self.range(cursor):
            return self.visit(children[0], parent)  # what stands around temporaries, say
        self.look(cursor, children, parent)
        if kind == CursorKind.CASE_STMT or (kind == CursorKind.IF_STMT and self.of(cursor).startswith("if constexpr")):
            children = children[1:]
        for child in children:
            self.visit(child, cursor)

    def look(self, cursor, children, parent):
        kind = cursor.kind
        statement = parent is not None and (parent.kind == CursorKind.COMPOUND_STMT or (
            parent.kind in (CursorKind.IF_STMT, CursorKind.FOR_STMT, CursorKind.CXX_FOR_RANGE_STMT) and
            next(parent.get_children()) != cursor and self.text[self.range(cursor)[1]:].lstrip().startswith(";")
            and self.range(cursor)[1] >= self.range(list(parent.get_children())[-1])[0]))
        if kind in (CursorKind.BINARY_OPERATOR, CursorKind.COMPOUND_ASSIGNMENT_OPERATOR) and len(children) == 2:
            self.binary(cursor, *children, statement)
        elif kind == CursorKind.CALL_EXPR:
            self.call(cursor, statement)
        elif kind == CursorKind.UNARY_OPERATOR and len(children) == 1:
            text = self.of(cursor)
            if statement:
                self.choice(cursor, "deleted statement", "", "void({})")
            elif text.startswith("-") and not re.match(r"-\s*[\d.]", text):
                self.choice(cursor, "sign", self.of(children[0]))
        elif kind in (CursorKind.IF_STMT, CursorKind.CONDITIONAL_OPERATOR):
            condition = children[0]
            equality = condition.kind == CursorKind.BINARY_OPERATOR and self.sign_of(*condition.get_children()) in ("==", "!=")
            if condition.kind.is_expression() and not equality and not self.of(cursor).startswith("if constexpr"):
                self.negated(condition)
        elif kind == CursorKind.CXX_BOOL_LITERAL_EXPR and parent.kind != CursorKind.VAR_DECL:
            text = self.of(cursor)
            self.add(cursor, "flag", {"true": "false"}.get(text, "true"), f"({NAME}on(NUMBER) != INNER)")
        elif kind == CursorKind.FLOATING_LITERAL:
            self.choice(cursor, "constant", f"{self.of(cursor)} + 1")
        elif kind == CursorKind.INTEGER_LITERAL and parent.kind == CursorKind.CALL_EXPR:
            self.choice(cursor, "constant", f"{self.of(cursor)} + 1")

    def sign_of(self, left, right):
        return re.sub(r"//[^\n]*", "", self.text[self.range(left)[1]:self.range(right)[0]]).strip()

    def binary(self, cursor, left, right, statement):
        (begin, left_end), (right_begin, end) = self.range(left), self.range(right)
        sign = self.sign_of(left, right)
        a, b = self.text[begin:left_end], self.text[right_begin:end]
        if sign == "=" and statement:
            self.choice(cursor, "deleted statement", "", "void({})")
        elif cursor.kind == CursorKind.COMPOUND_ASSIGNMENT_OPERATOR:
            if statement:
                self.choice(cursor, "deleted statement", "", "void({})")
                if sign in OTHER:
                    self.choice(cursor, "sign", f"{a} {OTHER[sign]} {b}", "void({})")
        elif sign in OTHER:
            if sign in "+-" and b == "1":
                self.choice(cursor, "off by one", a)
            self.choice(cursor, RULES.get(sign, "arithmetic"), f"{a} {OTHER[sign]} {b}")

    def call(self, cursor, statement):
        name, parts = cursor.spelling, list(cursor.get_arguments())
        text = self.of(cursor)
        if name in ("min", "max") and re.match(rf"(std::)?{name}\b", text):
            self.choice(cursor, "min/max", re.sub(rf"^((std::)?){name}\b", rf"\g<1>{OTHER[name]}", text))
        if name in ("operator+", "operator-") and len(parts) == 2 and parts[0] is not None and parts[1] is not None:
            (_, left_end), (begin, end) = self.range(parts[0]), self.range(parts[1])
            if self.text[left_end:begin].strip() == name[8:]:
                self.add(cursor, "arithmetic", f"{OTHER[name[8:]]} {one_line(self.text[begin:end])}",
                         f"({NAME}sign(NUMBER) * (INNER))", begin, end)
        if name in ("operator+=", "operator-=") and len(parts) == 2 and statement:
            a, b = (self.of(p) for p in parts)
            self.choice(cursor, "sign", f"{a} {OTHER[name[8:]]} {b}", "void({})")
        if statement and (not name.startswith("operator") or name.endswith("=") or name == "operator()"):
            self.choice(cursor, "deleted statement", "", "void({})")


def arguments_of(command):
    """What libclang needs of a compiler's command, as words."""
    kept, words = [], iter(command)
    for word in words:
        if word in ("-I", "-isystem", "-D", "-iquote"):
            kept += [word, next(words)]
        elif word.startswith(("-I", "-D", "-std=", "-isystem", "-march")):
            kept.append(word)
    return kept + ["-w", "-ferror-limit=0", "-DHWY_COMPILE_ONLY_STATIC"]


def read(path):
    return path.read_bytes().decode("latin-1")  # a character is a byte, as for the compiler


def find(path, command):
    unit = Index.create().parse(str(path), arguments_of(command), options=TranslationUnit.PARSE_DETAILED_PROCESSING_RECORD)
    wrong = [str(d) for d in unit.diagnostics if d.severity >= 3]
    if wrong:
        raise RuntimeError(f"{path}: {wrong[0]}")
    return Finder(path, read(path), unit).mutants


def rewrite(text, mutants, head):
    """The source with these mutants; each learns the bytes in which it stands."""
    out, place = [head], len(head)

    def put(piece):
        nonlocal place
        out.append(piece)
        place += len(piece)

    def fill(begin, end, rest):
        while rest:
            mutant = rest[0]
            inside = [m for m in rest[1:] if m.begin < mutant.end]
            rest = rest[1 + len(inside):]
            put(text[begin:mutant.begin])
            before, after = mutant.form.replace("NUMBER", str(mutant.number)).split("INNER")
            start = place
            put(before)
            fill(mutant.begin, mutant.end, inside)
            put(after)
            mutant.part = (start, place)
            begin = mutant.end
        put(text[begin:end])

    fill(0, len(text), sorted(mutants, key=lambda m: (m.begin, -m.end)))
    return "".join(out)


def compiled(path, command, mutants, header):
    """The rewritten source without the mutants that no compiler takes, and those that are left."""
    text, head = read(path), f'#include "{header}"\n#line 1\n'
    index, arguments = Index.create(), arguments_of(command)
    for _ in range(25):
        new = rewrite(text, mutants, head)
        unit = index.parse(str(path), arguments, unsaved_files=[(str(path), new)])
        errors = [d for d in unit.diagnostics if d.severity >= 3]
        if not errors:
            return new, mutants
        places = [d.location for error in errors for d in (error, *error.children)]
        wrong = set()
        for offset in {p.offset for p in places if p.file is not None and p.file.name == str(path)}:
            around = [m for m in mutants if m.part[0] <= offset < m.part[1]]
            if around:
                wrong.add(min(around, key=lambda m: m.part[1] - m.part[0]).number)
        if not wrong:  # a template's argument, say: the error stands where the template is named
            lines = {new.count("\n", 0, p.offset) for p in places if p.file is not None and p.file.name == str(path)}
            wrong = {m.number for m in mutants if new.count("\n", 0, m.part[0]) in lines}
        if not wrong:  # the error of one shows elsewhere, where a template is used
            print(f"{path}: no mutants: {errors[0].spelling}", flush=True)
            return text, []
        mutants = [m for m in mutants if m.number not in wrong]
    raise RuntimeError(f"{path}: no end of errors")
