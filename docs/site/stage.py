"""Copies the tracked pages into a folder in which Sphinx finds all that they link to.

Pages keep their places, so that their relative links stay valid. A link to a file that is no page leads to a page that
shows the file (FILE.md beside it), and a link to a folder to its README.md or to a list of its pages (index.md).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

LINK = re.compile(r"(!?\[(?:[^\[\]]|\[[^\]]*\])*\]\()([^)\s]+)([^)]*\))", re.DOTALL)
FENCE = re.compile(r"^ *(```|~~~)")
IMAGES = (".png", ".jpg", ".jpeg", ".svg", ".gif")
LANGUAGES = {".py": "python", ".cpp": "cpp", ".hpp": "cpp", ".h": "cpp", ".c": "c", ".json": "json", ".sh": "bash",
             ".cff": "yaml", ".cmake": "cmake", ".js": "javascript"}


def tracked(source: Path, *patterns: str) -> list[str]:
    """The files of the checkout, also new ones, that match the patterns."""
    command = ["git", "-c", "safe.directory=*", "-C", source, "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run([*command, *patterns], check=True, capture_output=True, text=True).stdout.split("\0")
    return sorted({name for name in names if name and (source / name).is_file()})


def split_code(text: str):
    """Pairs (is code, text): fenced blocks and what is between them."""
    part: list[str] = []
    code = False
    for line in text.splitlines(keepends=True):
        if FENCE.match(line):
            if code:
                yield True, "".join([*part, line])
                part, code = [], False
                continue
            yield False, "".join(part)
            part, code = [], True
        part.append(line)
    yield code, "".join(part)


class Stage:
    def __init__(self, source: Path, target: Path):
        self.source = source
        self.target = target
        self.pages = set(tracked(source, "*.md"))
        self.shown: set[str] = set()      # files that links lead to
        self.folders: set[str] = set()    # folders that links lead to
        self.written: set[str] = set()

    def write(self, name: str, text: str) -> None:
        file = self.target / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        self.written.add(name)

    def resolve(self, page: str, link: str, image: bool) -> str:
        """The link as the site needs it."""
        path, mark, heading = link.partition("#")
        if not path or "://" in path or path.startswith("mailto:"):
            return link
        name = os.path.normpath(os.path.join(os.path.dirname(page), path))
        if name in self.pages:
            return link
        if not (self.source / name).exists():
            raise SystemExit(f"{page}: link '{link}': there is no {name}")
        if (self.source / name).is_dir():
            if f"{name}/README.md" in self.pages:
                return f"{path.rstrip('/')}/README.md{mark}{heading}"
            self.folders.add(name)
            return f"{path.rstrip('/')}/index.md"
        if image or name.endswith(IMAGES):
            (self.target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(self.source / name, self.target / name)
            return link
        self.shown.add(name)
        return f"{path}.md"

    def add_page(self, page: str, text: str, extra: str = "") -> None:
        """Stages a page with its links."""
        out = []
        for code, part in split_code(text):
            # Pygments takes lines without a prompt for output in blocks of the language console.
            out.append(part.replace("```console", "```sh", 1) if code else LINK.sub(
                lambda match: match[1] + self.resolve(page, match[2], match[1].startswith("!")) + match[3], part))
        self.write(page, "".join(out) + extra)

    def add_sources(self) -> None:
        """Pages that show the files which links lead to, and that are not there yet."""
        for name in sorted(self.shown):
            if f"{name}.md" in self.written:
                continue
            text = (self.source / name).read_text(encoding="utf-8")
            fence = "````" if "```" in text else "```"
            language = LANGUAGES.get(Path(name).suffix, "text")
            self.write(f"{name}.md", f"---\norphan: true\n---\n# {Path(name).name}\n\n`{name}`\n\n"
                                     f"{fence}{language}\n{text.rstrip()}\n{fence}\n")

    def add_folders(self) -> None:
        """Lists of the pages in folders that links lead to, and that have no page yet."""
        for name in sorted(self.folders):
            if f"{name}/index.md" in self.written:
                continue
            below = sorted(page for page in self.pages if page.startswith(f"{name}/"))
            if not below:
                raise SystemExit(f"{name}: a link leads to this folder, which has no page")
            self.write(f"{name}/index.md", f"# {Path(name).name.capitalize()}\n" + toctree(name, below, hidden=False))


def toctree(folder: str, pages: list[str] | dict[str, str], caption: str = "", hidden: bool = True) -> str:
    """A toctree of a page in `folder`. `pages` may give titles other than those of the pages."""
    lines = ["", "```{toctree}"]
    lines += [":hidden:"] if hidden else []
    lines += [":maxdepth: 1"]
    lines += [f":caption: {caption}"] if caption else []
    lines += [""]
    for page in pages:
        name = os.path.relpath(page, folder).removesuffix(".md")
        lines.append(f"{pages[page]} <{name}>" if isinstance(pages, dict) else name)
    return "\n".join([*lines, "```", ""])


def linked_pages(stage: Stage, page: str, text: str) -> dict[str, str]:
    """The pages that a page links to, in order, as names below the top, with the texts of the links. Links to a place
    in a page do not count."""
    found: dict[str, str] = {}
    for code, part in split_code(text):
        for match in [] if code else LINK.finditer(part):
            link = stage.resolve(page, match[2], match[1].startswith("!"))
            if link.endswith(".md") and "://" not in link:
                name = os.path.normpath(os.path.join(os.path.dirname(page), link))
                title = " ".join(match[1].strip("![](").split())
                if name != page and name not in found:
                    found[name] = title[0].upper() + title[1:]
    return found
