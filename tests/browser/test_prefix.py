"""The pages behind a proxy that shows them under a path."""

import json
import re

from playwright.sync_api import expect

from tests.browser.conftest import OpenContext
from tests.browser.lab_page import LabPage
from tests.path_proxy import PathProxy
from tests.server_process import ServerProcess


def test_everything_works_under_a_path(
    open_context: OpenContext, shared_server: ServerProcess
) -> None:
    """From the home page to a live lab with its scene, and an export."""
    proxy = PathProxy("/user/student/proxy/8301", shared_server.address)
    with proxy.running() as address:
        page = open_context(shared_server).new_page()
        complaints: list[str] = []
        page.on("console", lambda message: complaints.append(message.text))
        page.goto(f"{address}/")
        page.locator('.card[href$="labs/board"]').click()
        expect(page).to_have_url(f"{address}/labs/board")
        lab = LabPage(page)
        lab.wait_live()
        expect(lab.scene.locator("canvas").first).to_be_visible()
        with page.expect_download() as download:
            page.get_by_role("button", name="Export").click()
            page.locator("[data-export=json]").click()
        assert json.loads(download.value.path().read_bytes())["lab"] == "board"
        page.get_by_role("link", name="orclab").click()
        expect(page).to_have_url(re.compile(re.escape(address) + "/$"))
        page.goto(f"{address}/labs/none")
        expect(page.locator(".card").first).to_be_visible()
        page.goto(f"{address}/docs")
        expect(page.locator("#docs")).to_contain_text("/api/labs")
        page.goto("about:blank")  # ends its session while the proxy runs
    assert not proxy.stray
    assert not [text for text in complaints if "Content Security Policy" in text]
