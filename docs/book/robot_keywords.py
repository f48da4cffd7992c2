"""The table of keywords in docs/robot.md, as libdoc of Robot Framework has them; with --write it is written there.

    target/tools/hil/bin/python docs/book/robot_keywords.py --write
"""

import re
import sys
from pathlib import Path

from robot.libdocpkg import LibraryDocumentation

PAGE = Path(__file__).resolve().parents[1] / "robot.md"
BEGIN, END = "<!-- keywords: begin -->\n", "<!-- keywords: end -->"
LIBRARY = "airbench_hil.robot.Airbench"


def markdown(text):
    """Robot's documentation markup as Markdown, in one line of a table."""
    text = re.sub(r"``(.+?)``|`(.+?)`", lambda found: f"`{found[1]}`" if found[1] else f"*{found[2]}*", text)
    return " ".join(text.split()).replace("|", "\\|")


def argument(given):
    """Name and default, and what is allowed where it is a choice."""
    text = str(given)
    choice = re.search(r"Literal\[(.+?)\]", text)
    name = text.partition(":")[0].partition("=")[0].strip()
    default = f"={given.default_repr}" if given.default_repr not in (None, "None", "") else ""
    words = f" ({choice[1]})".replace("'", "") if choice else ""
    return f"`{name}{default}`{words}"


def table():
    """The keywords, a row each."""
    rows = [
        f"| {each.name} | {', '.join(map(argument, each.args))} | {markdown(each.doc)} |"
        for each in LibraryDocumentation(LIBRARY).keywords
    ]
    return "\n".join(["| keyword | arguments | does |", "|---|---|---|", *rows]) + "\n"


def page():
    """The page with the table of now."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    return before + BEGIN + "\n" + table() + "\n" + END + rest.partition(END)[2]


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        PAGE.write_text(page(), encoding="utf-8")
    else:
        print(table(), end="")
