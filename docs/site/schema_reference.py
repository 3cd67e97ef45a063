"""Pages of JSON Schemas: one table with a row for each key."""

from __future__ import annotations

import json
from pathlib import Path


def cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


def type_of(schema: dict) -> str:
    """The values that a schema allows, in a few words."""
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    if "$ref" in schema:
        place, name = schema["$ref"].rsplit("/", 1)
        if place in ("#/definitions", "#/$defs"):
            return f"[{name}](#{name.lower()})"
        path = schema["$ref"].removeprefix("#/").replace("properties/", "").replace("/items", "[]").replace("/", ".")
        return f"as `{path}`"
    kinds = schema.get("type", "any")
    return " or ".join([kinds] if isinstance(kinds, str) else kinds)


def bounds_of(schema: dict) -> str:
    names = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    parts = [f"{sign} {schema[key]:g}" for key, sign in names.items() if key in schema]
    low, high = schema.get("minItems"), schema.get("maxItems")
    if low is not None and low == high:
        parts.append(f"{low} items")
    elif low is not None or high is not None:
        parts.append(f"{low or 0} to {high} items" if high is not None else f"at least {low} items")
    return ", ".join(parts)


def rows(schema: dict, path: str):
    """Rows (key, values, default, meaning) of all keys below a schema."""
    required = schema.get("required", [])
    for name, child in schema.get("properties", {}).items():
        yield f"{path}{name}", child, name in required
        yield from rows(child, f"{path}{name}.")
    items = schema.get("items")
    if isinstance(items, dict):
        stem = path[:-1] if path else ""
        if items.get("description") and not items.get("properties"):
            yield f"{stem}[]", items, False
        yield from rows(items, f"{stem}[].")
    more = schema.get("additionalProperties")
    if isinstance(more, dict):
        yield f"{path}*", more, False
        yield from rows(more, f"{path}*.")
    for word in ("oneOf", "anyOf", "allOf"):
        for choice in schema.get(word, []):
            yield from rows(choice, path)


def table(schema: dict) -> list[str]:
    lines = ["| key | values | default | meaning |", "|---|---|---|---|"]
    for key, child, required in rows(schema, ""):
        values = type_of(child)
        if bounds := bounds_of(child):
            values += f", {bounds}"
        default = f"`{json.dumps(child['default'])}`" if "default" in child else "required" if required else ""
        name = key.replace(".", ".<wbr>")
        lines.append(f'| <code class="literal key">{name}</code> |'
                     f" {cell(values)} | {cell(default)} | {cell(child.get('description', ''))} |")
    return lines if len(lines) > 2 else []


def page(file: Path, title: str) -> str:
    """The page of a schema file."""
    schema = json.loads(file.read_text(encoding="utf-8"))
    lines = [f"# {title}", "", schema.get("description", schema.get("title", "")), ""]
    if "schema" in schema.get("properties", {}):
        lines += [f"A document says `\"schema\": {json.dumps(schema['properties']['schema'].get('const'))}`.", ""]
    lines += table(schema) + [""]
    for name, definition in {**schema.get("definitions", {}), **schema.get("$defs", {})}.items():
        lines += [f"## {name}", "", definition.get("description", type_of(definition)), "", *table(definition), ""]
    lines += ["## Schema", "", "```json", file.read_text(encoding="utf-8").rstrip(), "```", ""]
    return "\n".join(lines)
