#!/usr/bin/env python3
"""Runs what the pages show: run_pages.py SOURCE PROGRAM_DIR [--python-package DIR] [--page PAGE]... [--skip PAGE]... [--update]

Each page gets a fresh folder that has copies of data/ and plugins/ of the checkout; the parts of docs/tutorial share
one. Its blocks run in order:

- A block after "Save … as `NAME`:" is written to that file.
- Each command of a ```console or ```sh block must exit with 0, or with the N of a comment "exit code N".
- A ```python block runs in one process with the Python blocks before it.
- A ```json block must be JSON, JSON Lines or members of an object; `hamelin validate` checks one with a "schema".
- A ```cpp or ```c block must be in a source that a test compiles, or in a header.
- A ```text block that looks like output ("outcome     reached") must be printed by some command of the page: each of its
  lines, with every figure that is not a timing. A line "..." stands for lines that are left out. With --update, lines
  whose figures differ are replaced in the page by those that were printed.

A block after the comment `<!-- not run: REASON -->` is exempt. The script prints how many blocks ran, and how many are
exempt for which reason.
"""

from __future__ import annotations

import argparse
import collections
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "site"))

from stage import tracked  # noqa: E402

SHELL = ("console", "sh")
EXEMPT = re.compile(r"<!-- not run: (.+?) -->", re.DOTALL)
SAVED = re.compile(r"Save .*\sas\s+`([^`]+)`:$", re.DOTALL)
OUTPUT = re.compile(r"[a-z]+ {2,}\S")  # how the first line of output begins
TIMING = re.compile(r"[\d.]+ (?=us\b|µs\b|ms\b)|(?<=^cpu {9})[\d.]+ s")
FIGURE = re.compile(r"-?\d[\d.]*(e[-+]?\d+)?")


@dataclass
class Block:
    language: str
    text: str
    line: int
    reason: str = ""  # why it is not run
    file: str = ""    # the file that it is saved as


def read_blocks(text: str) -> list[Block]:
    """The fenced blocks of a page, with what the paragraph before says of them."""
    blocks: list[Block] = []
    before: list[str] = []
    lines = text.splitlines()
    at = 0
    while at < len(lines):
        fence = re.match(r"^( *)```(\w*)$", lines[at])
        if not fence:
            before.append(lines[at])
            at += 1
            continue
        end = at + 1
        while lines[end].strip() != "```":
            end += 1
        paragraph = "\n".join(before).rstrip().rsplit("\n\n", 1)[-1].strip()
        exempt = EXEMPT.fullmatch(paragraph)
        saved = SAVED.search(paragraph)
        blocks.append(Block(fence[2], "\n".join(lines[at + 1 : end]) + "\n", at + 1,
                            " ".join(exempt[1].split()) if exempt else "", saved[1] if saved else ""))
        before = []
        at = end + 1
    return blocks


def commands_of(text: str) -> list[str]:
    """The commands of a block: lines, joined where one ends in a backslash or opens a here document."""
    commands: list[str] = []
    end = ""  # of a here document
    open_line = False
    for line in text.splitlines():
        if end or open_line:
            commands[-1] += "\n" + line
        elif line.strip() and not line.startswith("#"):
            commands.append(line)
        else:
            continue
        if end:
            end = "" if line == end else end
            continue
        open_line = line.endswith("\\")
        if here := re.search(r"<<-?'?(\w+)'?", line):
            end = here[1]
    return commands


def squeezed(text: str) -> str:
    return "".join(text.split())


def without_timings(line: str) -> str:
    return TIMING.sub("# ", line.rstrip())


def without_figures(line: str) -> str:
    return FIGURE.sub("#", without_timings(line))


def lines_of(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.strip() not in ("", "...")]


