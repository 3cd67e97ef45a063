#!/usr/bin/env python3
"""Builds the site of the documentation, offline: build.py OUT --program hamelin --package DIR.

The site has the tracked *.md pages, the reference of the C and C++ headers, of the Python package and of the command
line, and the JSON Schemas as tables. docs/index.md is its start page; the links in its sections become the side bar.
Warnings and dead links are errors. `./dev docs` calls this script, which prints each step when it begins, with the
seconds since its start.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE.parent.parent
sys.path.insert(0, str(HERE))

import check_site  # noqa: E402
import command_reference  # noqa: E402
import cpp_reference  # noqa: E402
import python_reference  # noqa: E402
import schema_reference  # noqa: E402
from stage import Stage, linked_pages, toctree, tracked  # noqa: E402

START = "docs/index.md"
# Pages whose links are their chapters in the side bar.
PARENTS = ["docs/theory.md"]
BEGIN = time.monotonic()


def add_headers(stage: Stage, work: Path) -> dict[str, list[str]]:
    """Pages of the public headers. Returns those of each library."""
    names = tracked(SOURCE, "libs/*/include/*.hpp", "libs/*/include/*.h")
    names = [name for name in names if "/kernel/" not in name]
    compounds = cpp_reference.read_headers([SOURCE / name for name in names], SOURCE, work)
    reference = cpp_reference.Reference(compounds, set(names))
    libraries: dict[str, list[str]] = {}
    for name in names:
        libraries.setdefault(name.split("/")[1], []).append(f"{name}.md")
        stage.write(f"{name}.md", reference.page(name))
    for library, pages in libraries.items():
        folder = f"libs/{library}/include"
        stage.write(f"{folder}/index.md", f"# Headers of {library}\n" + toctree(folder, pages, hidden=False))
    return libraries


def add_schemas(stage: Stage) -> None:
    folder = "docs/schema"
    pages = []
    for name in tracked(SOURCE, f"{folder}/*.json"):
        title = Path(name).name.split(".")[0]
        stage.write(f"{name}.md", schema_reference.page(SOURCE / name, title))
        pages.append(f"{name}.md")
    for name in tracked(SOURCE, "plugins/*/params.schema.json"):
        stage.write(f"{name}.md", schema_reference.page(SOURCE / name, f"Parameters of {name.split('/')[1]}"))
        pages.append(f"{name}.md")
    intro = ("# JSON Schemas\n\nThe files that hamelin reads and writes, and the parameters of its planners. "
             "`hamelin schema print NAME` prints a schema.\n")
    stage.write(f"{folder}/index.md", intro + toctree(folder, pages, hidden=False))


def add_commands(stage: Stage, program: Path) -> None:
    folder = "apps/hamelin"
    names = command_reference.write_pages(program, stage.target / folder)
    top, rest = names[0], names[1:]
    parents = [name for name in rest if name.count("-") == 1]
    for parent in parents:
        children = [f"{folder}/{name}.md" for name in rest if name.startswith(f"{parent}-")]
        if children:
            page = stage.target / folder / f"{parent}.md"
            text = page.read_text(encoding="utf-8") + toctree(folder, children, hidden=False)
            page.write_text(text, encoding="utf-8")
    overview = (stage.target / folder / f"{top}.md").read_text(encoding="utf-8")
    (stage.target / folder / f"{top}.md").unlink()
    overview = re.sub(r"^# .*", "# Command line", overview)
    stage.write(f"{folder}/index.md", overview + toctree(folder, [f"{folder}/{name}.md" for name in parents]))


def add_pages(stage: Stage, libraries: dict[str, list[str]]) -> None:
    """The tracked pages, with the side bar in the start page."""
    for page in sorted(stage.pages):
        text = (SOURCE / page).read_text(encoding="utf-8")
        extra = ""
        folder = os.path.dirname(page)
        if page == START:
            seen: set[str] = set()
            for number, section in enumerate(re.split(r"(?m)^## ", text)):
                entries = {name: title for name, title in linked_pages(stage, page, section).items()
                           if name not in seen and not name.endswith("/include/index.md")}
                seen.update(entries)
                if entries:
                    extra += toctree(folder, entries, section.splitlines()[0] if number else "")
        elif page in PARENTS:
            below = page.removesuffix(".md") + "/"
            chapters = [name for name in linked_pages(stage, page, text) if name.startswith(below)]
            extra = toctree(folder, chapters)
        elif match := re.fullmatch(r"libs/(\w+)/README\.md", page):
            if match[1] in libraries:
                extra = "\n## Headers\n" + toctree(folder, libraries[match[1]], hidden=False)
        stage.add_page(page, text, extra)


def add_orphans(stage: Stage) -> None:
    """Pages that the side bar does not have, though others link to them, are said to be so."""
    listed = set()
    for name in stage.target.rglob("*.md"):
        for block in re.findall(r"```\{toctree\}\n(.*?)```", name.read_text(encoding="utf-8"), re.DOTALL):
            for line in block.splitlines():
                if line and not line.startswith(":"):
                    listed.add(os.path.normpath(name.parent / f"{line}.md"))
    for name in stage.target.rglob("*.md"):
        text = name.read_text(encoding="utf-8")
        if str(name) not in listed and name != stage.target / START and not text.startswith("---\n"):
            name.write_text(f"---\norphan: true\n---\n{text}", encoding="utf-8")


def run_sphinx(stage: Stage, out: Path, version: str, work: Path) -> None:
    for name in ("conf.py", "equations.py"):
        shutil.copy(HERE / name, stage.target / name)
    (stage.target / "_static").mkdir()
    shutil.copy(HERE / "style.css", stage.target / "_static")
    environment = {**os.environ, "HAMELIN_SITE_VERSION": version, "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run([sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-j", "auto", "-b", "html",
                    "-d", work / "doctrees", stage.target, out], check=True, env=environment)
    (out / "index.html").write_text(
        '<!doctype html><meta charset="utf-8"><title>hamelin</title>'
        '<meta http-equiv="refresh" content="0; url=docs/index.html"><a href="docs/index.html">hamelin</a>\n',
        encoding="utf-8")


def missing_tools(package: Path) -> str:
    """What the site cannot be built without, with its package of Debian; empty if all is there."""
    modules = {"sphinx": "python3-sphinx", "myst_parser": "python3-myst-parser", "furo": "furo",
               "sphinx_copybutton": "python3-sphinx-copybutton"}
    lacking = [name for module, name in modules.items() if importlib.util.find_spec(module) is None]
    lacking += [] if shutil.which("doxygen") else ["doxygen"]
    if lacking:
        return f"{', '.join(lacking)}: not installed"
    return "" if list(package.glob("hamelin/_hamelin*.so")) else f"{package}: has no built Python package"


def print_step(what: str) -> None:
    """Prints what is done next, and the seconds since the start."""
    print(f"{time.monotonic() - BEGIN:6.1f} s  {what}", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="folder of the site; replaced if it exists")
    parser.add_argument("--program", type=Path, required=True, help="the program hamelin")
    parser.add_argument("--package", type=Path, required=True, help="folder that has the built Python package")
    options = parser.parse_args()
    if missing := missing_tools(options.package):
        print(f"skipped: {missing}")
        return 77
    version = subprocess.run([options.program, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    out = options.out.resolve()
    with tempfile.TemporaryDirectory() as scratch:
        work = Path(scratch)
        stage = Stage(SOURCE, work / "pages")
        stage.target.mkdir()
        print_step("reading the public headers with Doxygen")
        libraries = add_headers(stage, work)
        print_step(f"writing the pages of the headers of {len(libraries)} libraries, the schemas, the command line and "
                   "the Python package")
        add_schemas(stage)
        add_commands(stage, options.program.resolve())
        stage.add_page("libs/python/hamelin/index.md",
                       python_reference.page(SOURCE / "libs/python/hamelin", options.package.resolve()))
        print_step(f"staging {len(stage.pages)} pages of the checkout")
        add_pages(stage, libraries)
        stage.add_folders()
        stage.add_sources()
        add_orphans(stage)
        site = work / "site"
        print_step(f"making HTML of {sum(1 for _ in stage.target.rglob('*.md'))} pages with Sphinx")
        run_sphinx(stage, site, version, work)
        print_step(f"checking the links of {sum(1 for _ in site.rglob('*.html'))} HTML pages")
        problems = check_site.check(site)
        if problems:
            print("\n".join(problems), file=sys.stderr)
            return 1
        if out.exists():
            shutil.rmtree(out)
        shutil.move(site, out)
    print_step(f"done: {out / 'index.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
