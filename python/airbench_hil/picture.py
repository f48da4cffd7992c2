"""The last seconds of signals, as text and as an SVG picture."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from airbench_hil.signals import Seen, Signal

_ROWS = 21
_WIDTH, _HEIGHT, _LEFT, _TOP = 720, 130, 78, 22
#: What is drawn of a curve at most, points: more than there are pixels.
_POINTS = 1500


def table(seen: Seen, signals: Sequence[Signal], from_s: float, to_s: float) -> str:
    """Values at equal times, each the newest then; a dash before the first. Times in s, values in the signals' units."""
    if not signals:
        return ""
    heads = ["t / s", *(signal.title for signal in signals)]
    widths = [max(9, len(head)) for head in heads]
    lines = ["  ".join(head.rjust(width) for head, width in zip(heads, widths))]
    courses = [seen.course(signal, 0.0, to_s) for signal in signals]
    at = [0] * len(signals)
    count = _ROWS if to_s > from_s else 1
    for row in range(count):
        time_s = from_s + (to_s - from_s) * row / max(1, count - 1)
        cells = [f"{time_s:.3f}"]
        for index, (signal, course) in enumerate(zip(signals, courses)):
            while at[index] < len(course) and course[at[index]][0] <= time_s + 1e-9:
                at[index] += 1
            cells.append(signal.shown(course[at[index] - 1][1]) if at[index] else "-")
        lines.append("  ".join(cell.rjust(width) for cell, width in zip(cells, widths)))
    return "\n".join(lines)


def svg(seen: Seen, signals: Sequence[Signal], from_s: float, to_s: float, title: str) -> str | None:
    """Curves below each other over the same time; None where nothing came."""
    courses = [(signal, seen.course(signal, from_s, to_s)) for signal in signals]
    courses = [(signal, course) for signal, course in courses if course]
    if not courses:
        return None
    span_s = max(to_s - from_s, 1e-3)
    height = _TOP + _HEIGHT * len(courses) + 24
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" font-family="sans-serif" font-size="11">',
        f'<rect width="{_WIDTH}" height="{height}" fill="white"/><text x="6" y="14">{escape(title)}</text>',
    ]
    for row, (signal, course) in enumerate(courses):
        top, inner = _TOP + row * _HEIGHT, _HEIGHT - 34
        least, most = min(value for _, value in course), max(value for _, value in course)
        room = (most - least) or max(abs(most), 1.0) * 0.1
        # Steps of a value that was held, thinned evenly: extremes of a dense curve may lie between points.
        thinned = course[:: max(1, len(course) // _POINTS)]
        if thinned[-1] is not course[-1]:
            thinned.append(course[-1])
        points = " ".join(
            f"{_LEFT + (time_s - from_s) / span_s * (_WIDTH - _LEFT - 10):.1f},"
            f"{top + 18 + (1 - (value - least) / room) * inner:.1f}"
            for time_s, value in thinned
        )
        parts += [
            f'<text x="{_LEFT}" y="{top + 12}">{escape(signal.title)}</text>',
            f'<rect x="{_LEFT}" y="{top + 18}" width="{_WIDTH - _LEFT - 10}" height="{inner}" fill="none" stroke="#bbb"/>',
            f'<text x="{_LEFT - 4}" y="{top + 26}" text-anchor="end">{escape(signal.shown(most))}</text>',
            f'<text x="{_LEFT - 4}" y="{top + 18 + inner}" text-anchor="end">{escape(signal.shown(least))}</text>',
            f'<polyline points="{points}" fill="none" stroke="#06c"/>',
        ]
    parts += [
        f'<text x="{_LEFT}" y="{height - 10}">{from_s:.3f} s</text>',
        f'<text x="{_WIDTH - 10}" y="{height - 10}" text-anchor="end">{to_s:.3f} s</text></svg>',
    ]
    return "\n".join(parts) + "\n"


def write(folder: Path, drawing: str | None) -> Path | None:
    """Writes a picture of a failed expectation under the next free name in the folder."""
    if drawing is None:
        return None
    number = 1
    while (path := folder / f"expectation-{number}.svg").exists():
        number += 1
    path.write_text(drawing, encoding="utf-8")
    return path
