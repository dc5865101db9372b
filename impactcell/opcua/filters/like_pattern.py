r"""Patterns of the Like operator (Part 4, 7.7.3, table 120).

``%`` stands for any characters, ``_`` for one, ``[a-f]`` and ``[abc]`` for one of a set, ``[^a-f]`` for one
that is not of it; ``\`` takes the next character as it is.
"""

from functools import lru_cache
from typing import Final

MAX_PATTERN: Final = 1_000
"""Longest pattern, characters; no text of an event is longer."""

Matcher = tuple[frozenset[str], tuple[tuple[str, str], ...], bool]
"""What one place of a pattern takes: characters, ranges of characters, and whether it takes all but these."""

_ANY: Final[Matcher] = frozenset(), (), True


class LikePattern:
    """A pattern, matched in one pass over the text: all ways of matching are followed at once.

    Bit i of a state says that the first i places of the pattern can stand for what has been read. A text
    of n characters takes n steps, each on numbers of as many bits as the pattern is long.
    """

    def __init__(self, pattern: str) -> None:
        self._places: list[Matcher] = []
        self._skips = 0
        """Bit i: any characters may follow the first i places."""
        position = 0
        while position < len(pattern):
            position = self._add(pattern, position)

    def _add(self, pattern: str, position: int) -> int:
        """Add the place of the pattern at a position; the position of the next."""
        character = pattern[position]
        if character == "%":
            self._skips |= 1 << len(self._places)
            return position + 1
        if character == "_":
            self._places.append(_ANY)
            return position + 1
        if character == "[":
            end = pattern.find("]", position + 2)
            if end > 0:
                self._places.append(_character_set(pattern[position + 1 : end]))
                return end + 1
        if character == "\\" and position + 1 < len(pattern):
            position += 1
        self._places.append((frozenset(pattern[position]), (), False))
        return position + 1

    def matches(self, text: str) -> bool:
        """Whether the pattern stands for the whole of a text."""
        state, taken_by = 1, dict[str, int]()
        for character in text:
            takes = taken_by.get(character)
            if takes is None:
                takes = taken_by[character] = self._places_that_take(character)
            state = ((state & takes) << 1) | (state & self._skips)
            if not state:
                return False
        return bool(state >> len(self._places))

    def _places_that_take(self, character: str) -> int:
        places = 0
        for index, (characters, ranges, inverted) in enumerate(self._places):
            listed = character in characters or any(low <= character <= high for low, high in ranges)
            places |= (listed != inverted) << index
        return places


def _character_set(body: str) -> Matcher:
    inverted = body.startswith("^") and len(body) > 1
    rest = body[inverted:]
    characters, ranges = set(), []
    while rest:
        if len(rest) > 2 and rest[1] == "-":
            ranges.append((rest[0], rest[2]))
            rest = rest[3:]
        else:
            characters.add(rest[0])
            rest = rest[1:]
    return frozenset(characters), tuple(ranges), inverted


@lru_cache(maxsize=256)
def _compiled(pattern: str) -> LikePattern:
    return LikePattern(pattern)


def like(text: str, pattern: str) -> bool:
    r"""Match a text; one that is longer than is taken stands for nothing.

    >>> like("WearLimit", "Wear%"), like("cell-3", "cell-[1-2]"), like("5 %", r"5 \%")
    (True, False, True)
    """
    return len(pattern) <= MAX_PATTERN and _compiled(pattern).matches(text)
