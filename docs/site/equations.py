"""Sphinx extension: equation numbers are links.

A number at the end of a line of an equation in docs/theory becomes the target `#eq-4.7`. In pages of the theory, (4.7)
leads to it; elsewhere a citation `docs/theory.md (4.7), (4.9)` does, as in comments of headers.
"""

from __future__ import annotations

import re
from pathlib import Path

NUMBER = r"\((\d+\.\d+)\)"
DEFINITION = re.compile(rf"^(.*\S)?( *){NUMBER}$")
CITATION = re.compile(rf"theory\.md(?:`| |\n|</?(?:code|span|pre|a)\b[^>]*>)*(?:{NUMBER}(?:(?:,| and|–)\s*)?)+")
TAG = re.compile(r"(<[^>]*>)")


def find_definitions(source: Path) -> dict[str, str]:
    """Number of each equation and the page that defines it."""
    found = {}
    for page in sorted((source / "docs" / "theory").glob("*.md")):
        shown = False
        for line in page.read_text(encoding="utf-8").splitlines():
            if line.startswith("```"):
                shown = line == "```text"
            elif shown and (match := DEFINITION.match(line)):
                found[match[3]] = f"docs/theory/{page.stem}"
    return found


class Linker:
    """Puts links into the body of one page."""

    def __init__(self, app, page: str):
        self.app = app
        self.page = page
        self.defined = app.env.equations
        self.cited = 0

    def link(self, match: re.Match) -> str:
        number = match[1]
        target = self.defined.get(number)
        if target is None:
            return match[0]
        uri = "" if target == self.page else self.app.builder.get_relative_uri(self.page, target)
        return f'<a class="equation" href="{uri}#eq-{number}">({number})</a>'

    def define(self, text: str) -> str:
        """The lines of an equation, with a target at each number."""
        lines = []
        for line in text.split("\n"):
            match = DEFINITION.match(line)
            if match and self.defined.get(match[3]) == self.page:
                number = match[3]
                start = (match[1] or "") + match[2]
                line = (
                    f'<span class="equation-line" id="eq-{number}">{re.sub(NUMBER, self.link, start)}'
                    f'<a class="equation" href="#eq-{number}">({number})</a></span>'
                )
            else:
                line = re.sub(NUMBER, self.link, line)
            lines.append(line)
        return "\n".join(lines)

    def all_numbers(self, body: str) -> str:
        """For pages of the theory: every number."""
        out = []
        links = 0
        shown = False
        for part in TAG.split(body):
            if part.startswith("<"):
                links += part.startswith("<a ") - (part == "</a>")
                if part.startswith("<pre") or part == "</pre>":
                    shown = part != "</pre>"
            elif not links:
                part = self.define(part) if shown else re.sub(NUMBER, self.link, part)
            out.append(part)
        return "".join(out)

    def citations(self, body: str) -> str:
        """For other pages: numbers that follow `theory.md`."""
        return CITATION.sub(
            lambda match: match[0] if "</a>" in match[0] else re.sub(NUMBER, self.link, match[0]), body
        )


def link_numbers(app, page, template, context, doctree):
    if "body" not in context or doctree is None:
        return
    linker = Linker(app, page)
    theory = page.startswith("docs/theory/")
    context["body"] = linker.all_numbers(context["body"]) if theory else linker.citations(context["body"])


def read_numbers(app):
    app.env.equations = find_definitions(Path(app.srcdir))


def setup(app):
    app.connect("builder-inited", read_numbers)
    app.connect("html-page-context", link_numbers)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
