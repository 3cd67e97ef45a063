"""What the README says exists."""

import ast
import json
import re
import subprocess
import sys


def test_the_package_docstring_names_what_exists(source):
    import hamelin

    for name in re.findall(r"hamelin\.(\w+)", hamelin.__doc__):
        assert hasattr(hamelin, name), name
    table = (source / "libs" / "python" / "README.md").read_text(encoding="utf-8")
    rows = re.search(r"\| you want to \| use \|\n(.*?)\n\n", table, re.DOTALL)[1]
    owners = [hamelin, hamelin.Model, hamelin.Environment]
    for code in re.findall(r"`([^`]*)`", rows):
        first, _, second = code.partition(".")
        if second:
            assert hasattr(getattr(hamelin, first), second), code
        else:
            assert any(hasattr(owner, first) for owner in owners), code


def test_notebooks_of_the_gallery(source, tmp_path):
    gallery = source / "docs" / "gallery"
    subprocess.run(
        [sys.executable, gallery / "make.py", "--notebooks", tmp_path], check=True, timeout=60
    )
    scripts = sorted(gallery.glob("[0-9]*.py"))
    assert len(scripts) == len(list(tmp_path.glob("*.ipynb"))) == 10
    for script in scripts:
        notebook = json.loads((tmp_path / f"{script.stem}.ipynb").read_text())
        assert notebook["nbformat"] == 4
        kinds = [cell["cell_type"] for cell in notebook["cells"]]
        assert kinds[0] == "markdown" and kinds.count("code") >= 2
        code = "\n".join("".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code")
        written = ast.parse(script.read_text(encoding="utf-8"))
        assert ast.dump(ast.parse(code)) == ast.dump(written)
