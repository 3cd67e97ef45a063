"""Runs the scripts of the gallery, and writes their pictures, README.md, or notebooks.

    python3 docs/gallery/make.py              # all pictures and README.md
    python3 docs/gallery/make.py 04_shelf     # the pictures of one script
    python3 docs/gallery/make.py --check      # writes nothing; exit code 1 if something is wrong
    python3 docs/gallery/make.py --notebooks DIR
"""

from __future__ import annotations

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
IMAGES = HERE / "images"

INTRODUCTION = """\
# Gallery

Short programs in Python, each with the picture that it makes. A cell begins with `# %%`, so that
Jupyter (with jupytext), Visual Studio Code and Spyder open them as notebooks;
`python3 docs/gallery/make.py --notebooks DIR` writes them as such. The package is explained in
[libs/python](../../libs/python/README.md).

This page and its pictures are written by `python3 docs/gallery/make.py`.
"""

# Executes a script whose figures are saved where it shows them.
RUN = """
import runpy, sys
import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
script, prefix = sys.argv[1:]
saved = []
def show(*args, **kwargs):
    for number in plt.get_fignums():
        saved.append(number)
        plt.figure(number).savefig(f"{prefix}_{len(saved)}.png", dpi=100)
    plt.close("all")
plt.show = show
runpy.run_path(script, run_name="__main__")
"""


def cells(script: pathlib.Path) -> list[tuple[str, str]]:
    """The cells of a script: ("markdown" or "code", text)."""
    out: list[tuple[str, str]] = []
    for part in script.read_text(encoding="utf-8").split("# %%")[1:]:
        head, _, body = part.partition("\n")
        if "[markdown]" in head:
            lines = [line[2:] for line in body.strip().splitlines()]
            out.append(("markdown", "\n".join(lines)))
        else:
            out.append(("code", body.strip()))
    return out


def entry(script: pathlib.Path) -> str:
    """The part of README.md for a script."""
    title, _, text = cells(script)[0][1].partition("\n\n")
    name = title.removeprefix("# ")
    first = text.split("\n\n")[0]
    pictures = "\n".join(
        f"![{name}](images/{picture.name})" for picture in sorted(IMAGES.glob(f"{script.stem}_*"))
    )
    return f"## {name}\n\n{first}\n[{script.name}]({script.name})\n\n{pictures}\n"


def readme(scripts: list[pathlib.Path]) -> str:
    """The text of README.md."""
    return "\n".join([INTRODUCTION, *(entry(script) for script in scripts)])


def run(script: pathlib.Path, folder: pathlib.Path) -> list[pathlib.Path]:
    """Executes a script in a folder of its own; returns the pictures that it saved to `folder`."""
    with tempfile.TemporaryDirectory() as work:
        done = subprocess.run(
            [sys.executable, "-c", RUN, str(script), str(folder / script.stem)],
            cwd=work, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
    if done.returncode != 0:
        raise SystemExit(f"{script}: ended with an exception, expected pictures\n{done.stdout}")
    pictures = sorted(folder.glob(f"{script.stem}_*.png"))
    if not pictures:
        raise SystemExit(f"{script}: shows no figure, expected at least one")
    for picture in pictures:
        require_content(script, picture)
    return pictures


def require_content(script: pathlib.Path, picture: pathlib.Path) -> None:
    """Refuses pictures that are blank, or too large for a repository."""
    import matplotlib.pyplot as plt

    if (plt.imread(picture)[..., :3] < 0.5).mean() < 0.002:
        raise SystemExit(f"{script}: {picture.name} is blank, expected a plot")
    if picture.stat().st_size > 150_000:
        raise SystemExit(f"{script}: {picture.name} has more than 150 kB, expected less")


def check_page(scripts: list[pathlib.Path]) -> None:
    """Refuses a page or pictures that do not belong to the scripts."""
    if (HERE / "README.md").read_text(encoding="utf-8") != readme(scripts):
        raise SystemExit(f"{HERE / 'README.md'}: is out of date, expected the text of make.py")
    names = {script.stem for script in scripts}
    for picture in IMAGES.iterdir():
        if picture.stem.rpartition("_")[0] not in names:
            raise SystemExit(f"{picture}: belongs to no script, expected one of {sorted(names)}")


def write_notebook(script: pathlib.Path, folder: pathlib.Path) -> None:
    """Writes a script as a notebook (nbformat 4.5) without outputs."""
    made = []
    for number, (kind, text) in enumerate(cells(script)):
        cell = {
            "cell_type": kind,
            "id": f"cell-{number}",
            "metadata": {},
            "source": text.splitlines(keepends=True),
        }
        made.append({**cell, "execution_count": None, "outputs": []} if kind == "code" else cell)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook = {
        "cells": made,
        "metadata": {"kernelspec": kernel},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{script.stem}.ipynb").write_text(json.dumps(notebook, indent=1) + "\n")


def main() -> None:
    """Reads the arguments."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("names", nargs="*", help="scripts without .py; none: all")
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--notebooks", metavar="DIR", type=pathlib.Path)
    given = parser.parse_args()
    scripts = sorted(HERE.glob("[0-9]*_*.py"))
    known = {script.stem: script for script in scripts}
    for name in given.names:
        if name not in known:
            parser.error(f"{name}: is not a script, expected one of {', '.join(known)}")
    chosen = [known[name] for name in given.names] or scripts
    if given.notebooks:
        for script in chosen:
            write_notebook(script, given.notebooks)
    elif given.check:
        check_page(scripts)
        with tempfile.TemporaryDirectory() as folder:
            for script in chosen:
                run(script, pathlib.Path(folder))
    else:
        IMAGES.mkdir(exist_ok=True)
        for script in chosen:
            for old in IMAGES.glob(f"{script.stem}_*.png"):
                old.unlink()
            run(script, IMAGES)
        (HERE / "README.md").write_text(readme(scripts), encoding="utf-8")


if __name__ == "__main__":
    main()
