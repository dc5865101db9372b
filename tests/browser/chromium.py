"""Debian's Chromium, driven by its own driver: nothing is downloaded, and it asks nobody outside."""

import contextlib
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from selenium import webdriver
from selenium.common.exceptions import (
    ElementNotInteractableException,
    StaleElementReferenceException,
    TimeoutException,
    WebDriverException,
)
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

from tests.patience import PATIENCE_S

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
DESK, PHONE, WALL = (1280, 900), (375, 812), (3840, 2160)
"""Widths and heights in pixels."""


def need_chromium() -> None:
    """Skip where there is no Chromium; in CI there has to be one."""
    if CHROMIUM is None or DRIVER is None:
        if os.environ.get("IMPACTCELL_CI"):
            pytest.fail("CI installs chromium and chromium-driver; one of them is missing")
        pytest.skip("chromium or chromedriver is not installed")


@contextlib.contextmanager
def chromium(profile: Path) -> Iterator["Browser"]:
    """Start a browser with an empty profile."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for flag in (
        *("headless", "no-sandbox", "disable-gpu", "no-first-run", "disable-background-networking"),
        *("disable-component-update", "disable-sync", "disable-dev-shm-usage", "hide-scrollbars"),
        f"user-data-dir={profile}",
    ):
        options.add_argument(f"--{flag}")
    options.add_experimental_option("browserStartupTimeout", int(1e3 * PATIENCE_S))
    options.timeouts = {name: int(1e3 * PATIENCE_S) for name in ("script", "pageLoad")}
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(str(DRIVER)))
    try:
        yield Browser(driver)
    finally:
        driver.quit()


class Browser:
    """A browser as a person uses it: by what is to be read, and by what can be pressed."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def forget(self) -> None:
        """Leave the page, and nothing of what was seen before: as a new browser with an empty profile."""
        self.driver.switch_to.default_content()
        # A page in a sandbox has no origin, and so nothing of its own to forget.
        self.run("if (self.origin !== 'null') { localStorage.clear(); sessionStorage.clear(); }")
        self.open("about:blank")
        for command in (
            *("Network.clearBrowserCookies", "Network.clearBrowserCache"),
            "Emulation.clearDeviceMetricsOverride",
        ):
            self.driver.execute_cdp_cmd(command, {})
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
        self.faults()
        self.traffic()

    def open(self, address: str) -> None:
        self.driver.get(address)

    def find(self, css: str, patience_s: float = PATIENCE_S) -> Any:
        """Wait for an element that is shown."""
        shown = lambda: next((e for e in self.all(css) if e.is_displayed()), None)  # noqa: E731
        return self.until(shown, css, patience_s)

    def write(self, css: str, text: str) -> None:
        """Write into a field; on a page that is just being renewed, into the one that takes its place."""

        def written() -> bool:
            field = self.find(css)
            field.clear()
            field.send_keys(text)
            return True

        self.until(written, css)

    def all(self, css: str) -> list[Any]:
        return self.driver.find_elements(By.CSS_SELECTOR, css)

    def until(self, condition: Any, what: str = "", patience_s: float = PATIENCE_S) -> Any:
        """Wait until a condition gives something."""
        # A page that gives way to the next one, or renews a part of itself.
        changing = (StaleElementReferenceException, ElementNotInteractableException)
        wait = WebDriverWait(self.driver, patience_s, poll_frequency=0.05, ignored_exceptions=changing)
        try:
            return wait.until(lambda _: condition())
        except TimeoutException:
            pytest.fail(f"{what} is not at {self.driver.current_url}: {self.text}")

    @property
    def text(self) -> str:
        return str(self.driver.find_element(By.TAG_NAME, "body").text)

    def text_within(self, css: str) -> str:
        """Text of a frame; empty while its document, which comes from a process of its own, is exchanged."""
        self.driver.switch_to.frame(self.find(css))
        try:
            return self.text
        except WebDriverException as error:
            if "frame detached" not in str(error):
                raise
            return ""
        finally:
            self.driver.switch_to.default_content()

    @property
    def path(self) -> str:
        return urlsplit(self.driver.current_url).path

    def log_in(self, user: str, password: str) -> None:
        """Fill in the login and send it."""
        for name, value in (("user", user), ("password", password)):
            field = self.find(f"input[name={name}]")
            field.clear()
            field.send_keys(value)
        self.find("form.login button").click()

    def run(self, script: str, *arguments: Any) -> Any:
        return self.driver.execute_script(script, *arguments)

    def show_as(self, theme: str, size: tuple[int, int]) -> None:
        """Choose colours and the size of the window."""
        self._set_size(*size)
        self.driver.execute_cdp_cmd(
            "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": theme}]}
        )

    def _set_size(self, width: int, height: int) -> None:
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500},
        )
        self.driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")

    def screenshot(self, file: Path, *, whole: bool = True) -> None:
        """Take a picture, of the whole page or of the window."""
        import base64

        height = self.run("return document.documentElement.scrollHeight")
        width, shown = self.run("return [innerWidth, innerHeight]")
        parameters: dict[str, Any] = {"format": "png"}
        if whole:  # what lies outside the window is not drawn: make it large enough
            self._set_size(width, max(height, shown))
        data = self.driver.execute_cdp_cmd("Page.captureScreenshot", parameters)["data"]
        file.write_bytes(base64.b64decode(data))
        if whole:
            self._set_size(width, shown)

    def faults(self) -> list[str]:
        """Read what the browser complained of since it was asked last."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def traffic(self) -> tuple[set[str], int]:
        """Read the hosts that were asked, and the bytes that came, since it was asked last."""
        hosts, length = set(), 0
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                url = urlsplit(message["params"]["request"]["url"])
                if url.scheme in ("http", "https", "ws", "wss", "ftp"):
                    hosts.add(url.netloc)
            elif message["method"] == "Network.loadingFinished":
                length += int(message["params"]["encodedDataLength"])
        return hosts, length
