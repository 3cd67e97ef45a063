#!/usr/bin/env python3
"""Checks a built site: every link leads to a file and every #anchor to an element; nothing is fetched from the net.

check_site.py SITE prints the number of links, and each dead one.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Ids and links of a page."""

    def __init__(self, file: Path):
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []    # that a reader follows
        self.loaded: list[str] = []   # that the browser loads
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if values.get("id"):
            self.ids.add(values["id"])
        if tag == "a" and values.get("name"):
            self.ids.add(values["name"])
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])
        elif tag == "link" and values.get("rel") in ("stylesheet", "icon", "shortcut icon"):
            self.loaded.append(values["href"])
        elif tag in ("img", "script", "source", "iframe") and values.get("src"):
            self.loaded.append(values["src"])


def check(site: Path) -> list[str]:
    """One line per problem; prints what was checked."""
    site = site.resolve()
    pages = {file: Page(file) for file in sorted(site.rglob("*.html"))}
    problems = []
    links = 0
    for file, page in pages.items():
        name = file.relative_to(site)
        for link in page.links + page.loaded:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.loaded and parts.scheme != "data":
                    problems.append(f"{name}: loads '{link}', expected a file of the site")
                continue
            links += 1
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            if not target.is_relative_to(site) or not target.is_file():
                problems.append(f"{name}: '{link}': there is no such file")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].ids:
                problems.append(f"{name}: '{link}': there is no such place in the page")
    if not links:
        problems.append(f"{site}: no links found, expected a built site")
    print(f"{len(pages)} pages, {links} links, {len(problems)} dead")
    return problems


if __name__ == "__main__":
    found = check(Path(sys.argv[1]))
    print("\n".join(found), end="\n" if found else "")
    sys.exit(bool(found))
