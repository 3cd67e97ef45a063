"""Pages of the command line, made from the manual pages that `hamelin man` writes."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

ESCAPES = {"\\e": "\\", "\\-": "-", "\\(aq": "'", "\\(ga": "`", "\\(ha": "^", "\\(ti": "~", "\\&": ""}


def plain(text: str) -> str:
    """Text without the escapes of roff that `hamelin man` writes."""
    out, at = "", 0
    while at < len(text):
        for escape, letter in ESCAPES.items():
            if text.startswith(escape, at):
                out, at = out + letter, at + len(escape)
                break
        else:
            out, at = out + text[at], at + 1
    return out


def escaped(text: str) -> str:
    for letter in "\\`*_<[":
        text = text.replace(letter, f"\\{letter}")
    return text


def markdown(manual: str) -> str:
    """A manual page as Markdown."""
    lines, section, code = [], "", False
    entries: list[list[str]] = []

    def flush():
        if entries:
            lines.extend(["| | |", "|---|---|"])
            for name, *texts in entries:
                meaning = escaped(" ".join(texts)).replace("|", "\\|")
                lines.append(f"| `{name}` | {meaning} |".replace("`` ", "").replace("|  |", "| |"))
            lines.append("")
            entries.clear()

    source = manual.splitlines()
    at = 0
    while at < len(source):
        line = source[at]
        at += 1
        if line.startswith(".TH"):
            continue
        if line.startswith(".SH"):
            flush()
            section = plain(line[4:])
            if section == "SEE ALSO":
                break
            if section not in ("NAME", "SYNOPSIS", "DESCRIPTION"):
                lines += [f"## {section.capitalize()}", ""]
        elif section == "NAME":
            name, _, _ = plain(line).partition(" - ")
            lines += [f"# {name.replace('-', ' ')}", ""]
        elif line == ".nf":
            lines.append("```text")
            code = True
        elif line == ".fi":
            lines += ["```", ""]
            code = False
        elif code:
            lines.append(plain(line))
        elif section == "SYNOPSIS":
            usage = plain(source[at]) if at < len(source) and not source[at].startswith(".") else ""
            at += bool(usage)
            lines += ["```text", f"{plain(line.removeprefix('.B '))} {usage}".rstrip(), "```", ""]
        elif line == ".TP":
            entries.append([plain(source[at].removeprefix(".B ")).replace("|", "\\|")])
            at += 1
        elif entries:
            entries[-1].append(plain(line))
        else:
            lines += [escaped(plain(line)), ""]
    flush()
    return "\n".join(lines) + "\n"


def write_pages(program: Path, folder: Path) -> list[str]:
    """Writes a page per command; returns the names of the pages, parents first."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as manuals:
        subprocess.run([program, "--quiet", "man", manuals], check=True)
        files = sorted(Path(manuals).glob("*.1"), key=lambda file: file.stem.split("-"))
        for file in files:
            text = file.read_text(encoding="utf-8")
            (folder / f"{file.stem}.md").write_text(markdown(text), encoding="utf-8")
        return [file.stem for file in files]
