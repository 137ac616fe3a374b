"""Figures that move, in a browser: what the script draws is what the library computes."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from acx4book.chapters import design, error_budget
from acx4book.chapters.design import papers
from acx4book.chapters.mounting import figures, held
from acx4book.chapters.synthetic_image import turned_head
from acx4book.foundations import explorers
from acx4book.notebooks import simulated
from acx4book.typesetting import moving
from acx4book.typesetting.moving import Layer, Scene
from acx4lib.calibration.estimates import from_bundle
from acx4lib.calibration.mounting import Mounting, single_step, two_step_gnss
from acx4lib.georeferencing.budget import like
from support.helpers import ROOT, repeats
from support.pictures import known, taken


def calibrated():
    """Return a single-step calibration, and the mapping flight where the sliders begin."""
    flight = simulated.fly_and_read("acx4-ideal", 1, blocks=("calibration", "validation")).flight
    single = single_step(flight.calibration, free=flight.estimate_mounting)
    mapping = like(flight.block("validation"), single.calibration.cameras[0])
    return single.calibration, replace(mapping, height_m=1300.0)


def held_lever_arm():
    flight = simulated.fly_and_read("acx4-ideal", 1, blocks=("calibration",)).flight
    block, free = flight.calibration, flight.estimate_mounting
    single = single_step(block, free=free)
    two = two_step_gnss(block, free=free, after=single)
    return held.view(block, two, single, free=free)


def turned():
    orientation, synthetic = taken.heads(1), taken.synthetic(1)
    ties, _ = known.tied(orientation, (0, 1), 40)
    refinement = known.refined(orientation, ties)
    return turned_head.view(refinement, synthetic, head=1)


EXPLORERS = {
    "boresight": explorers.boresight_explorer,
    "distortion": explorers.distortion_explorer,
    "two_heights": explorers.two_heights_explorer,
    "error_budget": lambda: error_budget.explorer(*calibrated()),
    "held_lever_arm": held_lever_arm,
    "turned_head": turned,
    "design": lambda: design.explorer(papers(gnss=("shift",))),
}
SCRIPT = ROOT / "book" / "_moving" / "explorer.js"
MOVE = """([figure, values]) => {
    const sliders = [...document.querySelectorAll(`#${figure} input[type=range]`)];
    sliders.forEach((slider, i) => { slider.value = values[i]; });
    sliders[0].dispatchEvent(new Event("input"));
    return {
        values: sliders.map((slider) => slider.valueAsNumber),
        paths: [...document.querySelectorAll(`#${figure} .marks`)].map(
            (marks) => [...marks.children].map((path) => path.getAttribute("d"))),
        cells: [...document.querySelectorAll(`#${figure} tbody tr`)].map(
            (row) => [...row.querySelectorAll("td")].map((cell) => cell.textContent)),
        said: sliders.map((slider) => slider.getAttribute("aria-valuetext")),
    };
}"""


@pytest.fixture(scope="module", params=EXPLORERS)
def explorer(request):
    return EXPLORERS[request.param]()


@pytest.fixture
def opened(browser, tmp_path):
    """Open a page with an explorer alone; afterwards the browser has not complained."""
    pages, complaints = [], []

    def opened(explorer):
        path, script = tmp_path / "page.html", f'<script src="{SCRIPT.as_uri()}"></script>'
        text = f"<!doctype html><meta charset=utf-8>{explorer.html}{script}"
        path.write_text(text, encoding="utf-8")
        page = browser.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: complaints.append(message.text))
        page.goto(path.as_uri())
        pages.append(page)
        return page

    yield opened
    for page in pages:
        page.close()
    assert complaints == []


def settings(explorer):
    """Return values of the sliders: at each end, at a stop between, and all presets."""
    yield from explorer.presets.values()
    for k, slider in enumerate(explorer.sliders):
        stops = slider.stops
        for stop in (stops[0], stops[len(stops) // 3], stops[-1]):
            yield [*explorer.start[:k], float(stop), *explorer.start[k + 1 :]]
    yield [slider.high for slider in explorer.sliders]


def numbers(d):
    return np.array(re.findall(r"-?\d+(?:\.\d+)?", d), dtype=float)


def read(text):
    return float(text.replace("\N{MINUS SIGN}", "-"))


def test_at_the_stops_it_draws_and_says_what_the_library_computes(opened, explorer):
    page = opened(explorer)
    for values in settings(explorer):
        seen = page.evaluate(MOVE, [explorer.name, [float(v) for v in values]])
        assert seen["values"] == pytest.approx(values, abs=1e-9)
        for panel, paths in zip(explorer.panels, seen["paths"], strict=True):
            for mark, d in zip(panel.marks, paths, strict=True):
                expected = numbers(moving.path(mark, values))
                assert numbers(d) == pytest.approx(expected, abs=0.02, rel=1e-4)
        for said, expected in zip(seen["cells"], explorer.readings(values), strict=True):
            for cell, number, column in zip(said, expected, explorer.columns, strict=False):
                assert read(cell) == pytest.approx(read(number), abs=1.01 * 10.0**-column.digits)
        for said, slider, value in zip(seen["said"], explorer.sliders, values, strict=True):
            assert said.endswith(slider.after)
            number = read(said.removesuffix(slider.after))
            assert number == pytest.approx(value, abs=0.51 * 10.0**-slider.digits)


def test_the_ground_that_is_drawn_is_that_of_the_mounting(opened):
    """Arrows' ends in metres, against eq. (14) with the wrong mounting, which is not linear."""
    explorer, values = explorers.boresight_explorer(), [0.07, -0.05, 0.1, 0.3, -0.8, 0.5]
    seen = opened(explorer).evaluate(MOVE, [explorer.name, values])
    for (azimuth, _), panel, (d,) in zip(
        explorers.STRIPS.values(), explorer.panels, seen["paths"], strict=True
    ):
        ends = numbers(d).reshape(-1, 10)  # of the stroke, and three points of the head
        wrong, right = (
            explorers.on_ground(azimuth, explorers.HEIGHT_M, explorers.POINTS_MM, mounting)
            for mounting in (np.array(values), np.zeros(6))
        )
        drawn = (ends[:, 2:4] - ends[:, :2]) / panel.marks[0].scale
        assert drawn == pytest.approx(wrong - right, abs=0.004)


