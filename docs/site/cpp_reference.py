"""Pages of the C and C++ headers, made from Doxygen's XML: one page per header, in the order of its declarations."""

from __future__ import annotations

import collections
import html
import os
import re
import subprocess
import xml.etree.ElementTree as xml
from dataclasses import dataclass, field
from pathlib import Path

WIDTH = 92
PREFIX = "hamelin::"


@dataclass
class Entry:
    """A class, or a member of a namespace or file."""

    kind: str
    name: str
    node: xml.Element
    line: int
    nested: list["Entry"] = field(default_factory=list)


def read_headers(headers: list[Path], source: Path, work: Path) -> list[xml.Element]:
    """Runs Doxygen; returns its compounds. Warnings are errors."""
    config = (Path(__file__).parent / "Doxyfile").read_text(encoding="utf-8")
    config += f"OUTPUT_DIRECTORY = {work}\nSTRIP_FROM_PATH = {source}\n"
    config += "INPUT = " + " ".join(str(header) for header in headers) + "\n"
    (work / "Doxyfile").write_text(config, encoding="utf-8")
    done = subprocess.run(["doxygen", work / "Doxyfile"], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr.strip())
    index = xml.parse(work / "xml" / "index.xml").getroot()
    names = [compound.get("refid") for compound in index.findall("compound")]
    return [xml.parse(work / "xml" / f"{name}.xml").getroot().find("compounddef") for name in names]


def place(node: xml.Element) -> tuple[str, int]:
    """File and line of a declaration."""
    location = node.find("location")
    if location is None:
        return "", 0
    if location.get("declfile"):
        return location.get("declfile"), int(location.get("declline"))
    return location.get("file"), int(location.get("line") or 0)


def flat(node: xml.Element | None) -> str:
    return "" if node is None else " ".join("".join(node.itertext()).split())


def markdown(node: xml.Element | None) -> str:
    """A description as Markdown."""
    if node is None:
        return ""
    if node.tag in ("parameterlist", "simplesect"):
        return section(node)
    if node.tag == "itemizedlist":
        items = (markdown(item).strip().replace("\n", "\n  ") for item in node.findall("listitem"))
        return "\n\n" + "\n".join(f"- {item}" for item in items) + "\n\n"
    if node.tag in ("verbatim", "preformatted"):
        return f"\n\n```text\n{''.join(node.itertext()).strip(chr(10))}\n```\n\n"
    if node.tag in ("ndash", "mdash"):
        return {"ndash": "–", "mdash": "—"}[node.tag]
    text = escape(node.text or "")
    for child in node:
        text += markdown(child) + escape(child.tail or "")
    if node.tag == "computeroutput":
        return f"`{''.join(node.itertext())}`"
    if node.tag == "para":
        return f"{text.strip()}\n\n"
    if node.tag in ("emphasis", "bold"):
        return f"*{text}*"
    return text


def section(node: xml.Element) -> str:
    """Parameters, exceptions, return value."""
    if node.tag == "simplesect":
        titles = {"return": "Returns", "pre": "Requires", "post": "Ensures", "note": "Note", "see": "See"}
        kind = node.get("kind")
        return f"\n\n**{titles.get(kind, kind.capitalize())}:** {markdown_children(node)}\n\n"
    kind = {"exception": "Throws", "param": "", "templateparam": "", "retval": "Returns"}[node.get("kind")]
    lines = []
    for item in node.findall("parameteritem"):
        names = ", ".join(f"`{flat(name)}`" for name in item.iter("parametername"))
        meaning = markdown_children(item.find("parameterdescription"))
        lines.append(f"- {kind + ' ' if kind else ''}{names}{' ' if kind else ': '}{meaning}")
    return "\n\n" + "\n".join(lines) + "\n\n"


def markdown_children(node: xml.Element) -> str:
    return " ".join("".join(markdown(child) for child in node).split())


def escape(text: str) -> str:
    """Characters that Markdown would take for markup."""
    return re.sub(r"([\\`*_<\[|])", r"\\\1", text)


def description(node: xml.Element) -> str:
    text = markdown(node.find("briefdescription")).strip() + "\n\n" + markdown(node.find("detaileddescription")).strip()
    return re.sub(r"\n{3,}", "\n\n", text).strip()


def one_line(node: xml.Element) -> str:
    return " ".join(description(node).split())


