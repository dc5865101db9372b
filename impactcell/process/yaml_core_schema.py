"""Values of YAML scalars by the core schema of YAML 1.2; what cannot be built is told at its place."""

import re
from collections.abc import Hashable
from typing import Any

import yaml


class CoreLoader(yaml.SafeLoader):
    """SafeLoader with the scalars of YAML 1.2's core schema; a repeated key is an error."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:  # noqa: FBT001, FBT002
        """Build the value of a node; what cannot be what its tag or its digits say is told at its place."""
        try:
            return super().construct_object(node, deep=deep)
        except (ValueError, LookupError, AttributeError, OverflowError) as fault:
            kind = node.tag.rpartition(":")[2]
            shown = f"{node.value[:40]!r}" if isinstance(node, yaml.ScalarNode) else "this"
            raise yaml.MarkedYAMLError(
                None, None, f"{shown} cannot be read as {kind}", node.start_mark
            ) from fault

    def construct_mapping(self, node: yaml.Node, deep: bool = False) -> dict[Hashable, Any]:  # noqa: FBT001, FBT002
        """Build a mapping whose keys are plain and come once."""
        seen: set[object] = set()
        for key_node, _ in node.value if isinstance(node, yaml.MappingNode) else ():
            if key_node.tag == "tag:yaml.org,2002:merge":
                continue
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str | int | float | None):
                raise yaml.MarkedYAMLError(
                    None, None, "a key must be plain text or a number", key_node.start_mark
                )
            if key in seen:
                raise yaml.MarkedYAMLError(None, None, f"key {key!r} is given twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep=deep)  # type: ignore[arg-type] # which refuses other nodes


def _decimal(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
    return integer(str(loader.construct_scalar(node)))


def integer(text: str) -> int:
    """Give the number of a scalar of digits, in base 10, 16 or 8; raises ValueError for any other."""
    return int(text, 0) if text[:2] in ("0x", "0o") else int(text)


for _tag, _pattern, _first in (
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("null", r"~|null|Null|NULL|", "~nN"),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789"),
    (
        "float",
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        "-+.0123456789",
    ),
    ("merge", r"<<", "<"),
):
    CoreLoader.add_implicit_resolver(
        f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), [*_first, *([""] * (_tag == "null"))]
    )
CoreLoader.add_constructor("tag:yaml.org,2002:int", _decimal)
