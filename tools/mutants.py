"""Single-line mutants of C++ and Python sources: what could be changed on a line, and which lines are left alone."""

from __future__ import annotations

import ast
import io
import random
import re
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Mutant", "Token", "candidates", "sample", "tokens_of"]

_CPP_TOKEN = re.compile(
    r"""(?P<skip>//[^\n]*|/\*.*?\*/|^[ \t]*\#(?:\\\n|[^\n])*|\s+)
    |(?P<string>(?:u8|[uUL])?R"(?P<mark>[^()\s]*)\(.*?\)(?P=mark)"|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])+')
    |(?P<number>(?:\d|\.\d)(?:[eEpP][+-]|[\w.']|)*)
    |(?P<name>[A-Za-z_]\w*)
    |(?P<op><<=|>>=|<=>|->\*|\.\.\.|::|->|\+\+|--|&&|\|\||[-+*/%&|^=!<>]=|<<|>>|.)""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)

# Between spaces, as both formatters write a binary operator; a template bracket or a pointer has none.
_BINARY = {
    "+": ["-"], "-": ["+"], "*": ["/"], "/": ["*"], "%": ["*"], "//": ["/"],
    "+=": ["-="], "-=": ["+="], "*=": ["/="], "/=": ["*="],
    "<": ["<=", ">"], "<=": ["<", ">"], ">": [">=", "<"], ">=": [">", "<"], "==": ["!="], "!=": ["=="],
    "&&": ["||"], "||": ["&&"], "&": ["|"], "|": ["&"],
}  # fmt: skip
_ARITHMETIC = {"+", "-", "*", "/", "%", "//", "+=", "-=", "*=", "/="}
_WORDS = {"true": "false", "false": "true", "True": "False", "False": "True", "and": "or", "or": "and"}
_CALLS = {
    "smaller": "larger", "min": "max", "fmin": "fmax", "cwiseMin": "cwiseMax", "minimum": "maximum", "floor": "ceil",
    "min_element": "max_element", "minCoeff": "maxCoeff", "any_of": "all_of", "any": "all", "sin": "cos",
    "argmin": "argmax", "front": "back",
}  # fmt: skip
_CALLS |= {other: name for name, other in _CALLS.items()}
_SIDES = [
    ("above", "below"), ("upper", "lower"), ("low", "high"), ("lowest", "highest"), ("first", "second"),
    ("motor", "plate"), ("open", "closed"), ("before", "now"), ("begin", "end"), ("left", "right"), ("up", "down"),
    ("start", "stop"), ("rows", "cols"), ("coulomb", "stiction"), ("angle", "speed"),
]  # fmt: skip
_SIDES += [(b, a) for a, b in _SIDES]


# An assignment or a return of a number: of something computed, or of a member as it stands.
_RIGHT_SIDE = re.compile(
    r"""^(\s*(?:return|[^=()"']*[^=<>!+\-*/&|()"'\s]\s[-+*/]?=)\s)"""
    r"""((?=.*\s[-+*/]\s|[a-z]\w*(?:\.|->)\w+(?:\[\w+\])?$)[^{}"'?&|<>=]+)$"""
)


@dataclass(frozen=True)
class Token:
    """A piece of source on one line; columns count characters."""

    kind: str  # name, number, string, op
    text: str
    line: int  # from 1
    start: int
    end: int


@dataclass(frozen=True)
class Mutant:
    """One line of one file, changed in one place."""

    path: str  # below the root
    line: int  # from 1
    kind: str
    before: str
    after: str


def tokens_of(text: str, *, python: bool) -> list[Token]:
    """Split a source into tokens, without comments, preprocessor lines and white space."""
    return list(_python_tokens(text) if python else _cpp_tokens(text))


def _cpp_tokens(text: str) -> Iterator[Token]:
    line, line_start = 1, 0
    for match in _CPP_TOKEN.finditer(text):
        kind, value = str(match.lastgroup), match.group()
        if match.group("string") is not None:
            kind = "string"
        if kind != "skip":
            yield Token(kind, value, line, match.start() - line_start, match.end() - line_start)
        if "\n" in value:
            line += value.count("\n")
            line_start = match.start() + value.rindex("\n") + 1


def _python_tokens(text: str) -> Iterator[Token]:
    kinds = {tokenize.NAME: "name", tokenize.NUMBER: "number", tokenize.STRING: "string", tokenize.OP: "op"}
    inside = 0  # of an f-string, which newer Pythons take apart
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        name = tokenize.tok_name[token.type]
        inside += {"FSTRING_START": 1, "FSTRING_END": -1}.get(name, 0)
        if token.type in kinds and inside == 0 and token.start[0] == token.end[0]:
            yield Token(kinds[token.type], token.string, token.start[0], token.start[1], token.end[1])


# --- what is left alone ---------------------------------------------------------------------------------------------


def _quiet_lines(text: str, tokens: Sequence[Token], *, python: bool) -> set[int]:
    """Lines whose change no user sees: error texts, declarations of types, imports."""
    if python:
        quiet: set[int] = set()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, (ast.Raise, ast.Import, ast.ImportFrom, ast.Assert)):
                quiet |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
            if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                quiet |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        return quiet
    quiet = set()
    starts = {"throw": ";", "static_assert": ";", "using": ";", "template": ">", "namespace": "{", "friend": ";"}
    until = ""
    for token in tokens:
        if not until and token.text in starts:
            until = starts[token.text]
        if until:
            quiet.add(token.line)
            until = "" if token.text == until else until
    return quiet


def _annotations(text: str) -> list[tuple[int, int, int]]:
    """Line and columns of the type annotations of a Python source."""
    out = []
    for node in ast.walk(ast.parse(text)):
        for name in ("annotation", "returns"):
            part = getattr(node, name, None)
            if part is not None and part.lineno == part.end_lineno:
                out.append((part.lineno, part.col_offset, part.end_col_offset))
    return out


# --- what could be changed ------------------------------------------------------------------------------------------


def candidates(path: str, text: str, *, skip: Sequence[re.Pattern[str]] = ()) -> list[Mutant]:
    """Give every mutant of a source.

    Parameters
    ----------
    path : str
        Its name below the root; decides the language.
    text : str
        The source.
    skip : sequence of re.Pattern
        Lines that match one are left alone.

    Returns
    -------
    list of Mutant
        In the order of the lines, each changed line once.
    """
    python = path.endswith(".py")
    tokens = tokens_of(text, python=python)
    quiet = _quiet_lines(text, tokens, python=python)
    typed = _annotations(text) if python else []
    names = {token.text for token in tokens if token.kind == "name"}
    by_line: dict[int, list[Token]] = {}
    for token in tokens:
        if not any(token.line == line and start <= token.start < end for line, start, end in typed):
            by_line.setdefault(token.line, []).append(token)
    whole = _whole_statements(text, by_line, python=python)
    out: dict[tuple[int, str], Mutant] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if number not in by_line or number in quiet or any(pattern.search(line) for pattern in skip):
            continue
        changes = [*_token_changes(line, by_line[number], names), *_line_changes(line, number in whole, python=python)]
        for kind, after in changes:
            if after != line:
                out.setdefault((number, after), Mutant(path, number, kind, line, after))
    return list(out.values())


def _token_changes(line: str, tokens: Sequence[Token], names: set[str]) -> Iterator[tuple[str, str]]:
    for i, token in enumerate(tokens):
        before, after = (tokens[j] if 0 <= j < len(tokens) else None for j in (i - 1, i + 1))
        head, tail = line[: token.start], line[token.end :]
        if token.kind == "op":
            spaced = head.endswith(" ") and tail.startswith(" ") and head.strip() != ""
            texts = any(near is not None and near.kind == "string" for near in (before, after))
            if spaced and not (texts and token.text in _ARITHMETIC):
                kind = "arithmetic" if token.text in _ARITHMETIC else "comparison or logic"
                yield from ((kind, head + other + tail) for other in _BINARY.get(token.text, []))
            unary = before is None or before.text in ("(", "[", ",", "=", "return", "?", ":", "{", "<", ">", "*")
            if token.text in ("-", "!") and unary and not tail.startswith(" "):
                yield "sign" if token.text == "-" else "negated condition", head + tail
        elif token.kind == "number" and not tail.startswith(">"):  # but for arguments of templates
            yield from (("constant", head + other + tail) for other in _other_numbers(token.text))
        elif token.kind == "name":
            if token.text in _WORDS:
                yield "boolean", head + _WORDS[token.text] + tail
            elif token.text == "not":
                yield "negated condition", head + tail.lstrip()
            elif token.text in _CALLS and tail.startswith("("):
                yield "swapped function", head + _CALLS[token.text] + tail
            elif not _declared(before, head, tail):
                yield from (("swapped name", head + other + tail) for other in _other_names(token.text, names))


def _declared(before: Token | None, head: str, tail: str) -> bool:
    """Tell a name that a declaration introduces: behind a type, or before an annotation."""
    typed = before is not None and (before.kind == "name" or (before.text in "&*>" and head.endswith((" ", "*"))))
    returned = before is not None and before.text in ("return", "case", "in", "if", "else", "for", "not", "and", "or")
    return (typed and not returned) or tail.startswith(": ")


def _other_numbers(text: str) -> list[str]:
    digits = text.replace("'", "").replace("_", "")
    if re.fullmatch(r"\d+[uUlLzZ]*", digits):
        value, suffix = int(re.match(r"\d+", digits)[0]), digits.lstrip("0123456789")  # type: ignore[index]
        return [f"{value + 1}{suffix}"] + ([f"{value - 1}{suffix}"] if value > 0 else [])
    if not re.fullmatch(r"\d*\.?\d*(?:[eE][+-]?\d+)?[fF]?", digits):
        return []  # hexadecimal: bit patterns
    number = float(digits.rstrip("fF"))
    return {0.0: ["1.0"], 1.0: ["0.0", "2.0"]}.get(number, [repr(2.0 * number), repr(0.5 * number)])


def _other_names(name: str, names: set[str]) -> Iterator[str]:
    parts = name.split("_")
    for one, other in _SIDES:
        if one in parts:
            swapped = "_".join(other if part == one else part for part in parts)
            if swapped in names:
                yield swapped


def _line_changes(line: str, whole: bool, *, python: bool) -> Iterator[tuple[str, str]]:
    condition = r"^(\s*(?:if|elif|while) )(.+)(:)$" if python else r"^(\s*(?:\} else )?(?:if|while) \()(.+)(\) \{?.*)$"
    found = re.match(condition, line)
    if found and found[2].count("(") == found[2].count(")") and "constexpr" not in found[1]:
        yield "negated condition", found[1] + ("not (" if python else "!(") + found[2] + ")" + found[3]
    end = "" if python else ";"
    body = line.rstrip()
    if not body.endswith(end):
        return
    remark = python and "  #" in body  # a bracket would close behind it
    right = None if remark else re.match(_RIGHT_SIDE, body[: len(body) - len(end)])
    plain = right and (re.search(r", | and | or ", right[2]) or not re.search(r" [-+*/] ", right[2]))
    if right and right[2].count("(") == right[2].count(")") and not (python and plain):
        yield "sign", f"{right[1]}-({right[2]}){end}"
    if whole:
        indent = line[: len(line) - len(line.lstrip())]
        yield "dropped statement", indent + ("pass" if python else ";")


def _whole_statements(text: str, by_line: dict[int, list[Token]], *, python: bool) -> set[int]:
    """Lines that are one statement without a declaration, so that the rest is valid without it."""
    if python:
        kinds = (ast.Expr, ast.AugAssign, ast.Assign, ast.Return, ast.Continue, ast.Break)
        return {
            node.lineno
            for node in ast.walk(ast.parse(text))
            if isinstance(node, kinds) and node.lineno == node.end_lineno and not _declares(node)
        }
    out, last = set(), "{"
    for number in sorted(by_line):
        words = [token.text for token in by_line[number]]
        ends = words[-1] == ";" and last in (";", "{", "}", ")", ":", "else")
        if ends and words[0] not in ("for", "if", "while", "else", "case", "default", "const", "constexpr", "return"):
            assigns = len(words) > 2 and (words[1] in ("=", "+=", "-=", "*=", "/=", ".", "->", "[", "("))
            steps = words[0] in ("++", "--", "*") or words in (["break", ";"], ["continue", ";"])
            if assigns or steps:
                out.add(number)
        last = words[-1]
    return out


def _declares(node: ast.stmt) -> bool:
    if isinstance(node, ast.Assign):
        return any(isinstance(target, (ast.Name, ast.Tuple)) for target in node.targets)
    return isinstance(node, ast.Return) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))


