#!/usr/bin/env python3
"""Runs the scripts of the gallery, and makes their pictures, README.md and notebooks."""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
IMAGES = HERE / "images"
WIDTH_PX = 900
BYTES_MAX = 90_000
INTRODUCTION = """# Gallery

Ten short scripts that show what hamelin does from Python, with pictures. Copy from them what you
need. Each script needs hamelin, numpy and matplotlib, two need pandas, and each opens as a notebook
in Jupyter (with Jupytext), VS Code and Spyder. [libs/python](../../libs/python/README.md) describes
the package and how to install it. To run a script from the root of the repository:

<!-- not run: the test "python: gallery" runs all scripts -->
```sh
python3 docs/gallery/01_energy.py
```

`python3 docs/gallery/make.py` makes all pictures and this page; `make.py --check` checks them, and
`make.py --notebooks DIR` writes the scripts as notebooks.
"""


class GalleryError(Exception):
    """One line: file, place, what is wrong and what was expected."""


def find_scripts(names: list[str]) -> list[Path]:
    """The scripts of the given names (with or without folder and .py), or all."""
    scripts = sorted(HERE.glob("[0-9][0-9]_*.py"))
    if not names:
        return scripts
    by_name = {script.stem: script for script in scripts}
    found = []
    for name in names:
        stem = Path(name).name.removesuffix(".py")
        if stem not in by_name:
            known = ", ".join(by_name)
            raise GalleryError(f"{name}: there is no such script, expected one of {known}")
        found.append(by_name[stem])
    return found


def parse_cells(script: Path) -> list[tuple[str, str]]:
    """The cells of a script in percent format, as pairs of type and source."""
    cells: list[tuple[str, list[str]]] = []
    for number, line in enumerate(script.read_text(encoding="utf-8").splitlines(), 1):
        place = f"{script.name}: line {number}"
        if line.startswith("# %%"):
            if line not in ("# %%", "# %% [markdown]"):
                raise GalleryError(f"{place}: '{line}', expected '# %%' or '# %% [markdown]'")
            cells.append(("markdown" if "markdown" in line else "code", []))
        elif not cells:
            raise GalleryError(f"{place}: text before the first cell, expected '# %% [markdown]'")
        elif cells[-1][0] == "code" or not line:
            cells[-1][1].append(line)
        elif line == "#" or line.startswith("# "):
            cells[-1][1].append(line[2:])
        else:
            raise GalleryError(f"{place}: code in a markdown cell, expected a comment or '# %%'")
    return [(kind, "\n".join(lines).strip("\n")) for kind, lines in cells]


def read_summary(script: Path) -> tuple[str, str]:
    """Title and first paragraph of a script."""
    cells = parse_cells(script)
    match = re.match(r"# ([^\n]+)\n\n(.+?)(?:\n\n|$)", cells[0][1], re.DOTALL) if cells else None
    if not match or cells[0][0] != "markdown":
        raise GalleryError(f"{script.name}: first cell: no title, expected '# Title' and a text")
    return match[1], match[2]


