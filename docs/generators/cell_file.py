"""Every key of a cell file, from the JSON Schema that `impactcell schema` prints."""

import json
from typing import Any

from generators.markdown import code, table
from impactcell.settings import schema


def _type(entry: dict[str, Any]) -> str:
    if "$ref" in entry:
        return f"section {entry['$ref'].rsplit('/', 1)[-1]}"
    if "anyOf" in entry:
        return " or ".join(_type(choice) for choice in entry["anyOf"])
    if "enum" in entry:
        return " or ".join(map(str, entry["enum"]))
    if "const" in entry:
        return str(entry["const"])
    kind = entry.get("type", "anything")
    if kind == "array":
        return f"list of {_type(entry.get('items', {}))}"
    bounds = [
        f"{sign} {entry[key]:g}"
        for key, sign in (
            ("minimum", "≥"),
            ("exclusiveMinimum", ">"),
            ("maximum", "≤"),
            ("exclusiveMaximum", "<"),
        )
        if key in entry
    ]
    return f"{kind} {', '.join(bounds)}".strip()


def _default(entry: dict[str, Any], *, required: bool) -> str:
    if required:
        return "required"
    default = entry.get("default")
    return "" if default is None or isinstance(default, dict | list) else code(json.dumps(default))


def _section(title: str, schema_of: dict[str, Any]) -> str:
    required = schema_of.get("required", [])
    rows = [
        (code(name), entry.get("description", ""), _type(entry), _default(entry, required=name in required))
        for name, entry in schema_of.get("properties", {}).items()
    ]
    return "\n\n".join(
        [f"## {title}", schema_of.get("description", ""), table(("key", "meaning", "type", "default"), rows)]
    )


def sections() -> str:
    """Write the top level and every section."""
    whole = json.loads(schema())
    return "\n\n".join(
        [
            _section("Top level", whole),
            *(_section(name, part) for name, part in sorted(whole["$defs"].items())),
        ]
    )