@pytest.mark.parametrize(
    "explorer",
    [name if name in ("boresight", "design") else repeats(name) for name in EXPLORERS],
    indirect=True,
)
def test_it_is_moved_by_the_keyboard_and_by_buttons(opened, explorer):
    page = opened(explorer)
    slider, first = explorer.sliders[0], page.locator("input").first
    assert page.get_by_label(slider.name, exact=True).count() == 1
    start = page.locator(".marks path").first.get_attribute("d")
    first.focus()
    page.keyboard.press("End")
    assert first.evaluate("slider => slider.valueAsNumber") == pytest.approx(slider.high)
    page.keyboard.press("ArrowLeft")
    stop = first.evaluate("slider => slider.valueAsNumber")
    assert stop == pytest.approx(slider.high - slider.step)
    assert page.locator(".marks path").first.get_attribute("d") != start
    page.locator("button").first.click()
    assert first.evaluate("slider => slider.valueAsNumber") == pytest.approx(explorer.start[0])
    drawn = numbers(page.locator(".marks path").first.get_attribute("d"))
    assert drawn == pytest.approx(numbers(start), abs=0.02)


def test_every_explorer_is_on_a_page(chapters):
    with_one = [name for name, page in chapters.items() if page.select("figure.acx4-explorer")]
    assert len(with_one) >= len(EXPLORERS)


# --- the block in space in a browser: drawn, turned and brought nearer, its parts switched -----


SPACE = ROOT / "book" / "_moving" / "block.js"
STYLES = [ROOT / "book" / name for name in ("_static/acx4.css", "_moving/moving.css")]


@pytest.fixture
def figure(request):
    """The block; or what another fixture makes, of the name that a test gives."""
    return request.getfixturevalue(getattr(request, "param", "block"))


@pytest.fixture
def block(mounted):
    single = Mounting(method="single_step", calibration=from_bundle(mounted), bundle=mounted)
    return figures.view(single).html


@pytest.fixture
def page(browser, figure, tmp_path):
    """A page with the block, and nothing that the browser complains of."""
    path, complaints = tmp_path / "page.html", []
    style = "".join(f'<link rel="stylesheet" href="{sheet.as_uri()}">' for sheet in STYLES)
    script = f'<script src="{SPACE.as_uri()}" defer></script>'
    path.write_text(f"<!doctype html><meta charset=utf-8>{style}{script}{figure}", "utf-8")
    opened = browser.new_page(viewport={"width": 700, "height": 700})
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on(
        "console", lambda said: complaints.append(said.text) if said.type == "error" else None
    )
    opened.goto(path.as_uri())
    opened.wait_for_selector("canvas")
    yield opened
    opened.close()
    assert complaints == []


def seen(page):
    """Return what the canvas shows, shape (rows, cols, 3)."""
    return np.asarray(Image.open(io.BytesIO(page.locator("canvas").screenshot())).convert("RGB"))


def changed(before, after):
    """Return the share of pixels that differ."""
    return np.mean(np.any(before != after, axis=2))


def test_it_is_drawn_in_the_colours_of_its_layers(page):
    colours = {tuple(colour) for colour in seen(page).reshape(-1, 3)}
    assert {(0x1D, 0x9A, 0x78), (0x1F, 0x29, 0x33)} <= colours  # tie points and control points
    assert page.locator(".view span:visible").count() > 0


