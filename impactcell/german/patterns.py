"""English sentences that stand behind names, put into German by patterns."""

import re
from collections.abc import Callable, Mapping


def by_patterns(
    said: str, patterns: Mapping[str, str], words: Mapping[str, Callable[[str], str]]
) -> str | None:
    r"""Say a sentence by the first pattern that it fits as a whole; None where it fits none.

    Parameters
    ----------
    patterns : mapping of str to str
        German by English; `\1` and `\g<name>` stand for what a group found.
    words : mapping of str to callable
        How what a group found is said, by the name of the group; what is not in it stays as it is.
    """
    for pattern, german in patterns.items():
        match = re.fullmatch(pattern, said)
        if match is not None:
            return _expand(match, german, words)
    return None


def behind_names(
    reason: str, patterns: Mapping[str, str], words: Mapping[str, Callable[[str], str]]
) -> tuple[list[str], str] | None:
    """Part a reason into the names before its sentence, each ended by a colon, and the sentence in German.

    The sentence that begins first counts; None where there is none.
    """
    parts = reason.split(": ")
    for first in range(len(parts)):
        german = by_patterns(": ".join(parts[first:]), patterns, words)
        if german is not None:
            return parts[:first], german
    return None


def _expand(match: re.Match[str], german: str, words: Mapping[str, Callable[[str], str]]) -> str:
    def found(place: re.Match[str]) -> str:
        text = match[place[1] or int(place[2])] or ""
        return words[place[1]](text) if place[1] in words else text

    return re.sub(r"\\g<(\w+)>|\\(\d+)", found, german)
