"""The page in a cell file: loopback by default, and nothing readable on a network unless it is said."""

from pathlib import Path

import pytest
import yaml

from impactcell.errors import SettingsError
from impactcell.settings import read_cell, read_cells
from tests.integration.processes import write_cell


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    for name in ("page.pem", "key.pem"):
        (tmp_path / name).write_text("")
    return "page.pem", "key.pem"


def test_without_a_word_it_is_on_loopback(tmp_path: Path) -> None:
    path = write_cell(tmp_path, 1)
    content = yaml.safe_load(path.read_text())
    del content["web"]
    path.write_text(yaml.safe_dump(content))
    page = read_cell(path).settings.web
    assert page is not None
    assert page.endpoint == "http://127.0.0.1:8480"


def test_null_means_none(tmp_path: Path) -> None:
    assert read_cell(write_cell(tmp_path, 1, web=None)).settings.web is None


@pytest.mark.parametrize("endpoint", ["http://127.0.0.1:80", "http://[::1]:80/", "http://localhost:0"])
def test_loopback_needs_no_encryption(tmp_path: Path, endpoint: str) -> None:
    page = read_cell(write_cell(tmp_path, 1, web={"endpoint": endpoint})).settings.web
    assert page is not None
    assert page.endpoint == endpoint.rstrip("/")


@pytest.mark.parametrize(
    ("web", "said"),
    [
        ({"endpoint": "http://0.0.0.0:8480"}, "in the clear"),
        ({"endpoint": "http://cell.example:8480"}, "in the clear"),
        ({"endpoint": "https://127.0.0.1:8480"}, "certificate and key"),
        ({"endpoint": "https://127.0.0.1:8480", "certificate": "page.pem"}, "certificate and key"),
        ({"endpoint": "http://127.0.0.1:8480", "certificate": "page.pem", "key": "key.pem"}, "certificate"),
        ({"endpoint": "https://h:1", "certificate": "gone.pem", "key": "key.pem"}, "there is no file"),
        ({"endpoint": "127.0.0.1:8480"}, "scheme, host and port"),
        ({"endpoint": "http://127.0.0.1"}, "scheme, host and port"),
        ({"endpoint": "http://127.0.0.1:99999"}, "scheme, host and port"),
        ({"endpoint": "http://127.0.0.1:1/page"}, "scheme, host and port"),
        ({"endpoint": "http://eva:secret@127.0.0.1:1"}, "scheme, host and port"),
        ({"port": 8480}, "port"),
        ({"public_url": "cells.plant.example"}, "as in https://cells.plant.example"),
        ({"public_url": "https://"}, "as in https://cells.plant.example"),
        ({"public_url": "https://eva:secret@cells.plant.example"}, "as in https://cells.plant.example"),
        ({"public_url": "https://cells.plant.example:0"}, "as in https://cells.plant.example"),
        ({"public_url": "https://cells.plant.example:99999"}, "as in https://cells.plant.example"),
        ({"public_url": "https://cells plant.example"}, "as in https://cells.plant.example"),
        ({"public_url": "https://zellen.wähl.example"}, "as in https://cells.plant.example"),
        ({"public_url": "https://*.plant.example"}, "as in https://cells.plant.example"),
        ({"public_url": "ftp://cells.plant.example"}, "as in https://cells.plant.example"),
        ({"public_url": "https://plant.example/cells"}, "no path"),
        ({"public_url": "https://plant.example/?a=1"}, "no path"),
        ({"public_url": "http://cells.plant.example"}, "in the clear"),
    ],
    ids=str,
)
def test_what_is_refused(tmp_path: Path, files: tuple[str, str], web: dict[str, str], said: str) -> None:
    with pytest.raises(SettingsError, match=said):
        read_cell(write_cell(tmp_path, 1, web=web))


def test_a_network_is_open_where_it_is_said(tmp_path: Path, files: tuple[str, str]) -> None:
    certificate, key = files
    for web in (
        {"endpoint": "https://0.0.0.0:8480", "certificate": certificate, "key": key},
        {"endpoint": "http://0.0.0.0:8480", "allow_without_encryption": True},
    ):
        page = read_cell(write_cell(tmp_path, 1, web=web)).settings.web
        assert page is not None
        assert page.endpoint == web["endpoint"]


@pytest.mark.parametrize(
    ("said", "public_url"),
    [
        ("https://cells.plant.example", "https://cells.plant.example"),
        ("HTTPS://Cells.Plant.example:443/", "https://cells.plant.example"),
        ("https://cells.plant.example:8443", "https://cells.plant.example:8443"),
        ("http://localhost:80", "http://localhost"),
        ("https://[FD00::1]:8443", "https://[fd00::1]:8443"),
    ],
)
def test_the_address_in_the_browser_is_as_browsers_write_it(
    tmp_path: Path, said: str, public_url: str
) -> None:
    page = read_cell(write_cell(tmp_path, 1, web={"public_url": said})).settings.web
    assert page is not None
    assert page.public_url == public_url


@pytest.mark.parametrize(
    ("web", "opcua", "said"),
    [
        ({"allow_without_encryption": True}, {}, "other web settings"),
        ({"public_url": "https://cells.plant.example"}, {}, "other web settings"),
        (
            {},
            {"users_file": "others.yaml", "endpoint": "opc.tcp://127.0.0.1:4841"},
            "another opcua.users_file",
        ),
    ],
)
def test_cells_of_one_page_agree(
    tmp_path: Path, web: dict[str, bool], opcua: dict[str, str], said: str
) -> None:
    page = {"endpoint": "http://127.0.0.1:8480"}
    one = write_cell(tmp_path, 1, "press-1", web=page)
    other = write_cell(tmp_path, 2, "press-2", web={**page, **web}, opcua=opcua)
    with pytest.raises(SettingsError, match=said):
        read_cells([one, other])
    assert len(read_cells([one, write_cell(tmp_path, 2, "press-2", web=page)])) == 2
