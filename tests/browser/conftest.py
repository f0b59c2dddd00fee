"""Chromium, driven by Playwright. Skipped only where no browser is installed, and never in CI."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from tests import chromium as chromium_browser
from tests.server_process import TIMEOUT, ServerProcess

SCREENSHOTS = Path("screenshots")
SLOW_SCENES = """if (location.pathname.startsWith("/scene/")) {
  const next = requestAnimationFrame;
  window.requestAnimationFrame = (draw) => setTimeout(() => next(draw), 100);
  window.cancelAnimationFrame = clearTimeout;
}"""
"""Some 9 frames a second: drawn in software at full speed, a scene takes a core and more."""
OpenContext = Callable[..., BrowserContext]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "tests/browser" in str(item.path):
            item.add_marker(pytest.mark.browser)


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    path = chromium_browser.find_browser()
    if path is None:
        if os.environ.get("CI"):
            pytest.fail("CI must have a browser: install Debian's chromium")
        pytest.skip("no chromium is installed")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=chromium_browser.ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def open_context(chromium: Browser) -> Iterator[OpenContext]:
    """Makes browser contexts whose pages must not complain: any script error, in a scene too,
    fails the test. All are closed at the end, whatever happened."""
    opened: list[BrowserContext] = []
    errors: list[str] = []

    def make(server: ServerProcess, **options: Any) -> BrowserContext:
        options = {"viewport": {"width": 1280, "height": 800}} | options
        context = chromium.new_context(base_url=server.address, **options)
        context.set_default_timeout(1000 * TIMEOUT)
        context.add_init_script(SLOW_SCENES)
        context.on("weberror", lambda error: errors.append(str(error.error)))
        opened.append(context)
        return context

    expect.set_options(timeout=1000 * TIMEOUT)
    yield make
    for context in opened:
        for page in context.pages:
            page.goto(
                "about:blank"
            )  # a page that leaves ends its session; one that is shot does not
        context.close()
    assert not errors


@pytest.fixture
def context(open_context: OpenContext, shared_server: ServerProcess) -> BrowserContext:
    return open_context(shared_server, accept_downloads=True)


@pytest.fixture
def page(context: BrowserContext) -> Page:
    return context.new_page()


def screenshot(page: Page, name: str) -> None:
    """Kept in screenshots/ for people to look at; nobody looks in CI."""
    if not os.environ.get("CI"):
        SCREENSHOTS.mkdir(exist_ok=True)
        page.screenshot(path=SCREENSHOTS / f"{name}.png")
