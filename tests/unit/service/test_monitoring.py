"""Health and metrics as a scraper sees them."""

import contextlib
import json
import re
import socket
import struct
import threading
import urllib.error
import urllib.request
from dataclasses import replace
from http.client import HTTPConnection

import pytest
from prometheus_client.parser import text_string_to_metric_families

from impactcell.errors import SettingsError
from impactcell.process.shipped import ROOT
from impactcell.service import monitoring
from impactcell.service.monitoring import CellHealth, Monitoring
from tests.patience import PATIENCE_S

PRESS = CellHealth("press-1", 12, 3, 40, 5e-4, 0.2, 0.19, {"WearLimit": True, "ModelGap": False})

METRIC = re.compile(r"impactcell_\w+")


def get(port: int, path: str) -> tuple[int, str]:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=PATIENCE_S) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def test_metrics_name_the_cell_and_parse() -> None:
    with Monitoring("127.0.0.1", 0, lambda: [PRESS, replace(PRESS, cell="press-2", cycles=7)]) as http:
        status, text = get(http.port, "/metrics")
    assert status == 200
    samples = {
        (sample.name, *(sample.labels[n] for n in ("cell", "alarm") if n in sample.labels)): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }
    assert samples["impactcell_cycles_total", "press-1"] == 12
    assert samples["impactcell_cycles_total", "press-2"] == 7
    assert samples["impactcell_cycles_missed_total", "press-1"] == 3
    assert samples["impactcell_static_friction", "press-1"] == 0.2
    assert samples["impactcell_round_trip_seconds", "press-1"] == 5e-4
    assert samples["impactcell_alarm_active", "press-1", "WearLimit"] == 1
    assert samples["impactcell_alarm_active", "press-2", "ModelGap"] == 0


def test_the_dashboard_asks_for_metrics_that_there_are() -> None:
    with Monitoring("127.0.0.1", 0, lambda: [PRESS]) as http:
        families = {f.name for f in text_string_to_metric_families(get(http.port, "/metrics")[1])}
    dashboard = json.loads((ROOT / "docs" / "grafana" / "impactcell.json").read_text())
    asked = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
    names = {name.removesuffix("_total") for expression in asked for name in METRIC.findall(expression)}
    assert names == families


@pytest.mark.parametrize("broken", [{"link_fault": "refused"}, {"journal_fault": "disk full"}])
def test_one_sick_cell_makes_the_process_unhealthy_and_says_why(broken: dict[str, str]) -> None:
    sick = replace(PRESS, cell="press-2", **broken)  # type: ignore[arg-type]
    well = {"press-1": {"healthy": True, "reason": ""}}
    ill = {"press-2": {"healthy": False, "reason": next(iter(broken.values()))}}
    with Monitoring("127.0.0.1", 0, lambda: [PRESS]) as http:
        assert get(http.port, "/healthz") == (200, json.dumps(well))
    with Monitoring("127.0.0.1", 0, lambda: [PRESS, sick]) as http:
        assert get(http.port, "/healthz") == (503, json.dumps(well | ill))
        assert get(http.port, "/")[0] == 404


@pytest.mark.parametrize("way", ["{}", "{}/", "{}?", "{}?x=1", "{}/?name[]=impactcell_connected"])
def test_a_page_is_where_its_path_says_whatever_comes_behind(way: str) -> None:
    with Monitoring("127.0.0.1", 0, lambda: [PRESS]) as http:
        for page in ("/healthz", "/metrics"):
            assert get(http.port, way.format(page)) == get(http.port, page)
        for elsewhere in ("/health", "/metrics/press-1", "/?/healthz"):
            assert get(http.port, elsewhere)[0] == 404