def test_it_is_turned_by_the_keyboard_and_comes_back(page):
    start = seen(page)
    page.locator("canvas").focus()
    for key in ("ArrowLeft", "ArrowUp", "+"):
        before = seen(page)
        page.keyboard.press(key)
        assert changed(before, seen(page)) > 0.01, key
    page.get_by_role("button", name="as at the start").click()
    page.locator("canvas").focus()
    assert changed(start, seen(page)) < 0.001


def test_it_is_turned_by_buttons(page):
    start = after = seen(page)
    for name in ("turn left", "higher", "nearer", "turn right", "lower", "farther"):
        before = after
        page.get_by_role("button", name=name).click()
        after = seen(page)
        assert changed(before, after) > 0.01, name
    assert changed(start, after) < 0.001  # each undoes another


def test_it_is_turned_by_the_mouse(page):
    start, box = seen(page), page.locator("canvas").bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 220, box["y"] + 130, steps=3)
    page.mouse.up()
    assert changed(start, seen(page)) > 0.01


def test_the_wheel_brings_it_nearer_where_it_has_the_focus_and_scrolls_the_page_elsewhere(page):
    start, box = seen(page), page.locator("canvas").bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.wheel(0, -200)
    assert changed(start, seen(page)) == 0
    page.locator("canvas").focus()
    before = seen(page)
    page.mouse.wheel(0, -200)
    page.evaluate("new Promise(requestAnimationFrame)")
    assert changed(before, seen(page)) > 0.01


TOUCHED = """([kind, id, x, y]) => document.querySelector("canvas").dispatchEvent(
    new PointerEvent(kind, {pointerId: id, clientX: x, clientY: y, pointerType: "touch"}))"""


def test_two_fingers_bring_it_nearer_and_one_turns_it(page):
    page.evaluate("Element.prototype.setPointerCapture = () => {}")  # no finger is there
    start = seen(page)
    for event in (("down", 1, 100, 200), ("down", 2, 200, 200), ("move", 2, 300, 200)):
        page.evaluate(TOUCHED, [f"pointer{event[0]}", *event[1:]])
    spread = seen(page)
    assert changed(start, spread) > 0.01
    page.evaluate(TOUCHED, ["pointermove", 2, 200, 200])
    assert changed(start, seen(page)) < 0.001
    page.evaluate(TOUCHED, ["pointerup", 2, 200, 200])
    page.evaluate(TOUCHED, ["pointermove", 1, 180, 200])
    assert changed(start, seen(page)) > 0.01


def test_every_layer_is_switched_off_and_on(page):
    start = seen(page)
    for box in page.locator(".layers input").all():
        box.click()
        assert changed(start, seen(page)) > 0
        box.click()
    page.locator("canvas").focus()
    assert changed(start, seen(page)) < 0.01
    for box in page.locator(".layers input").all():
        box.click()
    assert page.locator(".view span:visible").count() == 0


def test_a_dark_page_has_light_lines(page):
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    page.evaluate("new Promise(requestAnimationFrame)")
    colours = {tuple(colour) for colour in seen(page).reshape(-1, 3)}
    assert (0x2F, 0xC9, 0x9C) in colours


NAMES = ["</script><img src=x onerror=window.alive=1>", "<!-- <script>", "a & b"]
"""Of points, which would end the data, or do something where they are shown."""


@pytest.fixture
def named():
    at = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 50.0, 20.0]])
    points = Layer(name=NAMES[0], kind="points", colour="ink", at=at, labels=NAMES)
    return Scene(name="block", alt="points", caption=NAMES[0], layers=[points]).html


@pytest.mark.parametrize("figure", ["named"], indirect=True)
def test_names_are_shown_as_text(page):
    assert page.locator(".view span").all_text_contents() == NAMES
    assert page.locator(".layers label").inner_text().strip() == NAMES[0]
    assert page.evaluate("[window.alive, document.images.length]") == [None, 0]


def test_without_the_script_there_is_a_drawing(browser, figure):
    page = browser.new_page()
    page.set_content(figure)
    assert page.locator("svg path").count() >= 6
    assert page.locator("svg").bounding_box()["height"] > 200
    page.close()


@pytest.fixture
def crowd():
    """Names at places in a row away from the eye, on one spot, and far apart."""
    at = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.5], [0.0, 0.0, 0.0], [90.0, -90.0, 0.0]])
    points = Layer(name="p", kind="points", colour="ink", at=at, labels=["a", "b", "c", "d"])
    return Scene(name="block", alt="points", caption="", layers=[points]).html


@pytest.mark.parametrize("figure", ["crowd"], indirect=True)
def test_of_names_that_would_meet_the_nearest_is_shown(page):
    boxes = [name.bounding_box() for name in page.locator(".view span:visible").all()]
    assert page.locator(".view span:visible").all_text_contents() == ["b", "d"]
    assert boxes[1]["x"] > boxes[0]["x"] + boxes[0]["width"]
