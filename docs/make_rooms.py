#!/usr/bin/env python3
"""make_rooms.py [--check]: draws docs/images/rooms.svg, the libraries and what each of them uses,
from their CMakeLists.txt. Uses that follow from others are left out. --check fails if the picture
is not that of the tree."""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "images" / "rooms.svg"
WIDTH, BOX, ROW = 960, (112, 30), 66
PAPER, INK, LINE, ROOM = "#ffffff", "#1d2733", "#8793a0", "#e3edf7"
FILL = {"planners": "#fbe8cf", "hamelin": "#dff0dc", "python": "#dff0dc"}


def libraries():
    """The libraries that each library names in DEPS."""
    used = {}
    for file in sorted((ROOT / "libs").glob("*/CMakeLists.txt")):
        call = re.search(r"hamelin_library\(NAME (\w+)([^)]*)\)", file.read_text(encoding="utf-8"))
        if call:
            deps = re.search(r"\bDEPS((?:\s+[a-z_]+\b)*)", call[2])
            used[call[1]] = deps[1].split() if deps else []
    return used


def programs():
    """The libraries that the program, the Python module and the planners link."""
    used = {}
    for name, pattern, call in (
        ("hamelin", "apps/hamelin", ""),
        ("python", "libs/python", ""),
        ("planners", "plugins/*", r"hamelin_plugin\("),
    ):
        text = "".join(
            file.read_text(encoding="utf-8") for file in sorted(ROOT.glob(f"{pattern}/CMakeLists.txt"))
        )
        calls = re.findall(rf"{call}[^)]*\)", text) if call else [text]
        used[name] = sorted(set(re.findall(r"hamelin::([a-z]+)\b", " ".join(calls))))
    used["planners"].append("planning")
    return used


def reached(used, name):
    """All libraries that one uses, directly or through others."""
    found = set()
    for other in used[name]:
        found |= {other} | reached(used, other)
    return found


def reduced(used):
    """The uses that do not follow from others."""
    return {
        name: [d for d in deps if not any(d in reached(used, o) for o in deps if o != d)]
        for name, deps in used.items()
    }


def rows(used, top):
    """Names by the length of the longest way down, those of `top` in a row above all others."""
    level = {}

    def height(name):
        if name not in level:
            level[name] = 1 + max((height(d) for d in used[name]), default=-1)
        return level[name]

    last = max(height(name) for name in used if name not in top) + 1
    found = [[] for _ in range(last + 1)]
    for name in used:
        found[last if name in top else height(name)].append(name)
    return found


def ordered(rows, used):
    """The rows, ordered by the middle of their neighbours, so that fewer lines cross."""
    users = {name: [other for other in used if name in used[other]] for name in used}
    place = {name: (i + 1) / (len(row) + 1) for row in rows for i, name in enumerate(row)}
    for sweep in range(20):
        near = used if sweep % 2 == 0 else users
        for row in rows if sweep % 2 == 0 else reversed(rows):

            def middle(name):
                return sum(place[n] for n in near[name]) / len(near[name]) if near[name] else place[name]

            row.sort(key=lambda name: (middle(name), name))
            place.update({name: (i + 1) / (len(row) + 1) for i, name in enumerate(row)})
    return rows


def places(rows):
    """The centre of each box."""
    at = {}
    for level, names in enumerate(rows):
        for i, name in enumerate(names):
            x = WIDTH * (2 * i + 1) / (2 * len(names))
            at[name] = (round(x), (len(rows) - 1 - level) * ROW + 22)
    return at


def draw(used, top):
    """The picture as SVG."""
    levels = ordered(rows(used, top), used)
    at = places(levels)
    height = (len(levels) - 1) * ROW + 44
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        f'width="{WIDTH}" height="{height}" font-family="sans-serif" font-size="14">',
        "<title>The libraries of hamelin, and what each of them uses</title>",
        f'<rect width="{WIDTH}" height="{height}" fill="{PAPER}"/>',
    ]
    for name, deps in used.items():
        for other in deps:
            (x, y), (u, v) = at[name], at[other]
            y, v = y + BOX[1] // 2, v - BOX[1] // 2
            bend = (v - y) // 2
            out.append(
                f'<path d="M{x} {y}C{x} {y + bend} {u} {v - bend} {u} {v}" fill="none" '
                f'stroke="{LINE}" stroke-width="1.2"/>'
            )
    for name, (x, y) in at.items():
        fill = FILL.get(name, ROOM)
        out.append(
            f'<rect x="{x - BOX[0] // 2}" y="{y - BOX[1] // 2}" width="{BOX[0]}" '
            f'height="{BOX[1]}" rx="5" fill="{fill}" stroke="{INK}"/>'
        )
        out.append(
            f'<text x="{x}" y="{y + 5}" text-anchor="middle" fill="{INK}">{name}</text>'
        )
    return "\n".join([*out, "</svg>", ""])


def main():
    picture = draw(reduced({**libraries(), **programs()}), ("hamelin", "python"))
    if "--check" not in sys.argv:
        PICTURE.write_text(picture, encoding="utf-8")
    elif PICTURE.read_text(encoding="utf-8") != picture:
        sys.exit(f"{PICTURE}: is not the picture of the tree; run docs/make_rooms.py")


main()
