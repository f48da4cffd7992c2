"""Hooks of MkDocs: pages stand beside what they describe, and their links work on the forge and in the book.

A page keeps its path in the repository, so a link from page to page is the same in both. A link to a file that is no page of the
book (a source, a folder) becomes one to the forge. MkDocs is strict: a link that leads nowhere fails the build.
"""

import logging
import os
import re
import subprocess
from pathlib import Path, PurePosixPath

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[2]
ASSETS = (".svg", ".png", ".css")
LINK = re.compile(r"(\]\()([^)\s#]+)(#[^)\s]*)?(\))")
UNLIKE = {
    "a fence inside a list": re.compile(r"^ +```", re.MULTILINE),
    "a list without an empty line before it": re.compile(r"^(?![-*#>|\s]|\d+\. ).+\n(?:[-*]|1\.) ", re.MULTILINE),
}
SOURCE = re.compile(r"`([\w./-]+\.(?:rs|toml|sh|yml|c|h|py|js|css))`")
# A file that the reader writes, and one inside an FMU.
NOT_HERE = ("position_pi.rs", "resources/rig.toml")
log = logging.getLogger("mkdocs.hooks")


def tracked():
    """All files of the checkout that git does not ignore."""
    command = ["git", "-c", "safe.directory=*", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [name for name in names.split("\0") if name and (ROOT / name).is_file()]


def in_book(path):
    """Every Markdown file is a page, except notes inside test data; pictures and the style sheet go with them."""
    if "/tests/data/" in path:
        return False
    return path.endswith(".md") or ("docs/" in path and path.endswith(ASSETS))


def anchor(title, separator):
    """The anchor of a heading as forges make it."""
    return re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", separator)


def ends(path):
    """A path and its ends: pages name files from the root or from a folder above them."""
    parts = path.split("/")
    return {"/".join(parts[start:]) for start in range(len(parts))}


def on_config(config):
    config.mdx_configs.setdefault("toc", {})["slugify"] = anchor
    return config


def on_files(files, config):
    for file in [file for file in files if file.src_dir == config.docs_dir]:
        files.remove(file)
    names = tracked()
    config.extra["known"] = set().union(*map(ends, names))
    for path in filter(in_book, names):
        files.append(File.generated(config, path, abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown, page, config, files):
    folder = PurePosixPath(page.file.src_uri).parent

    def to_forge(link):
        before, target, fragment, after = link.group(1), link.group(2), link.group(3) or "", link.group(4)
        path = os.path.normpath(folder / target)
        if ":" in target or files.get_file_from_path(path) or not (ROOT / path).exists():
            return link.group(0)
        kind = "tree" if (ROOT / path).is_dir() else "blob"
        return f"{before}{config.repo_url.rstrip('/')}/{kind}/main/{path}{fragment}{after}"

    # Code between fences is left as it is.
    parts = re.split(r"(^```.*?^```$)", markdown, flags=re.MULTILINE | re.DOTALL)
    for what, pattern in UNLIKE.items():
        if any(pattern.search(part) for part in parts if not part.startswith("```")):
            log.warning("Doc file '%s' contains %s, which MkDocs does not render as the forge does.", page.file.src_uri, what)
    for name in SOURCE.findall("".join(part for part in parts if not part.startswith("```"))):
        absent = name not in config.extra["known"] and "NAME" not in name and not name.endswith(NOT_HERE)
        if absent and ("/" in name or name.endswith(".rs")) and page.file.src_uri != "CHANGELOG.md":
            log.warning("Doc file '%s' names '%s', which is not in the repository.", page.file.src_uri, name)
    return "".join(part if part.startswith("```") else LINK.sub(to_forge, part) for part in parts)
