"""Faults of a script (emulator/docs/faults.md) from Python, and TOML files from Python values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import Any


@dataclass(frozen=True)
class Fault:
    """A fault that is planned before the run: what, where, when, and its numbers by the keys of `emulator faults`."""

    name: str
    """Such as "valve-stuck"."""
    at: str | None = None
    """Its place, such as "drive" or "drive.a"; may be left out where there is one."""
    from_s: float | None = None
    """The rig's time at which it begins, s; None: 0."""
    to_s: float | None = None
    """... at which it ends, s; None: it stays."""
    for_s: float | None = None
    """How long it lasts, s, in place of `to_s`."""
    when: str | None = None
    """A true value of the rig, such as "drive.position_m": it begins when that is above or below."""
    above: float | None = None
    below: float | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)
    """Its parameters, such as {"offset_m": 0.01}."""

    def table(self) -> dict[str, Any]:
        """As a table of a script."""
        keys = ("name", "at", "from_s", "to_s", "for_s", "when", "above", "below")
        return {key: getattr(self, key) for key in keys if getattr(self, key) is not None} | dict(self.numbers)


def script(faults: Sequence[Fault | Mapping[str, Any]], seed: int) -> str:
    """The text of a script."""
    tables = [fault.table() if isinstance(fault, Fault) else dict(fault) for fault in faults]
    return toml({"seed": seed, "fault": tables})


def toml(values: Mapping[str, Any]) -> str:
    """A TOML document of numbers, words, lists and tables; what is nested stands inline."""
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in values.items())


def number(value: float | Real) -> str:
    """A number as TOML and the rig's console read it, of numpy too."""
    return repr(int(value)) if isinstance(value, Integral) else repr(float(value))


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Real):
        return number(value)
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
        return f'"{escaped}"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(each)}" for key, each in value.items()) + " }"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_value, value)) + "]"
    raise ValueError(f"{value!r} has no place in a TOML file")


def _key(key: str) -> str:
    return key if key.replace("-", "").replace("_", "").isalnum() else f'"{key}"'
