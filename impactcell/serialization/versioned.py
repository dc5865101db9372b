"""A stored form with a number, and the way to it from every older one.

What is stored is an envelope, `{"format": n, "content": tree}`; format 1, of before there were numbers, is
the bare content. Migrations are pure, dict to dict, and lead from each format to the next; a later format
than this version knows is refused.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from impactcell.serialization.json_text import dump_tree, load_tree
from impactcell.serialization.message_pack import pack_tree, unpack_tree
from impactcell.serialization.tree import Tree, Unknown, from_tree, to_tree

T = TypeVar("T")
_ANY = "*"


@dataclass(frozen=True, slots=True)
class Migration:
    """From one format to the next: first `reshape`, then the rows, all of them in terms of what it gives.

    A place is the keys from the root on, with dots between; a list has no key of its own, and `*` stands for
    every key at its place.

    Attributes
    ----------
    reshape : callable
        What rows cannot say.
    renamed : mapping
        New key of each place whose key is another.
    added : mapping
        What a new key holds: its place, made of the old keys above it and its own, and the value.
    dropped : collection of str
        Places that are no more.
    """

    reshape: Callable[[dict[str, Tree]], dict[str, Tree]] = dict
    renamed: Mapping[str, str] = field(default_factory=dict)
    added: Mapping[str, Tree] = field(default_factory=dict)
    dropped: tuple[str, ...] = ()

    def __call__(self, content: dict[str, Tree]) -> dict[str, Tree]:
        """Give the content in the next format; what it was given stays as it was."""
        migrated: dict[str, Tree] = self._walked(self.reshape(content), "")
        return migrated

    def _walked(self, tree: Tree, place: str) -> Tree:
        if isinstance(tree, list | tuple):
            return [self._walked(item, place) for item in tree]
        if not isinstance(tree, dict):
            return tree
        walked = {}
        for key, value in tree.items():
            at = self._place(place, key)
            if at not in self.dropped:
                walked[self.renamed.get(at, key)] = self._walked(value, at)
        for at, value in self.added.items():
            above, _, key = at.rpartition(".")
            if above == place:
                walked[key] = value
        return walked

    def _place(self, above: str, key: str) -> str:
        before = f"{above}." if above else ""
        any_key = f"{before}{_ANY}"
        rows = (*self.renamed, *self.added, *self.dropped)
        return (
            any_key if any(row == any_key or row.startswith(f"{any_key}.") for row in rows) else before + key
        )


@dataclass(frozen=True, slots=True)
class Versioned(Generic[T]):
    """How values of a kind are stored.

    Attributes
    ----------
    what : str
        For messages, as in "the state".
    kind : type
    migrations : tuple of Migration
        The first leads from format 1 to 2, and so on; the newest format is one more than there are.
    """

    what: str
    kind: type[T]
    migrations: tuple[Migration, ...]

    @property
    def format(self) -> int:
        """Format that is written."""
        return len(self.migrations) + 1

    def pack(self, value: T, unknown: Unknown | None = None) -> bytes:
        """Write a value as bytes, with what an earlier `unpack` had to set aside."""
        return pack_tree(self._envelope(value, unknown))

    def dumps(self, value: T) -> str:
        """Write a value as JSON."""
        return dump_tree(self._envelope(value, None))

    def unpack(self, data: bytes, initial: T | None = None, unknown: Unknown | None = None) -> T:
        """Read what any version up to this one packed; see `from_tree` for the parameters.

        Raises
        ------
        ValueError
            It is of a later format, damaged, or of a version that should have had a number of its own.
        """
        return self._read(_of(self.what, unpack_tree, data), initial, unknown)

    def loads(self, text: str) -> T:
        """Read what any version up to this one wrote as JSON; `unpack` says what is refused."""
        return self._read(_of(self.what, load_tree, text), None, None)

    def is_older(self, data: bytes) -> bool:
        """Whether packed bytes are of an earlier format than this version writes."""
        return _format(_of(self.what, unpack_tree, data)) < self.format

    def _envelope(self, value: T, unknown: Unknown | None) -> Tree:
        content = to_tree(value)
        for place, members in (unknown or {}).items():
            inner = content
            for key in place:
                inner = inner[key]
            inner.update(members)
        return {"format": self.format, "content": content}

    def _read(self, envelope: Tree, initial: T | None, unknown: Unknown | None) -> T:
        number = _format(envelope)
        if number > self.format:
            raise ValueError(f"{self.what} is of format {number}, this version knows up to {self.format}")
        content = envelope.get("content") if "format" in envelope else envelope
        try:
            for migration in self.migrations[number - 1 :]:
                content = migration(content)
            return from_tree(self.kind, content, initial=initial, unknown=unknown)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            why = error if type(error) is ValueError else f"{type(error).__name__}: {error}"
            raise ValueError(f"{self.what} of format {number} cannot be read: {why}") from error


def _of(what: str, read: Callable[[Any], Tree], data: bytes | str) -> Tree:
    try:
        return read(data)
    except ValueError as error:
        raise ValueError(f"{what} cannot be read: {error}") from error


def _format(envelope: Tree) -> int:
    number = envelope.get("format", 1) if isinstance(envelope, dict) else None
    if type(number) is not int or number < 1:
        raise ValueError(f"not a stored value: a format number is needed, not {number!r}")
    return number
