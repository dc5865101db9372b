"""Health and metrics as a scraper sees them."""

import json
import socket
import struct
import urllib.error
import urllib.request
from dataclasses import replace

import pytest
from prometheus_client.parser import text_string_to_metric_families

from impactcell.errors import SettingsError
from impactcell.service.monitoring import CellHealth, Monitoring

PRESS = CellHealth("press-1", True, 12, 3, 40, 0.5, 0.2, 0.19, 1, True)


def get(port: int, path: str) -> tuple[int, str]:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=5) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def test_metrics_name_the_cell_and_parse() -> None:
    with Monitoring("127.0.0.1", 0, lambda: [PRESS, replace(PRESS, cell="press-2", cycles=7)]) as http:
        status, text = get(http.port, "/metrics")
    assert status == 200
    samples = {
        (sample.name, sample.labels["cell"]): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }
    assert samples["impactcell_cycles_total", "press-1"] == 12
    assert samples["impactcell_cycles_total", "press-2"] == 7
    assert samples["impactcell_cycles_missed_total", "press-1"] == 3
    assert samples["impactcell_static_friction", "press-1"] == 0.2


@pytest.mark.parametrize("broken", [{"connected": False}, {"journal_ok": False}])
def test_one_sick_cell_makes_the_process_unhealthy(broken: dict[str, bool]) -> None:
    sick = replace(PRESS, cell="press-2", **broken)  # type: ignore[arg-type]
    with Monitoring("127.0.0.1", 0, lambda: [PRESS]) as http:
        assert get(http.port, "/healthz") == (200, json.dumps({"press-1": True}))
    with Monitoring("127.0.0.1", 0, lambda: [PRESS, sick]) as http:
        assert get(http.port, "/healthz") == (503, json.dumps({"press-1": True, "press-2": False}))
        assert get(http.port, "/")[0] == 404


def test_a_port_in_use_is_said() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(SettingsError, match="choose another"),
    ):
        Monitoring("127.0.0.1", taken.getsockname()[1], list).__enter__()


def test_a_scraper_that_goes_away_is_no_news(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impactcell.service.monitoring.PATIENCE_S", 0.05)
    with Monitoring("127.0.0.1", 0, lambda: [PRESS]) as http:
        for sent in (b"", b"GET /met", b"GET /metrics HTTP/1.0\r\n\r\n", b"GET / HTTP/1.0\r\n\r\n") * 5:
            with socket.create_connection(("127.0.0.1", http.port)) as scraper:
                scraper.sendall(sent)
                scraper.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        with socket.create_connection(("127.0.0.1", http.port), timeout=5) as silent:
            assert silent.recv(1) == b""
        assert get(http.port, "/healthz")[0] == 200
    assert capfd.readouterr() == ("", "")
