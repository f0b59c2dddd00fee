"""What the page says and does when something breaks."""

import os
import re
import signal

from playwright.sync_api import Page, expect

from tests.browser.conftest import OpenContext, screenshot
from tests.browser.lab_page import LabPage
from tests.server_process import ServerProcess, wait_until


def test_a_killed_worker_comes_back_with_the_same_parameters(
    page: Page, shared_server: ServerProcess
) -> None:
    wait_until(lambda: shared_server.health()["workers"] == shared_server.health()["spares"] == 1)
    (worker,) = shared_server.listeners()
    lab = LabPage(page).open("joint-control", "?kp=640&controller=pid")
    expect(lab.scene.locator("canvas").first).to_be_visible()
    os.kill(worker, signal.SIGKILL)
    expect(page.locator("body")).to_contain_text("SIGKILL")
    lab.wait_live()
    expect(lab.value("kp")).to_have_value("640")
    t = lab.time()
    expect(page.locator("#clock span")).not_to_have_text(f"{t:.2f}")
    # The scene has come back as well, and its sliders work.
    row = lab.row("k_p")
    expect(row).to_contain_text("k_p = 640 N·m/rad")
    row.get_by_role("slider").press("End")
    expect(lab.value("kp")).to_have_value("2000")


def test_a_restarted_server_is_found_again(
    open_context: OpenContext, single_place_server: ServerProcess
) -> None:
    lab = LabPage(open_context(single_place_server).new_page(), scene=False).open(
        "joint-control", "?kp=512"
    )
    old = lab.status()["id"]
    single_place_server.stop()
    expect(lab.page.locator("body")).to_contain_text(re.compile("lost|does not answer"))
    screenshot(lab.page, "lost")
    single_place_server.start()
    lab.wait_live()
    expect(lab.page.locator("body")).to_contain_text("your parameters")
    expect(lab.value("kp")).to_have_value("512")
    assert lab.status()["id"] != old


def test_a_full_house_says_so_and_lets_in_when_there_is_room(
    open_context: OpenContext, single_place_server: ServerProcess
) -> None:
    page = open_context(single_place_server).new_page()
    lab = LabPage(page, scene=False)
    with single_place_server.session("oscillator"):
        page.goto("/labs/joint-control")
        expect(page.locator("body")).to_contain_text("all 1 places are taken")
        screenshot(page, "full")
    page.locator("#banner button").first.click()
    lab.wait_live()


def test_an_idle_session_rests_until_it_is_wanted(
    open_context: OpenContext, short_timeout_server: ServerProcess
) -> None:
    page = open_context(short_timeout_server).new_page()
    page.clock.install()
    lab = LabPage(page, scene=False).open("joint-control", "?kp=512")
    expect(page.locator("#banner")).to_contain_text("same parameters")
    wait_until(lambda: short_timeout_server.health()["sessions"] == 0)
    page.clock.run_for(30_000)  # longer than any timer of the page
    assert short_timeout_server.health()["sessions"] == 0, "it rests"
    page.locator("#banner button").first.click()
    lab.wait_live()
    expect(lab.value("kp")).to_have_value("512")


def test_a_closed_page_frees_its_place(page: Page, shared_server: ServerProcess) -> None:
    wait_until(lambda: shared_server.health()["sessions"] == 0)
    LabPage(page, scene=False).open("joint-control")
    assert shared_server.health()["sessions"] == 1
    page.goto("about:blank")
    wait_until(lambda: shared_server.health()["sessions"] == 0)
