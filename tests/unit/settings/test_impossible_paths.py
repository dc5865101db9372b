"""What no path and no name can be is told with file, line, key and a way out, wherever a file has it."""

import re
from functools import partial
from pathlib import Path

import pytest

from impactcell.cli.app import run_verb
from impactcell.errors import JournalError, SettingsError
from impactcell.journal.store import Journal
from impactcell.process import yaml_loader
from impactcell.process.exit_codes import ExitCode, exit_code_of
from impactcell.settings import read_cell
from impactcell.settings.judgement import judge_cell
from impactcell.settings.model_file import read_model

CONFIG = Path(__file__).resolve().parents[3] / "config"
KEYS = {
    "module.register_map": "module: {{register_map: {}}}",
    "module.tls.ca_certificate": "module: {{register_map: {map}, tls: {{ca_certificate: {}}}}}",
    "model": "model: {}",
    "opcua.users_file": "opcua: {{users_file: {}}}",
    "opcua.certificates_dir": "opcua: {{certificates_dir: {}}}",
    "journal.file": "journal: {{file: {}}}",
    "web.certificate": "web: {{endpoint: 'https://127.0.0.1:8480', certificate: {}}}",
    "web.studies_dir": "web: {{studies_dir: {}}}",
}
"""Every key of a cell file that names a file or directory."""
LONG = "x" * 300


def cell_file(directory: Path, key: str, value: str) -> Path:
    """Write a cell file whose `key` has this value; all else is in order."""
    maps, model = CONFIG / "maps" / "fpga-v1.yaml", CONFIG / "models" / "prototype.yaml"
    parts = {"module": f"module: {{register_map: {maps}}}", "model": f"model: {model}"}
    parts[key.partition(".")[0]] = KEYS[key].format(value, map=maps)
    path = directory / "cell.yaml"
    path.write_text("\n".join(["format: 1", "cell: press-1", "alarms: {wear_limit: 0.25}", *parts.values()]))
    return path


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize(
    ("value", "told"),
    [
        (r'"a\0b"', r"the character U\+0000, .*; take it out"),
        (r'"a\x1bb"', r"the character U\+001B, .*; take it out"),
        (r'"a\ud800b"', r"the character U\+D800, .*; take it out"),
        (LONG, r"'x+' cannot be used as a path \(File name too long\); name another"),
        (
            "~no-such-user/a",
            r"'~no-such-user/a' cannot be used as a path \(.*home directory.*\); name another",
        ),
    ],
    ids=["nul", "escape", "surrogate", "long", "home"],
)
def test_a_path_that_cannot_be_is_told_with_its_key(tmp_path: Path, key: str, value: str, told: str) -> None:
    path = cell_file(tmp_path, key, value)
    with pytest.raises(SettingsError) as caught:
        judge_cell(read_cell(path))
    lines = str(caught.value).splitlines()
    assert any(
        re.fullmatch(rf"{re.escape(str(path))}:\d+:\d+: {re.escape(key)}: .*{told}.*", line) for line in lines
    )


def test_a_path_through_a_loop_of_links_is_told(tmp_path: Path) -> None:
    (tmp_path / "round").symlink_to(tmp_path / "round")
    with pytest.raises(
        SettingsError, match=r"cell\.yaml:\d+:\d+: journal\.file: .*cannot be used as a path .*oop"
    ):
        read_cell(cell_file(tmp_path, "journal.file", "round/x"))


@pytest.mark.parametrize(
    ("key", "value", "column"),
    [("opcua.certificates_dir", "users.yaml", 27), ("web.studies_dir", "users.yaml/studies", 20)],
)
def test_a_directory_where_a_file_is_in_its_way_is_told(
    tmp_path: Path, key: str, value: str, column: int
) -> None:
    """`check` found such a cell in order; `run` ended with `users.yaml/own: Not a directory`."""
    (tmp_path / "users.yaml").write_text("users: []\n")
    told = (
        rf"cell\.yaml:6:{column}: {re.escape(key)}: {tmp_path}/users.yaml is a file, {key.partition('.')[2]} "
        "names a directory; name another, which is made where it is not there$"
    )
    with pytest.raises(SettingsError, match=told):
        read_cell(cell_file(tmp_path, key, value))
    read_cell(cell_file(tmp_path, key, "not/there/yet"))


@pytest.mark.parametrize("key", ["module.register_map", "model", "web.certificate", "journal.file"])
def test_a_directory_where_a_file_is_needed_is_told(tmp_path: Path, key: str) -> None:
    """It was told not to be there."""
    told = rf"cell\.yaml:\d+:\d+: {re.escape(key)}: {tmp_path} is a directory; a file is needed here$"
    with pytest.raises(SettingsError) as caught:
        read_cell(cell_file(tmp_path, key, "."))
    assert re.search(told, str(caught.value), re.MULTILINE), caught.value


def test_a_journal_that_is_none_is_told_by_check_as_by_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`check` found such a cell in order; `run` named no cell, no key, no way out, and left a lock."""
    (tmp_path / "users.yaml").write_text("users: []\n")
    cell = cell_file(tmp_path, "journal.file", "users.yaml")
    told = (
        f"{cell}:6:17: journal.file: {tmp_path}/users.yaml: not a journal, not even a database; "
        "it is left as it is; name another file"
    )
    for verb in ("check", "run"):
        assert exit_code_of("impactcell", partial(run_verb, [verb, str(cell)])) == ExitCode.BAD_INPUT
        assert told in capsys.readouterr().err.splitlines()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["cell.yaml", "users.yaml"]


@pytest.mark.parametrize("text", ['module: {host: "a\\0b"}', 'module: {"ho\\0st": a}', '- ["a\\u0007"]'])
def test_no_text_and_no_key_has_such_a_character(tmp_path: Path, text: str) -> None:
    path = tmp_path / "any.yaml"
    path.write_text(text)
    with pytest.raises(SettingsError, match=r"any\.yaml:1:\d+: .*the character U\+000[07]"):
        yaml_loader.load(path)


def test_lines_and_tabs_are_text(tmp_path: Path) -> None:
    path = tmp_path / "any.yaml"
    path.write_text('description: "a\\tb\\r\\nc"\n')
    assert yaml_loader.load(path)[0] == {"description": "a\tb\r\nc"}


@pytest.mark.parametrize("value", [LONG, '"a\\0"'])
def test_an_effect_of_a_model_too(tmp_path: Path, value: str) -> None:
    path = tmp_path / "model.yaml"
    text = (CONFIG / "models" / "prototype.yaml").read_text(encoding="utf-8")
    path.write_text(f"{text}\neffect_files: [{value}]\n")
    with pytest.raises(SettingsError, match=r"model\.yaml:\d+:\d+: .*(too long|U\+0000)"):
        read_model(path)


@pytest.mark.parametrize("read_only", [False, True])
@pytest.mark.parametrize("name", ["a\0b", "a\ud800b", LONG])
def test_a_journal_that_no_file_can_be(tmp_path: Path, name: str, read_only: bool) -> None:
    with pytest.raises(JournalError, match=r"no file can have this name; name another|too long"):
        Journal(tmp_path / name, "press-1", read_only=read_only)


def test_a_command_line_says_which_name_is_too_long(capsys: pytest.CaptureFixture[str]) -> None:
    def work() -> None:
        Path(LONG).is_file()

    assert exit_code_of("impactcell", work) == ExitCode.FAILED
    assert capsys.readouterr().err == f"impactcell: {LONG}: File name too long; name another\n"
