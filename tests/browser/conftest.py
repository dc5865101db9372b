"""A browser for each test: one program, in which nothing is left of the test before."""

from collections.abc import Iterator

import pytest

from tests.browser.chromium import Browser, chromium, need_chromium


@pytest.fixture(scope="session")
def started_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    need_chromium()
    with chromium(tmp_path_factory.mktemp("profile")) as started:
        yield started


@pytest.fixture
def browser(started_browser: Browser) -> Browser:
    started_browser.forget()
    return started_browser