# --- a sample -------------------------------------------------------------------------------------------------------


def sample(root: Path, paths: Iterable[Path], seed: str, skip: Sequence[re.Pattern[str]] = ()) -> list[Mutant]:
    """Give one mutant of every line that has any, lines in random order: its head is a sample of lines.

    Parameters
    ----------
    root : pathlib.Path
        Root of the repository.
    paths : iterable of pathlib.Path
        Sources.
    seed : str
        The same seed and sources give the same order and changes.
    skip : sequence of re.Pattern
        Lines that match one are left alone.

    Returns
    -------
    list of Mutant
        The whole pool.
    """
    lines: dict[tuple[str, int], list[Mutant]] = {}
    for path in sorted(paths):
        name = path.relative_to(root).as_posix()
        for mutant in candidates(name, path.read_text(encoding="utf-8"), skip=skip):
            lines.setdefault((mutant.path, mutant.line), []).append(mutant)
    # A line's own text decides its place and change, so that the rest of the sample stays when another line changes.
    drawn: list[tuple[float, Mutant]] = []
    met: Counter[str] = Counter()
    for (name, _), choices in lines.items():
        text = f"{seed} {name} {choices[0].before}"
        chance = random.Random(f"{text} {met[text]}")
        met[text] += 1
        drawn.append((chance.random(), chance.choice(choices)))
    return [mutant for _, mutant in sorted(drawn, key=lambda pair: pair[0])]