@pytest.mark.parametrize("page", ["/healthz", "/metrics", "/nothing"])
def test_a_head_is_that_of_the_page_without_its_body(page: str) -> None:
    sick = replace(PRESS, link_fault="refused")
    with Monitoring("127.0.0.1", 0, lambda: [sick]) as http:
        answers = []
        for method in ("GET", "HEAD"):
            connection = HTTPConnection("127.0.0.1", http.port, timeout=PATIENCE_S)
            connection.request(method, page)
            answer = connection.getresponse()
            headers = {name: value for name, value in answer.getheaders() if name != "Date"}
            answers.append((answer.status, headers, answer.read()))
            connection.close()
    (status, headers, body), head = answers
    assert status == {"/healthz": 503, "/metrics": 200, "/nothing": 404}[page]
    assert body
    assert head == (status, headers, b"")


def test_an_address_may_be_of_version_6() -> None:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("this machine has no IPv6")
    with Monitoring("::1", 0, lambda: [PRESS]) as http:
        connection = HTTPConnection("::1", http.port, timeout=PATIENCE_S)
        connection.request("GET", "/healthz")
        assert connection.getresponse().status == 200
        connection.close()
        with pytest.raises(SettingsError, match=rf"cannot listen on \[::1\]:{http.port} "):
            Monitoring("::1", http.port, list).__enter__()


def test_a_port_in_use_is_said() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(
            SettingsError, match=r"choose another `monitoring.host` or `monitoring.port`, or end what uses it"
        ),
    ):
        Monitoring("127.0.0.1", taken.getsockname()[1], list).__enter__()


def test_who_sends_a_byte_each_second_has_his_time_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[float] = []
    connected = threading.Event()
    with Monitoring("127.0.0.1", 0, lambda: [PRESS]) as http, socket.socket() as client:

        def a_second_later() -> float:
            connected.wait(PATIENCE_S)
            looks.append(float(len(looks)))
            client.send(b"G")
            return looks[-1]

        monkeypatch.setattr(monitoring, "monotonic", a_second_later)
        client.settimeout(PATIENCE_S)
        client.connect(("127.0.0.1", http.port))
        connected.set()
        with contextlib.suppress(ConnectionError):  # what it has sent last is never read
            assert client.recv(1) == b""
        assert looks[-1] == monitoring.PATIENCE_S


def test_there_are_so_many_scrapers_at_a_time_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(monitoring, "MAX_SCRAPERS", 2)
    monkeypatch.setattr(monitoring, "PATIENCE_S", PATIENCE_S)
    with Monitoring("127.0.0.1", 0, lambda: [PRESS]) as http:
        address = "127.0.0.1", http.port
        held = [socket.create_connection(address, timeout=PATIENCE_S) for _ in range(2)]
        with socket.create_connection(address, timeout=PATIENCE_S) as one_more:
            assert one_more.recv(1) == b""
        for each in held:
            each.sendall(b"GET /healthz HTTP/1.0\r\n\r\n")
            with each, each.makefile("rb") as answer:
                assert answer.readline() == b"HTTP/1.0 200 OK\r\n"
        status = 0
        while not status:  # the threads end in their own time
            with contextlib.suppress(OSError):
                status, _ = get(http.port, "/healthz")
        assert status == 200


@pytest.mark.slow
def test_a_scraper_that_goes_away_is_no_news(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impactcell.service.monitoring.PATIENCE_S", 0.05)
    with Monitoring("127.0.0.1", 0, lambda: [PRESS]) as http:
        for sent in (b"", b"GET /met", b"GET /metrics HTTP/1.0\r\n\r\n", b"GET / HTTP/1.0\r\n\r\n") * 5:
            with socket.create_connection(("127.0.0.1", http.port)) as scraper:
                scraper.sendall(sent)
                scraper.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        with socket.create_connection(("127.0.0.1", http.port), timeout=PATIENCE_S) as silent:
            assert silent.recv(1) == b""
        status = 0
        while not status:  # with so little patience it may give up this client, too
            with contextlib.suppress(OSError):
                status, _ = get(http.port, "/healthz")
        assert status == 200
    assert capfd.readouterr() == ("", "")
