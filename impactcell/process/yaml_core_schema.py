"""Values of YAML scalars by the core schema of YAML 1.2; what cannot be built is told at its place."""

import re
from collections.abc import Hashable
from contextlib import suppress
from typing import Any

import yaml
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.parser import Parser
from yaml.reader import Reader
from yaml.resolver import Resolver
from yaml.scanner import Scanner


class _CoreResolver(Resolver):
    """Says what a scalar is that has no tag, by YAML 1.2's core schema."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012


class _TextComposer(Reader, Scanner, Parser, Composer, _CoreResolver):
    """Finds the nodes of a text."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)
        Composer.__init__(self)
        Resolver.__init__(self)


if yaml.__with_libyaml__:
    from yaml.cyaml import CParser  # type: ignore[attr-defined]  # not public in the stubs

    class _QuickComposer(Composer, CParser, _CoreResolver):
        """Finds them in a fraction of the time: libyaml reads, and nodes are put together as by the other."""

        def __init__(self, text: str) -> None:
            CParser.__init__(self, text)
            Composer.__init__(self)
            Resolver.__init__(self)


def compose(text: str) -> yaml.Node | None:
    """Give the node of a text's only document; None of a text without any.

    What libyaml refuses is read once more without it: its words and places are others.

    Raises
    ------
    yaml.YAMLError
        The text is no YAML, or has several documents.
    RecursionError
        It is nested too deeply.
    """
    if yaml.__with_libyaml__:
        with suppress(yaml.YAMLError):
            return _QuickComposer(text).get_single_node()
    return _TextComposer(text).get_single_node()


class CoreConstructor(SafeConstructor):
    """Builds values from nodes; a repeated key is an error."""

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


def _decimal(loader: CoreConstructor, node: yaml.ScalarNode) -> int:
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
    _CoreResolver.add_implicit_resolver(
        f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), [*_first, *([""] * (_tag == "null"))]
    )
CoreConstructor.add_constructor("tag:yaml.org,2002:int", _decimal)  # type: ignore[type-var]
