"""The YAML reader: scalars as in YAML 1.2, positions, and faults told all at once."""

import contextlib
from pathlib import Path
from typing import Annotated, Literal

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field

from impactcell.errors import SettingsError
from impactcell.process.yaml_loader import load
from impactcell.process.yaml_schema import read


class Part(BaseModel):
    model_config = ConfigDict(extra="forbid")
    mass_kg: float = Field(gt=0)
    name: str = "part"


class Round(BaseModel):
    model_config = ConfigDict(extra="forbid")
    kind: Literal["round"]
    radius_m: float


class Square(BaseModel):
    model_config = ConfigDict(extra="forbid")
    kind: Literal["square"]
    edge_m: float


class Cell(BaseModel):
    model_config = ConfigDict(extra="forbid")
    part: Part
    spares: dict[str, Part] = {}
    shapes: list[Annotated[Round | Square, Field(discriminator="kind")]] = []
    retries: int | None = None


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "cell.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def faults(tmp_path: Path, text: str) -> list[str]:
    path = write(tmp_path, text)
    with pytest.raises(SettingsError) as caught:
        read(path, Cell)
    return [line.removeprefix(f"{path}:") for line in str(caught.value).splitlines()]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-6", 1e-6),
        ("1.5E3", 1500.0),
        (".5", 0.5),
        ("-.inf", float("-inf")),
        ("010", 10),
        ("0x1F", 31),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("on", "on"),
        ("no", "no"),
        ("true", True),
        ("~", None),
        ("", None),
        ("2026-01-01", "2026-01-01"),
        ("'5'", "5"),
    ],
)
def test_scalars_are_those_of_the_core_schema(tmp_path: Path, text: str, value: object) -> None:
    data, _ = load(write(tmp_path, f"key: {text}\n"))
    assert data == {"key": value}


def test_every_fault_is_told_at_once_with_its_place(tmp_path: Path) -> None:
    text = "part:\n  mas_kg: 3\n  name: [1]\nspares:\n  a: {mass_kg: -1}\nretrys: 2\nretries: x\n"
    assert faults(tmp_path, text) == [
        "1:1: 'part.mass_kg' is missing",
        "2:3: unknown key 'part.mas_kg'; did you mean 'mass_kg'?",
        "3:9: part.name: should be a valid string",
        "5:16: spares.a.mass_kg: should be greater than 0, not -1",
        "6:1: unknown key 'retrys'; did you mean 'retries'?",
        "7:10: retries: should be a valid integer, unable to parse string as an integer, not 'x'",
    ]


def test_members_of_a_discriminated_union_are_found(tmp_path: Path) -> None:
    text = "part: {mass_kg: 1}\nshapes:\n  - {kind: round, radius_m: 1, radiusm: 2}\n  - kind: hexagon\n"
    first, second = faults(tmp_path, text)
    assert first.startswith("3:32: unknown key")
    assert "radius_m" in first
    assert second.startswith("4:5: shapes[1]: ")
    assert "hexagon" in second


def test_an_unknown_key_without_a_near_one_lists_what_is_allowed(tmp_path: Path) -> None:
    assert faults(tmp_path, "part: {mass_kg: 1, qqq: 1}\n") == [
        "1:20: unknown key 'part.qqq'; allowed here: mass_kg, name"
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "1:1: the file is empty"),
        ("# only a comment\n", "1:1: the file is empty"),
        ("a: 1\na: 2\n", "2:1: key 'a' is given twice"),
        ("a: [1\n", "2:1:"),
        ("a: 1\n---\nb: 2\n", "2:1:"),
        ("a: &x [*x]\n", "1:4: this part of the file contains itself"),
        ("a: !!python/object:os.system {}\n", "1:4:"),
        ("? [1, 2]\n: 3\n", "1:3: a key must be plain text or a number"),
        ("a: \x07\n", "1:4: a character YAML does not allow"),
        ("- 1\n", "1:1: should be keys with values (`key: value`), not a list"),
        ("word\n", "1:1: should be keys with values (`key: value`), not 'word'"),
        ("part: 3\n", "1:7: part: should be keys with values (`key: value`), not 3"),
        ("a: 1\n\tb: 2\n", "2:1: a tab; YAML is indented with spaces"),
        ("a: 1\n b: [x\n", "2:3: a second `:` where none is expected: indent the line as its neighbours"),
        ("a: *nobody\n", "1:4:"),
        ("b: 1\na: !!bool maybe\n", "2:4: 'maybe' cannot be read as bool"),
        ("a: !!timestamp soon\n", "1:4: 'soon' cannot be read as timestamp"),
        ("a: !!timestamp 2026-13-45\n", "1:4: '2026-13-45' cannot be read as timestamp"),
        ("a: !!float ''\n", "1:4: '' cannot be read as float"),
        ("a: !!map one\n", "1:4: expected a mapping node"),
        ("b: 1\n!!int one: 1\n", "2:1: 'one' cannot be read as int"),
        (f"a: {'9' * 5000}\n", "1:4:"),
        ('a: "\\ud800"\n', "1:4: a: has the character U+D800, which no name, path or text has; take it out"),
    ],
)
def test_bad_files_are_refused_with_a_place(tmp_path: Path, text: str, message: str) -> None:
    assert faults(tmp_path, text)[0].startswith(message)