def run_one(script: str, folder: str) -> None:
    """Runs a script in this process; each plt.show() saves the open figures to the folder."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np
    from PIL import Image  # matplotlib requires it

    shown = 0

    def show(*_: object, **__: object) -> None:
        nonlocal shown
        if len(plt.get_fignums()) != 1:
            raise RuntimeError(f"{len(plt.get_fignums())} figures at plt.show(), expected 1")
        figure = plt.gcf()
        figure.set_dpi(WIDTH_PX / figure.get_size_inches()[0])
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]
        drawn = any(axes.has_data() for axes in figure.axes)
        if not drawn or np.ptp(pixels) == 0:
            raise RuntimeError(f"figure {shown + 1} is blank, expected data in it")
        shown += 1
        file = Path(folder) / f"{Path(script).stem}_{shown}.png"
        # A palette makes the file several times smaller than matplotlib's own.
        Image.fromarray(pixels).quantize(128, dither=Image.Dither.NONE).save(file, optimize=True)
        plt.close(figure)

    plt.show = show
    sys.argv = [script]
    code = compile(Path(script).read_text(encoding="utf-8"), script, "exec")
    exec(code, {"__name__": "__main__", "__file__": script})
    if plt.get_fignums():
        raise RuntimeError("a figure was made and not shown, expected plt.show() after it")


def make_pictures(script: Path, folder: Path) -> list[Path]:
    """Runs a script in a process and temporary folder of its own; returns its pictures."""
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as work:
        command = [sys.executable, str(HERE / "make.py"), "--run-one", str(script), str(folder)]
        environment = {**os.environ, "MPLBACKEND": "Agg"}
        # A relative PYTHONPATH would not be found from the temporary folder.
        if environment.get("PYTHONPATH"):
            parts = environment["PYTHONPATH"].split(os.pathsep)
            environment["PYTHONPATH"] = os.pathsep.join(os.path.abspath(part) for part in parts)
        done = subprocess.run(command, cwd=work, env=environment, text=True, capture_output=True)
    if done.returncode != 0:
        lines = re.findall(rf'File "{re.escape(str(script))}", line (\d+)', done.stderr)
        text = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        place = f"line {lines[-1]}: " if lines else ""
        raise GalleryError(f"{script.name}: {place}{text}")
    pictures = sorted(folder.glob(f"{script.stem}_*.png"))
    if not pictures:
        raise GalleryError(f"{script.name}: no figure, expected plt.show() at least once")
    for picture in pictures:
        size = picture.stat().st_size
        if size > BYTES_MAX:
            raise GalleryError(f"{picture.name}: {size} bytes, expected at most {BYTES_MAX}")
    print(f"{script.name}: {time.monotonic() - begin:.1f} s, {len(pictures)} figures", flush=True)
    return pictures


def make_readme(images: Path) -> str:
    """The text of README.md for all scripts and the pictures in a folder."""
    parts = [INTRODUCTION]
    for script in find_scripts([]):
        title, paragraph = read_summary(script)
        parts.append(f"## [{title}]({script.name})\n\n{paragraph}\n")
        for picture in sorted(images.glob(f"{script.stem}_*.png")):
            parts.append(f"![{title}](images/{picture.name})\n")
    return "\n".join(parts)


def check(scripts: list[Path]) -> None:
    """Runs scripts with pictures in a temporary folder, and compares README.md and images/."""
    with tempfile.TemporaryDirectory() as folder:
        for script in scripts:
            expected = {picture.name for picture in make_pictures(script, Path(folder))}
            present = {picture.name for picture in IMAGES.glob(f"{script.stem}_*.png")}
            compare_names(expected, present)
    known = {script.stem for script in find_scripts([])}
    for file in sorted(IMAGES.iterdir()) if IMAGES.is_dir() else []:
        match = re.fullmatch(r"(.+)_\d+\.png", file.name)
        if not match or match[1] not in known:
            raise GalleryError(f"images/{file.name}: belongs to no script, expected no such file")
    readme = HERE / "README.md"
    present_text = readme.read_text(encoding="utf-8") if readme.is_file() else ""
    pairs = zip(present_text.split("\n") + [None], make_readme(IMAGES).split("\n") + [None])
    for number, (found, wanted) in enumerate(pairs, 1):
        if found != wanted:
            expected = "the end of the file" if wanted is None else f"'{wanted}'"
            raise GalleryError(
                f"README.md: line {number}: not what make.py generates, expected {expected}"
            )


def compare_names(expected: set[str], present: set[str]) -> None:
    """Compares the pictures that a script makes with those in images/."""
    for name in sorted(expected - present):
        raise GalleryError(f"images/{name}: missing, expected the picture that its script makes")
    for name in sorted(present - expected):
        raise GalleryError(f"images/{name}: not made by its script, expected no such file")


def write_notebook(script: Path, folder: Path) -> None:
    """Writes a script as a notebook of format 4.5 without outputs."""
    cells = []
    for number, (kind, source) in enumerate(parse_cells(script), 1):
        cell = {"cell_type": kind, "id": f"{script.stem.replace('_', '-')}-{number}"}
        cell |= {"metadata": {}, "source": source.splitlines(keepends=True)}
        if kind == "code":
            cell |= {"execution_count": None, "outputs": []}
        cells.append(cell)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    document = {"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}
    text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
    (folder / f"{script.stem}.ipynb").write_text(text, encoding="utf-8")


def main() -> int:
    """Reads the arguments and does what they ask for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scripts", nargs="*", help="name scripts to run (default: all)")
    parser.add_argument("--check", action="store_true", help="check scripts, pictures, README.md")
    parser.add_argument("--notebooks", metavar="DIR", help="write the scripts as notebooks to DIR")
    parser.add_argument("--run-one", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.run_one:
        run_one(*given.run_one)
        return 0
    try:
        scripts = find_scripts(given.scripts)
        if given.notebooks:
            Path(given.notebooks).mkdir(parents=True, exist_ok=True)
            for script in scripts:
                write_notebook(script, Path(given.notebooks))
        elif given.check:
            check(scripts)
        else:
            for script in scripts:
                with tempfile.TemporaryDirectory() as folder:
                    pictures = make_pictures(script, Path(folder))
                    IMAGES.mkdir(exist_ok=True)
                    for old in IMAGES.glob(f"{script.stem}_*.png"):
                        old.unlink()
                    for picture in pictures:
                        shutil.copy(picture, IMAGES)
            (HERE / "README.md").write_text(make_readme(IMAGES), encoding="utf-8")
    except GalleryError as error:
        print(f"make.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
