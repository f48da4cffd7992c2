"""Conditions on signals, as they are written in tests: `DriveSensors.position > 0.39 and not RigStatus.emergency_stop`.

An expression of Python: signals by their names in rig.dbc, numbers in rig.dbc's units, words of value tables as strings,
comparisons (chained too), `and`, `or`, `not`, arithmetic, and

    abs(x), min(x, y), max(x, y)
    near(x, value, tolerance)     |x - value| ≤ tolerance
    rose(c), fell(c)              c became true, became false, since the cycle before
    changed(x)                    another value than in the cycle before
    age(Message)                  time since its newest frame, s; since the beginning when none came
    count(Message)                frames of that name so far

A condition on a signal whose frame has not come yet does not hold.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import dataclass, field
from types import CodeType
from typing import Any

from airbench_hil.errors import SignalUnknown
from airbench_hil.signals import Names, Seen, Signal

_ALLOWED = (
    ast.Expression, ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.UAdd, ast.BinOp, ast.Add, ast.Sub, ast.Mult,
    ast.Div, ast.Mod, ast.Pow, ast.Compare, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq, ast.Call, ast.Attribute, ast.Name,
    ast.Load, ast.Constant,
)
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": abs, "min": min, "max": max, "near": lambda value, wanted, tolerance: abs(value - wanted) <= tolerance,
}
#: How many arguments each takes, at least and at most.
_ARGUMENTS = {"abs": (1, 1), "min": (2, 99), "max": (2, 99), "near": (3, 3)}
_PAST, _MESSAGE = ("rose", "fell", "changed"), ("age", "count")


class _Unseen(Exception):
    """A signal whose frame has not come."""


@dataclass
class Condition:
    """A condition, compiled; `watch` gives something that remembers what was before."""

    text: str
    signals: list[Signal]
    """Those that it names, in its order."""
    code: CodeType
    parts: list[tuple[str, CodeType]] = field(default_factory=list)
    """What stands in rose, fell and changed."""

    def watch(self, seen: Seen, now_s: Callable[[], float]) -> Watch:
        """Begins to look at it; what holds now is what was before."""
        return Watch(self, seen, now_s)


class Watch:
    """A condition under observation."""

    def __init__(self, condition: Condition, seen: Seen, now_s: Callable[[], float]) -> None:
        self.condition, self._seen, self._now_s = condition, seen, now_s
        self._globals: dict[str, Any] = {
            "__builtins__": {}, "_v": self._value, "_age": self._age, "_count": self._count, "_past": self._past, **_FUNCTIONS,
        }
        self._before: list[Any] = [None] * len(condition.parts)
        self._now: list[Any] = list(self._before)
        self.holds()

    def holds(self) -> bool:
        """Whether it holds now; to be asked once a cycle."""
        # A part may name those before it: edges of edges.
        for index, (_, code) in enumerate(self.condition.parts):
            self._now[index] = self._part(code)
        try:
            return bool(eval(self.condition.code, self._globals))  # noqa: S307 - compiled of checked nodes alone
        except (_Unseen, ZeroDivisionError):
            return False
        finally:
            self._before = list(self._now)

    def _part(self, code: CodeType) -> Any:
        try:
            return eval(code, self._globals)  # noqa: S307
        except (_Unseen, ZeroDivisionError):
            return None

    def _value(self, index: int) -> float:
        value = self._seen.value(self.condition.signals[index])
        if value is None:
            raise _Unseen
        return value

    def _age(self, frame_id: int) -> float:
        sample = self._seen.latest.get(frame_id)
        return self._now_s() - (sample[0] if sample else 0.0)

    def _count(self, frame_id: int) -> int:
        return self._seen.counts.get(frame_id, 0)

    def _past(self, index: int) -> bool:
        kind, before, now = self.condition.parts[index][0], self._before[index], self._now[index]
        if now is None:
            raise _Unseen
        if before is None:
            return False
        if kind == "changed":
            return bool(before != now)
        return bool(now) and not before if kind == "rose" else bool(before) and not now


class _Compiler(ast.NodeTransformer):
    """Puts look-ups in the place of names."""

    def __init__(self, names: Names, text: str) -> None:
        self.names, self.text = names, text
        self.signals: list[Signal] = []
        self.parts: list[tuple[str, CodeType]] = []

    def wrong(self, why: str) -> SignalUnknown:
        return SignalUnknown(f"'{self.text}': {why}")

    def visit(self, node: ast.AST) -> Any:
        if not isinstance(node, _ALLOWED):
            raise self.wrong(f"{type(node).__name__} is none of what a condition may hold")
        return super().visit(node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        if not isinstance(node.value, ast.Name):
            raise self.wrong("signals are Message.signal")
        signal = self.names.signal(f"{node.value.id}.{node.attr}")
        if signal not in self.signals:
            self.signals.append(signal)
        return _call("_v", self.signals.index(signal))

    def visit_Name(self, node: ast.Name) -> ast.AST:
        near = [name for name in self.names.signals if name.endswith(f".{node.id}")]
        raise self.wrong(f"'{node.id}' is no signal; signals are Message.signal{': ' * bool(near)}{', '.join(near)}")

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, str):
            raise self.wrong(f"the word '{node.value}' is compared with no signal that has words")
        if not isinstance(node.value, (int, float)):
            raise self.wrong(f"{node.value!r} is no number")
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        sides = [node.left, *node.comparators]
        for at, side in enumerate(sides):
            if isinstance(side, ast.Constant) and isinstance(side.value, str):
                others = [sides[near] for near in (at - 1, at + 1) if 0 <= near < len(sides)]
                sides[at] = ast.Constant(self._number_of(side.value, others))
        return self.generic_visit(ast.Compare(sides[0], node.ops, sides[1:]))

    def _number_of(self, word: str, others: list[ast.expr]) -> int:
        for other in others:
            if isinstance(other, ast.Attribute) and isinstance(other.value, ast.Name):
                signal = self.names.signal(f"{other.value.id}.{other.attr}")
                for raw, name in signal.choices.items():
                    if name == word:
                        return raw
                raise self.wrong(f"{signal.name} is never '{word}': {', '.join(signal.choices.values()) or 'it has no words'}")
        raise self.wrong(f"the word '{word}' is compared with no signal")

    def visit_Call(self, node: ast.Call) -> ast.AST:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if node.keywords or name not in (*_FUNCTIONS, *_PAST, *_MESSAGE):
            raise self.wrong(f"there is {', '.join((*_FUNCTIONS, *_PAST, *_MESSAGE))}, and no other function")
        if name in _FUNCTIONS:
            least, most = _ARGUMENTS[name]
            if not least <= len(node.args) <= most:
                raise self.wrong(f"{name} takes {least if least == most else f'{least} or more'} argument{'s' * (most > 1)}")
            return ast.Call(ast.Name(name, ast.Load()), [self.visit(each) for each in node.args], [])
        if len(node.args) != 1:
            raise self.wrong(f"{name} takes one argument")
        if name in _MESSAGE:
            if not isinstance(node.args[0], ast.Name):
                raise self.wrong(f"{name} takes the name of a message")
            return _call(f"_{name}", self.names.message(node.args[0].id).frame_id)
        inner = ast.fix_missing_locations(ast.Expression(self.visit(node.args[0])))
        self.parts.append((name, compile(inner, self.text, "eval")))
        return _call("_past", len(self.parts) - 1)


def _call(function: str, number: int) -> ast.Call:
    return ast.Call(ast.Name(function, ast.Load()), [ast.Constant(number)], [])


def parse(text: str, names: Names) -> Condition:
    """Compiles a condition.

    :raises SignalUnknown: it names what rig.dbc does not have, or is none.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except SyntaxError as error:
        raise SignalUnknown(f"'{text}': {error.msg}") from error
    compiler = _Compiler(names, text)
    try:
        tree = ast.fix_missing_locations(compiler.visit(tree))
    except SignalUnknown as error:
        raise error.with_traceback(None) from None  # the way through the tree says nothing to who wrote the text
    return Condition(text, compiler.signals, compile(tree, text, "eval"), compiler.parts)


def seconds(duration: str | float) -> float:
    """A duration in s: a number of seconds, or text with its unit: "4 s", "250 ms", "2 min".

    :raises ValueError: it is none, or below 0.
    """
    if isinstance(duration, (int, float)):
        value = float(duration)
    else:
        number, _, unit = duration.strip().partition(" ")
        factors = {"s": 1.0, "ms": 1e-3, "min": 60.0, "cycles": 1e-3}
        if not unit:
            digits = number.rstrip("abcdefghijklmnopqrstuvwxyz")
            number, unit = digits, number[len(digits):]
        try:
            value = float(number) * factors[unit.strip()]
        except (ValueError, KeyError):
            raise ValueError(f"duration '{duration}': a number of seconds, or text such as '4 s', '250 ms', '2 min'") from None
    if not 0 <= value < float("inf"):
        raise ValueError(f"duration '{duration}': 0 s or more")
    return value