class Reference:
    """All pages. `page_of` maps a Doxygen id to its header and anchor."""

    def __init__(self, compounds: list[xml.Element], headers: set[str]):
        self.entries: dict[str, list[Entry]] = collections.defaultdict(list)
        self.page_of: dict[str, tuple[str, str]] = {}
        self.intro: dict[str, str] = {}
        self.headers = headers
        classes: dict[str, Entry] = {}
        inner: list[tuple[str, str]] = []
        for compound in compounds:
            kind = compound.get("kind")
            if kind in ("class", "struct", "union"):
                file, line = place(compound)
                entry = Entry(kind, flat(compound.find("compoundname")), compound, line)
                if "@" in entry.name or "::detail::" in entry.name or "::kernel::" in entry.name:
                    continue
                classes[compound.get("id")] = entry
                inner += [
                    (compound.get("id"), child.get("refid"))
                    for child in compound.findall("innerclass")
                    if child.get("prot") == "public"
                ]
                self.page_of[compound.get("id")] = (file, anchor(entry.name))
            elif kind in ("namespace", "file"):
                self.add_members(compound)
            if kind == "namespace":
                for file in headers & {place(compound)[0]}:
                    self.intro[file] = description(compound)
        hidden = {
            child.get("refid")
            for compound in compounds
            for child in compound.findall("innerclass")
            if child.get("prot") not in (None, "public")
        }
        nested = {child for _, child in inner} | hidden
        for parent, child in inner:
            if parent in classes and child in classes:
                classes[parent].nested.append(classes[child])
        for key, entry in classes.items():
            file = self.page_of[key][0]
            if key not in nested and file in headers:
                self.entries[file].append(entry)

    def add_members(self, compound: xml.Element) -> None:
        scope = flat(compound.find("compoundname"))
        if "detail" in scope.split("::") or "kernel" in scope.split("::"):
            return
        for member in compound.iter("memberdef"):
            file, line = place(member)
            if file not in self.headers or not flat(member.find("name")) or "@" in flat(member.find("name")):
                continue
            if any(line == other.line and flat(member.find("name")) == other.name for other in self.entries[file]):
                continue
            entry = Entry(member.get("kind"), flat(member.find("name")), member, line)
            self.entries[file].append(entry)
            self.page_of[member.get("id")] = (file, anchor(entry.name))

    def href(self, refid: str, page: str) -> str:
        """The link from a header's page to what a Doxygen id names; empty if it has no page."""
        file, name = self.page_of.get(refid, ("", ""))
        if file not in self.headers:
            return ""
        path = "" if file == page else os.path.relpath(file + ".html", os.path.dirname(page))
        return f"{path}#{name}"

    def declaration(self, texts: list[str], node: xml.Element, page: str) -> list[str]:
        """A highlighted block in which known types are links."""
        from pygments import highlight
        from pygments.formatters import HtmlFormatter
        from pygments.lexers import CppLexer

        out = highlight("\n".join(texts), CppLexer(), HtmlFormatter(nowrap=True)).rstrip("\n")
        links = {}
        for ref in node.iter("ref"):
            if uri := self.href(ref.get("refid"), page):
                links[flat(ref).rsplit("::", 1)[-1]] = uri
        for name, uri in links.items():
            out = re.sub(
                rf"(<span class=\"n[a-z]?\">)({re.escape(html.escape(name))})(</span>)",
                rf'\1<a href="{html.escape(uri)}">\2</a>\3',
                out,
            )
        block = '<div class="highlight-cpp notranslate declaration"><div class="highlight"><pre>'
        return [f"{block}{out.replace(chr(10) * 2, chr(10))}</pre></div></div>", ""]

    def page(self, header: str) -> str:
        lines = [f"# {header.split('/include/hamelin/')[-1]}", ""]
        lines += [f"```cpp\n#include \"{header.split('/include/')[-1]}\"\n```", ""]
        if self.intro.get(header):
            lines += [self.intro[header], ""]
        entries = sorted(self.entries[header], key=lambda entry: entry.line)
        at = 0
        while at < len(entries):
            entry = entries[at]
            if entry.kind in ("class", "struct", "union"):
                lines += self.class_lines(entry, header, 2)
                at += 1
                continue
            group = [entry]
            while at + len(group) < len(entries) and same_group(entry, entries[at + len(group)]):
                group.append(entries[at + len(group)])
            lines += self.member_lines(group, header)
            at += len(group)
        return "\n".join(lines) + "\n"

    def member_lines(self, group: list[Entry], header: str) -> list[str]:
        """Overloads share a heading."""
        lines = [f'<span id="{anchor(group[0].name)}"></span>', "", f"## {escape(group[0].name)}", ""]
        for entry in group:
            lines += self.declaration(declared(entry.node), entry.node, header)
            lines += [description(entry.node), ""]
            lines += enum_table(entry.node)
        return lines

    def class_lines(self, entry: Entry, header: str, level: int) -> list[str]:
        name = entry.name.removeprefix(PREFIX)
        short = "::".join(part for part in name.split("::") if level > 2 or part == name.split("::")[-1])
        if level > 2:
            short = "::".join(name.split("::")[1:]) or name
        lines = [f'<span id="{anchor(entry.name)}"></span>', "", f"{'#' * level} {escape(short)}", ""]
        lines += self.declaration([class_head(entry, name)], entry.node, header)
        lines += [description(entry.node), ""]
        members = [
            member
            for part in entry.node.findall("sectiondef")
            for member in part.findall("memberdef")
            if member.get("prot") == "public" and "@" not in flat(member.find("name"))
        ]
        members.sort(key=lambda member: place(member)[1])
        plain = [member for member in members if member.get("kind") == "variable"]
        if plain:
            lines += ["| member | |", "|---|---|"]
            for member in plain:
                text = declared(member)[0].rstrip(";").replace("|", "\\|")
                lines.append(f"| `{text}` | {one_line(member)} |")
            lines.append("")
        for member in members:
            if member.get("kind") == "variable":
                continue
            lines += self.declaration(declared(member), member, header)
            lines += [description(member), "", *enum_table(member)]
        for child in sorted(entry.nested, key=lambda child: child.line):
            lines += self.class_lines(child, header, min(level + 1, 4))
        return lines