class Runner:
    def __init__(self, source: Path, programs: Path, package: Path | None, update: bool):
        self.source = source
        self.update = update
        self.programs = programs
        self.package = package
        self.has_pages = (programs.parent / "share/hamelin/report/page.html").is_file()
        self.counts: collections.Counter[str] = collections.Counter()
        self.exempt: collections.Counter[str] = collections.Counter()
        self.failures: list[str] = []
        self.environment = {key: value for key, value in os.environ.items() if key != "HAMELIN_PLUGIN_PATH"}
        self.environment["PATH"] = f"{programs}:{os.environ['PATH']}"
        # Where rounding changes a decision, figures depend on the instruction set. This one every machine has.
        self.environment["HAMELIN_ISA"] = "x86-64"
        self.environment["PYTHONDONTWRITEBYTECODE"] = "1"
        self.environment["MPLBACKEND"] = "Agg"
        if package:
            self.environment["PYTHONPATH"] = str(package)
        self.compiled: str | None = None

    def fail(self, place: str, what: str) -> None:
        print(f"failed  {place}: {what}", flush=True)
        self.failures.append(place)

    def run_pages(self, pages: list[str]) -> None:
        """Pages that build on each other, in one fresh folder."""
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            for name in ("data", "plugins"):
                shutil.copytree(self.source / name, folder / name)
            (folder / "docs").symlink_to(self.source / "docs")
            (folder / "out").mkdir()
            for page in pages:
                self.run_page(page, folder)

    def run_page(self, page: str, folder: Path) -> None:
        printed: list[str] = []
        documents: list[tuple[str, str]] = []
        script = ""
        blocks = read_blocks((self.source / page).read_text(encoding="utf-8"))
        for block in blocks:
            place = f"{page}:{block.line}"
            if block.reason:
                self.exempt[block.reason] += 1
                continue
            if block.file:
                self.save(block, folder)
            if block.language in SHELL:
                self.run_commands(block, place, folder, printed)
            elif block.language == "python" and not block.file:
                script += block.text + "\n"
                self.run_python(script, place, folder)
            elif block.language == "json" and self.check_json(block, place):
                documents.append((place, self.save(block, folder)))
            elif block.language in ("cpp", "c"):
                self.check_compiled(block, place)
        for place, file in documents:
            self.validate(place, file, folder)
        self.check_shown(page, blocks, printed)

    @staticmethod
    def save(block: Block, folder: Path) -> str:
        name = block.file or f"line{block.line}.json"
        (folder / name).write_text(block.text, encoding="utf-8")
        return name

    def run_commands(self, block: Block, place: str, folder: Path, printed: list[str]) -> None:
        self.counts["blocks of commands"] += 1
        for command in commands_of(block.text):
            if not self.has_pages and command.startswith("hamelin report "):
                print(f"skipped {command} (the page was not built)")
                continue
            if not self.has_pages and " --page " in command:
                command = re.sub(r" --page \S+", "", command)
            wanted = re.search(r"exit code (\d+)", command)
            begin = time.monotonic()
            done = subprocess.run(["bash", "-c", command], cwd=folder, env=self.environment, text=True,
                                  stdin=subprocess.DEVNULL, capture_output=True)
            shown = " ".join(command.replace("\\\n", " ").split())
            self.counts["commands"] += 1
            printed.append(done.stdout)
            if done.returncode == int(wanted[1] if wanted else 0):
                print(f"ok      {time.monotonic() - begin:5.1f} s  {shown[:110]}", flush=True)
            else:
                self.fail(place, f"{shown}: exit code {done.returncode}, expected {wanted[1] if wanted else 0}\n"
                                 f"{done.stderr.strip()}")

    def run_python(self, script: str, place: str, folder: Path) -> None:
        if self.package is None:
            print(f"skipped {place} (the Python package was not built)")
            return
        self.counts["blocks of Python"] += 1
        # The blocks before it run again, so that each failure has its place.
        done = subprocess.run([sys.executable, "-c", script], cwd=folder, env=self.environment, text=True,
                              stdin=subprocess.DEVNULL, capture_output=True)
        if done.returncode:
            self.fail(place, done.stderr.strip())
        else:
            print(f"ok      {place} (Python)", flush=True)

    def check_json(self, block: Block, place: str) -> bool:
        """Whether the block is a whole document."""
        self.counts["blocks of JSON"] += 1
        try:
            if re.match(r'^\s*"', block.text):
                document = json.loads("{" + block.text + "}")
            elif re.search(r"^\{.*\}\n\{", block.text, re.MULTILINE):
                document = [json.loads(line) for line in block.text.splitlines()]
            else:
                document = json.loads(block.text)
        except json.JSONDecodeError as error:
            self.fail(place, f"is not JSON: {error}")
            return False
        return isinstance(document, dict) and "schema" in document

    def validate(self, place: str, file: str, folder: Path) -> None:
        """After the commands of the page, which may make the files that a document names."""
        self.counts["documents"] += 1
        done = subprocess.run([self.programs / "hamelin", "validate", file], cwd=folder, text=True, capture_output=True)
        if done.returncode:
            self.fail(place, done.stderr.strip())

    def check_compiled(self, block: Block, place: str) -> None:
        self.counts["blocks of C and C++"] += 1
        if self.compiled is None:
            names = tracked(self.source, "*.c", "*.cpp", "*.h", "*.hpp")
            self.compiled = "\0".join(squeezed((self.source / name).read_text(encoding="utf-8")) for name in names)
        if squeezed(block.text) not in self.compiled:
            self.fail(place, "this example is in no source that is compiled")

    def check_shown(self, page: str, blocks: list[Block], printed: list[str]) -> None:
        """Whether the lines that the page shows as output were printed, all of them by one command."""
        changed: dict[str, str] = {}
        for block in blocks:
            if block.language != "text" or block.reason or not OUTPUT.match(block.text):
                continue
            shown = lines_of(block.text)
            self.counts["blocks of output"] += 1
            self.counts["lines of output"] += len(shown)
            missing, lines = self.nearest_output(shown, printed)
            for line in missing:
                now = next((other for other in lines if without_figures(other) == without_figures(line)), None)
                if self.update and now is not None:
                    changed[line] = now
                else:
                    self.fail(f"{page}:{block.line}", f"shows '{line}', printed was '{now or 'no such line'}'")
        if changed:
            self.rewrite(page, changed)

    @staticmethod
    def nearest_output(shown: list[str], printed: list[str]) -> tuple[list[str], list[str]]:
        """The lines that were not printed, and the output of the command that printed most of the others."""

        def fit(output: list[str]) -> tuple[int, int]:
            exact, alike = set(map(without_timings, output)), set(map(without_figures, output))
            return (sum(without_figures(line) in alike for line in shown),
                    sum(without_timings(line) in exact for line in shown))

        lines = max((lines_of(output) for output in printed), key=fit, default=[])
        exact = set(map(without_timings, lines))
        return [line for line in shown if without_timings(line) not in exact], lines

    def rewrite(self, page: str, changed: dict[str, str]) -> None:
        file = self.source / page
        text = file.read_text(encoding="utf-8")
        for before, now in changed.items():
            text = text.replace(f"\n{before}\n", f"\n{now}\n")
            print(f"updated {page}: {now}", flush=True)
        file.write_text(text, encoding="utf-8")

    def summarize(self) -> None:
        print("\nran " + ", ".join(f"{number} {what}" for what, number in self.counts.items()))
        print(f"{sum(self.exempt.values())} blocks are exempt:")
        for reason, number in self.exempt.most_common():
            print(f"  {number:3}  {reason}")


def main() -> int:
    parser = argparse.ArgumentParser(description="Runs what the pages show.")
    parser.add_argument("source", type=Path)
    parser.add_argument("programs", type=Path, help="folder of the program hamelin")
    parser.add_argument("--python-package", type=Path, help="folder that has the built Python package")
    parser.add_argument("--page", action="append", default=[], help="only this page")
    parser.add_argument("--skip", action="append", default=[], help="not this page")
    parser.add_argument("--update", action="store_true", help="write the figures that were printed into the pages")
    options = parser.parse_args()
    package = options.python_package
    if package and not list(package.glob("hamelin/_hamelin*.so")):
        package = None
    runner = Runner(options.source.resolve(), options.programs.resolve(), package and package.resolve(),
                    options.update)
    groups: dict[str, list[str]] = {}
    for page in options.page or tracked(runner.source, "*.md"):
        if page not in options.skip:
            groups.setdefault("tutorial" if page.startswith("docs/tutorial/") else page, []).append(page)
    for pages in groups.values():
        runner.run_pages(pages)
    runner.summarize()
    if not runner.counts:
        print("no page shows a command or an example")
        return 1
    return bool(runner.failures)


if __name__ == "__main__":
    sys.exit(main())
