"""A lab's page in a browser: see, drag, press, share, export."""

import csv
import json
import re
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from playwright.sync_api import BrowserContext, Page, WebSocketRoute, expect

from labs.engine.catalog import find_lab
from tests.browser.conftest import OpenContext, screenshot
from tests.browser.lab_page import LabPage, wait_frames
from tests.server_process import ServerProcess


def test_the_robot_is_seen_and_moves(page: Page) -> None:
    lab = LabPage(page).open("joint-control")
    lab.next_message(when=lambda s: s["t"] > 5)  # the camera has seen all of the motion, and stands
    height, width, _ = lab.pixels("#robot").shape
    middle = (slice(height // 5, height), slice(width // 6, width * 2 // 3))
    moved, before = 0.0, lab.pixels("#robot")[middle]
    for _ in range(60):  # software rendering takes its time to draw the first meshes
        lab.next_message()  # half a second of the robot's time, at most
        now = lab.pixels("#robot")[middle]
        moved = float((np.abs(now - before).max(axis=2) > 40).mean())
        if 0.002 < moved < 0.1:
            break
        before = now
    assert now.std() > 10, "there is a robot, not an empty scene"
    assert 0.002 < moved < 0.1, "it moves, and nothing else does"
    screenshot(page, "lab")


def test_time_and_plots_run_and_pause(page: Page) -> None:
    lab = LabPage(page, scene=False).open("joint-control")
    plot = "#plots canvas >> nth=0"
    before, t = lab.pixels(plot), lab.time()
    expect(page.locator("#clock span")).not_to_have_text(f"{t:.2f}")
    lab.pixels_when(plot, lambda now: bool((now != before).any()))  # the curves grow
    described = expect(page.frame_locator("#robot").owner)
    described.to_have_accessible_description(re.compile(r"t = [\d.]+ s; RMS error: [\d.]+ rad"))
    page.keyboard.press("Space")
    expect(page.locator("#run")).to_have_text(re.compile("Run"))
    lab.next_message()
    wait_frames(page)
    still, t = lab.pixels(plot), lab.time()
    lab.next_message()
    lab.next_message()
    assert lab.time() == t
    assert (lab.pixels(plot) == still).all(), "the curves stand"
    page.keyboard.press(".")
    expect(page.locator("#clock span")).to_have_text(f"{t + 0.01:.2f}")


def test_the_panel_opens_in_full_screen_and_alone_and_tells_the_same(page: Page) -> None:
    lab = LabPage(page).open("joint-control")
    slider = lab.scene.get_by_role("slider").first
    expect(lab.scene.locator("canvas").first).to_be_visible()
    expect(slider).to_be_hidden()
    page.click("[data-do=full]")
    expect(slider).to_be_visible()
    lab.row("k_p").get_by_role("slider").press("End")
    expect(lab.value("kp")).to_have_value("2000")
    expect(page).to_have_url(re.compile(r"[?&]kp=2000\b"))
    assert lab.status()["params"]["kp"] == 2000
    expect(lab.scene.get_by_text("k_i = ")).to_be_hidden()
    lab.value("controller").select_option(label="PID")
    expect(lab.scene.get_by_text("k_i = 0 N·m/(rad·s)")).to_be_visible()
    expect(lab.scene.locator(".mantine-NumberInput-root").first).to_be_hidden()
    page.evaluate("document.exitFullscreen()")
    expect(slider).to_be_hidden()
    lab.value("kp").click()
    page.keyboard.type("12.5")
    page.keyboard.press("Enter")
    alone = page.context.new_page()
    alone.goto(next(frame.url for frame in page.frames if "/scene/" in frame.url))
    expect(alone.get_by_text("k_p = 12.5 N·m/rad")).to_be_visible()


def test_dragging_a_knob_changes_the_motion(page: Page) -> None:
    lab = LabPage(page, scene=False).open(
        "joint-control", "?controller=pid&kp=1000&reference=set-point"
    )
    track = page.locator("#track-kp")
    track.scroll_into_view_if_needed()
    box = track.bounding_box()
    assert box
    assert box["width"] >= 150
    y = box["y"] + box["height"] / 2
    # A logarithmic track through zero: 1000 of 2000 stands at log(1 + 0.5 * 999) / log(1000).
    page.mouse.move(box["x"] + 7 + 0.9 * (box["width"] - 14), y)
    page.mouse.down()
    for k in range(1, 9):
        page.mouse.move(box["x"] + 7 + (0.9 - 0.02 * k) * (box["width"] - 14), y)
        wait_frames(page)
    page.mouse.up()
    softened = lab.next_message(when=lambda s: 0 < s["params"]["kp"] < 400)
    # A softer spring sags more under the same weight: e = g / k_p.
    lab.next_message(when=lambda s: s["t"] > softened["t"] + 2.5)
    wait_frames(page)
    error = page.locator("#tiles").inner_text()
    found = re.search(r"Steady-state.*?\n([\d.]+)", error, re.DOTALL)
    assert found
    assert float(found[1]) > 0.05


@pytest.mark.parametrize(
    ("typed", "value"),
    [("2.5", 2.5), ("1e-3", 0.001), ("0,5", 0.5), ("-0", 0.0), ("1999.5", 1999.5)],
)
def test_a_number_is_taken_as_a_person_types_it(page: Page, typed: str, value: float) -> None:
    lab = LabPage(page, scene=False).open("joint-control")
    lab.value("kp").click()
    page.keyboard.type(typed)
    expect(lab.value("kp")).to_have_value(typed)
    page.keyboard.press("Enter")
    lab.next_message(when=lambda s: s["params"]["kp"] == value)


def test_a_track_goes_by_keyboard(page: Page) -> None:
    lab = LabPage(page, scene=False).open("joint-control")
    track = page.locator("#track-amplitude")
    for key, value in (("End", 0.8), ("Home", 0.0), ("ArrowUp", 0.01), ("PageUp", 0.11)):
        track.press(key)
        lab.next_message(when=lambda s, value=value: s["params"]["amplitude"] == value)  # type: ignore[misc]
    expect(track).to_have_attribute("aria-valuetext", "0.11 rad")
    track.dblclick()
    lab.next_message(when=lambda s: s["params"]["amplitude"] == 0.3)


def test_the_knobs_set_values_and_keep_wrong_ones(page: Page) -> None:
    lab = LabPage(page, scene=False).open("joint-control")
    lab.value("kp").fill("99999")
    lab.value("kp").press("Enter")
    wrong = page.locator("#param-kp .wrong")
    expect(wrong).to_contain_text("kp takes a number from 0 to 2000")
    expect(lab.value("kp")).to_have_value("99999")
    assert lab.status()["params"]["kp"] == 200
    lab.value("kp").fill("300")
    lab.value("kp").press("Enter")
    expect(page).to_have_url(re.compile("kp=300"))


def test_an_experiment_asks_sets_and_tells(page: Page) -> None:
    lab = LabPage(page, scene=False).open("joint-control")
    experiment = page.locator(".experiment").first
    expect(experiment).to_contain_text("?")
    experiment.get_by_role("button").first.click()
    expect(page).to_have_url(re.compile(r"\?.*controller="))
    shown = {name: values[0] for name, values in parse_qs(urlsplit(page.url).query).items()}
    params = lab.status()["params"]
    assert {name: str(params[name]) for name in shown} == shown, "the address tells the settings"
    expect(experiment.locator("details")).to_have_attribute("open", "")
    screenshot(page, "experiment")


def test_an_experiment_stays_the_current_one_however_late_its_settings_arrive(page: Page) -> None:
    held: list[str] = []

    def answer_before_it_is_done(socket: WebSocketRoute) -> None:
        server = socket.connect_to_server()

        def hold(text: str | bytes) -> None:
            if "apply" in str(text):
                held.append(str(text))
                socket.send(
                    json.dumps({"type": "answer", "error": "", "ref": json.loads(text)["ref"]})
                )
            else:
                server.send(text)

        socket.on_message(hold)
        page.on("console", lambda message: server.send(held.pop()))

    page.route_web_socket("**/stream", answer_before_it_is_done)
    lab = LabPage(page, scene=False).open("joint-control")
    page.locator(".experiment .try").first.click()
    current = page.locator(".experiment.current")
    expect(current).to_have_count(1)
    for _ in range(4):
        lab.next_message()  # still the old settings, for two seconds
    page.evaluate("console.log('now')")
    lab.next_message(
        when=lambda s: s["params"] != find_lab("joint-control").lab.Params().model_dump()
    )
    wait_frames(page)
    expect(current).to_have_count(1)
    lab.value("payload").fill("4")
    lab.value("payload").press("Enter")
    expect(current).to_have_count(0)


def test_a_shared_link_shows_the_same(
    page: Page, open_context: OpenContext, shared_server: ServerProcess
) -> None:
    lab = LabPage(page, scene=False).open("joint-control", "?seed=3")
    lab.value("kp").fill("420")
    lab.value("kp").press("Enter")
    expect(page).to_have_url(re.compile("kp=420"))
    second = LabPage(open_context(shared_server).new_page(), scene=False)
    second.page.goto(page.url)
    second.wait_live()
    expect(second.value("kp")).to_have_value("420")
    assert second.status()["params"] == lab.status()["params"]
    assert second.status()["seed"] == 3


def test_a_link_keeps_what_it_can_and_says_what_not(page: Page) -> None:
    lab = LabPage(page, scene=False).open("oscillator", "?gain=25&fbclid=x&omega=99999&seed=no")
    said = page.locator(".toast")
    expect(said).to_contain_text("fbclid is no parameter of this lab, and was left out")
    expect(said).to_contain_text(re.compile(r"omega = 99999 became \d+, the most it takes"))
    expect(said).to_contain_text("seed = no: it takes a whole number")
    params = lab.status()["params"]
    assert params["gain"] == 25.0
    page.wait_for_url(lambda url: "fbclid" not in url and "gain=25" in url)


def test_the_run_can_be_taken_home(page: Page, tmp_path: Path) -> None:
    lab = LabPage(page, scene=False).open("joint-control")
    lab.next_message(when=lambda s: s["t"] > 0.6)
    for form in ("csv", "json", "npz"):
        page.get_by_role("button", name="Export").click()
        with page.expect_download() as download:
            page.locator(f"[data-export={form}]").click()
        path = tmp_path / download.value.suggested_filename
        download.value.save_as(path)
        assert path.name.endswith(form)
        if form == "csv":
            lines = path.read_text().splitlines()
            assert lines[0].startswith("t,")
            assert len(list(csv.reader(lines))) > 40
        assert path.stat().st_size > 10_000


def test_the_command_that_reproduces_is_copied(page: Page, context: BrowserContext) -> None:
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    LabPage(page, scene=False).open("joint-control", "?kp=333")
    page.get_by_role("button", name="Export").click()
    page.locator("[data-do=command]").click()
    expect(page.locator("#toasts")).to_contain_text("Copied")
    text = page.evaluate("navigator.clipboard.readText()")
    assert text.startswith("orclab run joint-control")
    assert "kp=333" in text


def test_the_scene_is_loaded_once_whatever_begins_anew(page: Page) -> None:
    loaded: list[str] = []
    page.on("request", lambda r: loaded.append(r.url) if r.resource_type == "document" else None)
    lab = LabPage(page).open("joint-control")
    page.click("[data-do=reset]")
    lab.next_message(when=lambda s: s["run"] > 1)
    lab.next_message()
    expect(lab.scene.locator("canvas").first).to_be_visible()
    assert len([url for url in loaded if "/scene/" in url]) == 1


def test_a_scene_whose_load_is_broken_off_draws_all_the_same(page: Page) -> None:
    """As when its frame is sent elsewhere before all of it has come: here in mid-script."""
    page.add_init_script(
        """if (location.pathname.startsWith("/scene/")) {
          const Real = DecompressionStream; // the first that the viewer's script asks for
          DecompressionStream = function (form) { stop(); return new Real(form); };
        }"""
    )
    lab = LabPage(page)
    page.goto("/labs/joint-control")
    expect(lab.scene.locator("canvas").first).to_be_visible()


def test_everything_goes_by_keyboard(page: Page) -> None:
    lab = LabPage(page, scene=False).open("joint-control", "?kp=500")
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_be_hidden()
    expect(page.locator("#run")).to_have_attribute("aria-pressed", "true")
    page.locator("h1").click()
    page.keyboard.press("Space")
    expect(page.locator("#run")).to_have_text(re.compile("Run"))
    page.keyboard.press("r")
    expect(page.locator("#clock span")).to_have_text("0.00")
    page.keyboard.press("d")
    expect(lab.value("kp")).to_have_value("200")
    page.keyboard.press("1")
    expect(page).to_have_url(re.compile("controller="))
    expect(page.locator("#speed-value")).to_have_text("0.5×")  # as the experiment has it
    page.keyboard.press("+")
    expect(page.locator("#speed-value")).to_have_text("1×")


WILD = "?integrator=explicit-euler&step=0.01&kd=0&kp=2000&torque_limits=false"


def test_divergence_is_explained_and_reset_recovers(page: Page) -> None:
    lab = LabPage(page, scene=False).open("joint-control", WILD)
    banner = page.locator("#banner")
    expect(banner).to_be_visible()
    expect(banner).to_contain_text(re.compile(r"t = \d"))
    screenshot(page, "trouble")
    banner.get_by_role("button", name="Defaults").click()
    expect(banner).to_be_hidden()
    expect(lab.value("kp")).to_have_value("200")


def test_every_kind_of_plot_draws(page: Page) -> None:
    lab = LabPage(page, scene=False).open("oscillator")
    for title in ("Position", "Phase", "Waves"):
        lab.pin(title)
    field = lab.pin("Field")
    lab.wait_filled("#plots .plot:not([hidden])")
    field.locator("svg.chart").hover()
    expect(field.locator(".reading-box")).to_contain_text(re.compile(r"a \[rad\]: .*value: "))
    expect(lab.pin("Matrix").locator("table")).to_contain_text(re.compile(r"-?\d\.\d"))
    expect(lab.pin("Bars").locator(".mark")).to_have_count(2)
    note = lab.pin("Note").locator("p")
    expect(note).to_have_text([re.compile(r"on the (left|right)\.$"), "It swings."])
    screenshot(page, "plots")
    axis = """async () => {
      const { powerLabel } = await import("/static/js/plots/ticks.js");
      return [0.02, 1000, 2000, 1e-16, 5e-7, 2e4].map((value) => powerLabel(Math.log10(value)));
    }"""
    assert page.evaluate(axis) == ["0.02", "1000", "2000", "10⁻¹⁶", "5·10⁻⁷", "2·10⁴"]


def test_curves_are_named_and_can_be_hidden(page: Page) -> None:
    chart = LabPage(page, scene=False).open("oscillator").pin("Waves")
    entry = chart.get_by_role("button", name="square")
    expect(chart.locator("polyline")).to_have_count(2)
    entry.click()
    expect(entry).to_have_attribute("aria-pressed", "false")
    expect(chart.locator("polyline")).to_have_count(1)


def test_a_legend_names_what_can_be_there_and_what_has_no_curve_is_faint(page: Page) -> None:
    lab = LabPage(page, scene=False).open("lqr-tracking", "?robot=cart-pole")
    legend = lab.pin("Affine term over the preview").locator(".legend")
    expect(legend.locator("button")).to_have_text(["k, motor 1"])
    lab.open("dynamic-programming", "?map=S.%23G&gamma=1")
    legend = lab.pin("Cost-to-go of the start by the time to go").locator(".legend")
    expect(legend.locator("button")).to_have_count(3)
    expect(legend.locator("button.nothing")).to_have_text(["infinite horizon"])
    lab.open("function-approximation", "?world=walk")  # without a batch there are no least squares
    legend = lab.pin("Value error").locator(".legend")
    expect(legend.locator("button")).to_have_text(["mean of six", "best fit", "TD fixed point"])


def test_a_text_is_edited_and_a_wrong_one_stays_to_be_put_right(page: Page) -> None:
    lab = LabPage(page, scene=False).open("integration")
    field = lab.value("tableau")
    field.fill("0 |\n1/2 | 1/3\n| 0 1")
    field.blur()
    wrong = page.locator("#param-tableau .wrong")
    expect(wrong).to_contain_text("row 2: c = 0.5 but its a add up to 0.333333")
    expect(field).to_have_value("0 |\n1/2 | 1/3\n| 0 1")
    field.fill("0 |\n1/2 | 1/2\n| 0 1")
    field.blur()
    expect(wrong).to_be_hidden()
    expect(page).to_have_url(re.compile("tableau="))
    assert lab.status()["params"]["tableau"] == "0 |\n1/2 | 1/2\n| 0 1"
    page.reload()
    lab.wait_live()
    expect(field).to_have_value("0 |\n1/2 | 1/2\n| 0 1")


def test_a_shaded_matrix_shows_size_and_sign(page: Page) -> None:
    """Its entries are [x, 1; 1, -x]: one tone for both ones, two for x and -x."""
    LabPage(page, scene=False).open("oscillator").pin("Matrix")
    expect(page.locator("#plots table")).to_contain_text(re.compile(r"\d"))
    page.wait_for_function(
        """() => {
          const tones = [...document.querySelectorAll("#plots .shaded td")]
            .map((cell) => getComputedStyle(cell).backgroundColor);
          return tones.length === 4 && tones[1] === tones[2] && new Set(tones).size === 3;
        }"""
    )