def anchor(name: str) -> str:
    return "cpp-" + re.sub(r"[^A-Za-z0-9_]+", "-", name.removeprefix(PREFIX)).strip("-")


def same_group(first: Entry, other: Entry) -> bool:
    return first.kind == other.kind == "function" and first.name == other.name


def class_head(entry: Entry, name: str) -> str:
    bases = ", ".join(f"{base.get('prot')} {flat(base)}" for base in entry.node.findall("basecompoundref"))
    return f"{template(entry.node)}{entry.kind} {name}{' : ' + bases if bases else ''}"


def template(node: xml.Element) -> str:
    parameters = node.find("templateparamlist")
    if parameters is None:
        return ""
    parts = []
    for parameter in parameters.findall("param"):
        text = " ".join(filter(None, (flat(parameter.find("type")), flat(parameter.find("declname")))))
        default = flat(parameter.find("defval"))
        parts.append(f"{text} = {default}" if default else text)
    return f"template <{', '.join(parts)}>\n"


def tidy(text: str) -> str:
    """`const Model& model` as the sources write it, instead of `const Model & model`."""
    text = re.sub(r"< ", "<", re.sub(r" >", ">", text))
    return re.sub(r" ([&*]+)(?=\w)", r"\1 ", re.sub(r" ([&*]+)(?!\w)", r"\1", text))


def declared(node: xml.Element) -> list[str]:
    """The declaration of a member, with long lists of parameters broken into lines."""
    kind, name, result = node.get("kind"), flat(node.find("name")), tidy(flat(node.find("type")))
    if kind == "enum":
        head = f"enum{' class' if node.get('strong') == 'yes' else ''} {name}"
        if described(node):
            return [head]
        values = [f"{flat(value.find('name'))} {flat(value.find('initializer'))}".strip()
                  for value in node.findall("enumvalue")]
        line = f"{head} {{ {', '.join(values)} }};"
        return [line if len(line) <= WIDTH else f"{head} {{\n" + "".join(f"    {value},\n" for value in values) + "};"]
    if kind == "typedef":
        if "(" in result:
            return [f"typedef {result} {name}{flat(node.find('argsstring'))};"]
        return [f"{template(node)}using {name} = {result};"]
    if kind == "define":
        parameters = ", ".join(flat(item) for item in node.iter("defname"))
        value = flat(node.find("initializer"))
        return [f"#define {name}{f'({parameters})' if parameters else ''} {value}".rstrip()]
    if kind == "variable":
        value = flat(node.find("initializer"))
        shown = f" {value}" if value and len(value) < 40 else ""
        static = "static " if node.get("static") == "yes" and "constexpr" not in result else ""
        return [f"{static}{result} {name}{tidy(flat(node.find('argsstring')))}{shown};"]
    return [template(node) + function_text(node, name, result)]


def function_text(node: xml.Element, name: str, result: str) -> str:
    words = []
    for word in ("explicit", "static", "virt"):
        value = node.get(word)
        if value == "yes" or (word == "virt" and value in ("virtual", "pure-virtual")):
            words.append("virtual" if word == "virt" else word)
    words = [word for word in words if word not in result.split()]
    head = " ".join([*words, result, name]).replace("  ", " ").strip()
    arguments = tidy(flat(node.find("argsstring")))
    if len(head + arguments) <= WIDTH:
        return f"{head}{arguments};"
    parameters = []
    for parameter in node.findall("param"):
        text = " ".join(filter(None, (tidy(flat(parameter.find("type"))), flat(parameter.find("declname")))))
        text += flat(parameter.find("array"))
        default = flat(parameter.find("defval"))
        parameters.append(f"    {text} = {default}" if default else f"    {text}")
    tail = arguments[arguments.rfind(")") + 1 :] if parameters else ""
    return f"{head}(\n" + ",\n".join(parameters) + f"){tail};"


def described(node: xml.Element) -> bool:
    """Whether a value of an enumeration has a text of its own."""
    return any(one_line(value) for value in node.findall("enumvalue"))


def enum_table(node: xml.Element) -> list[str]:
    values = node.findall("enumvalue")
    if not described(node):
        return []
    lines = ["| value | |", "|---|---|"]
    for value in values:
        text = f"{flat(value.find('name'))} {flat(value.find('initializer'))}".strip()
        lines.append(f"| `{text}` | {one_line(value)} |")
    return [*lines, ""]