def test_a_missing_file_a_directory_and_bytes_are_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"nowhere\.yaml: cannot be read: No such file"):
        load(tmp_path / "nowhere.yaml")
    with pytest.raises(SettingsError, match="cannot be read: Is a directory"):
        load(tmp_path)


@pytest.mark.parametrize(
    ("content", "place"),
    [(b"a: \xff\n", "1:4"), (b"\xef\xbb\xbfa: \xff\n", "1:4"), ("a: 1\nü: ".encode() + b"\xff", "2:4")],
)
def test_bytes_that_are_no_text_are_told_with_their_place(tmp_path: Path, content: bytes, place: str) -> None:
    (tmp_path / "b.yaml").write_bytes(content)
    with pytest.raises(
        SettingsError, match=rf"b\.yaml:{place}: is not UTF-8 text \(byte 0xFF here\); save it as UTF-8$"
    ):
        load(tmp_path / "b.yaml")


def test_a_file_without_end_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "a: 1\n")
    with path.open("r+b") as file:
        file.truncate(20_000_000)
    with pytest.raises(SettingsError, match="has more than 10000000 bytes, so it is no file of settings"):
        load(path)
    with pytest.raises(SettingsError, match="has more than 10000000 bytes"):
        load(Path("/dev/zero"))


@pytest.mark.slow
def test_a_file_of_nested_aliases_is_refused(tmp_path: Path) -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 9)]
    with pytest.raises(SettingsError, match="aliases describe more than"):
        load(write(tmp_path, "\n".join(lines)))


def test_a_file_of_nested_merges_is_refused(tmp_path: Path) -> None:
    lines = ["a0: &a0 {x: 1}"]
    lines += [f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 10)}]}}" for n in range(1, 9)]
    with pytest.raises(SettingsError, match="aliases describe more than"):
        load(write(tmp_path, "\n".join(lines)))


def test_keys_in_any_base_are_numbers(tmp_path: Path) -> None:
    assert load(write(tmp_path, "0o17: {a: 1}\n0x10: 2\n010: 3\n"))[0] == {15: {"a": 1}, 16: 2, 10: 3}


def test_merged_keys_keep_the_place_they_come_from(tmp_path: Path) -> None:
    text = "spares:\n  a: &a {mass_kg: 0}\n  b:\n    <<: *a\n    name: b\npart: {mass_kg: 1}\n"
    assert faults(tmp_path, text) == [
        "2:19: spares.a.mass_kg: should be greater than 0, not 0",
        "2:19: spares.b.mass_kg: should be greater than 0, not 0",
    ]


@given(st.text(max_size=200))
def test_no_text_gives_anything_but_data_or_a_settings_error(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    path = tmp_path_factory.mktemp("any") / "any.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    with contextlib.suppress(SettingsError):
        read(path, Cell)


SCALARS = st.sampled_from(["", "x", "1", "-", ".inf", "1e999", "2026-02-30", "@@", "~", "'", "[1]", "{a: 1}"])
KINDS = ["bool", "int", "float", "null", "timestamp", "binary", "set", "omap", "pairs", "seq", "map", "str"]
TAGS = st.sampled_from(["", *(f"!!{kind} " for kind in KINDS)])


@given(st.lists(st.tuples(TAGS, SCALARS, TAGS, SCALARS), max_size=4))
def test_values_and_keys_with_any_tag_are_data_or_a_settings_error(
    tmp_path_factory: pytest.TempPathFactory, pairs: list[tuple[str, str, str, str]]
) -> None:
    path = tmp_path_factory.mktemp("tags") / "tags.yaml"
    path.write_text("".join(f"? {tag}{key}\n: {kind}{value}\n" for tag, key, kind, value in pairs))
    with contextlib.suppress(SettingsError):
        load(path)


PIECES = [
    "a: ",
    "b",
    "- ",
    ", ",
    ": ",
    "&x ",
    "*x",
    "!!str ",
    "|\n ",
    ">-\n  ",
    "# c",
    "<<: ",
    "1.5",
    "~",
    "é",
    "\\",
]
MARKS = [*"{}[]'\"@%`=\t", "\n", "\n  ", "\r\n", "\x85", "\u2028", "---\n", "...\n", "%YAML 1.1\n"]


def told(path: Path) -> object:
    """What is read, or the fault."""
    try:
        return load(path)
    except SettingsError as fault:
        return str(fault)


@given(st.lists(st.sampled_from(PIECES + MARKS), max_size=14).map("".join))
def test_with_libyaml_and_without_a_text_is_the_same(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    """But that it lets a tab stand behind a value, as YAML does and PyYAML alone does not."""
    path = tmp_path_factory.mktemp("both") / "both.yaml"
    path.write_text(text, encoding="utf-8", newline="")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml, "__with_libyaml__", False)
        without = told(path)
    assert told(path) == without or (isinstance(without, str) and "\t" in text)
