"""Figures that move, in a browser: what the scripts draw is what the library computes."""

import io
import re

import numpy as np
import pytest
from PIL import Image

from acx4book.chapters import design
from acx4book.chapters.design import papers
from acx4book.chapters.mounting import figures
from acx4book.foundations import explorers
from acx4book.typesetting.moving import Layer, Scene
from acx4lib.calibration.estimates import from_bundle
from acx4lib.calibration.mounting import Mounting
from support.helpers import ROOT

EXPLORERS = {
    "boresight": explorers.boresight_explorer,
    "distortion": explorers.distortion_explorer,
    "two_heights": explorers.two_heights_explorer,
    "design": lambda: design.explorer(papers(gnss=("shift",))),
}
BOOK = ROOT / "book"
STYLES = ("_static/acx4.css", "_static/print.css", "_moving/moving.css")
SCRIPTS = ("_moving/explorer.js", "_moving/block.js")
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
NAMES = ["</script><img src=x onerror=window.alive=1>", "<!-- <script>", "a & b"]
"""Of points, which would end the data, or do something where they are shown."""


@pytest.fixture(scope="module", params=EXPLORERS)
def explorer(request):
    return EXPLORERS[request.param]()


@pytest.fixture
def block(mounted):
    single = Mounting(method="single_step", calibration=from_bundle(mounted), bundle=mounted)
    return figures.view(single)


@pytest.fixture
def opened(browser, tmp_path):
    """Open a page with a figure alone; afterwards the browser has not complained."""
    pages, complaints = [], []

    def opened(figure, **how):
        path = tmp_path / "page.html"
        head = "".join(f'<link rel="stylesheet" href="{(BOOK / n).as_uri()}">' for n in STYLES)
        head += "".join(f'<script src="{(BOOK / n).as_uri()}" defer></script>' for n in SCRIPTS)
        path.write_text(f"<!doctype html><meta charset=utf-8>{head}{figure.html}", "utf-8")
        page = browser.new_page(viewport={"width": 700, "height": 700}, **how)
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


# --- numbers ---------------------------------------------------------------------------------


def test_at_the_stops_it_draws_and_says_what_the_library_computes(opened, explorer):
    page = opened(explorer)
    for values in settings(explorer):
        seen = page.evaluate(MOVE, [explorer.name, [float(v) for v in values]])
        assert seen["values"] == pytest.approx(values, abs=1e-9)
        for panel, paths in zip(explorer.panels, seen["paths"], strict=True):
            for mark, d in zip(panel.marks, paths, strict=True):
                assert numbers(d) == pytest.approx(numbers(mark.path(values)), abs=0.02, rel=1e-4)
        for said, expected in zip(seen["cells"], explorer.readings(values), strict=True):
            for cell, number, digits in zip(
                said, expected, explorer.columns.values(), strict=False
            ):
                assert read(cell) == pytest.approx(read(number), abs=1.01 * 10.0**-digits)
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
        mark = panel.marks[0]
        drawn = (ends[:, 2:4] - ends[:, :2]) / mark.plane.scale / mark.times
        assert drawn == pytest.approx(wrong - right, abs=0.004)


# --- keyboard and buttons --------------------------------------------------------------------


def shown(page):
    """Return the picture and the numbers that an explorer has."""
    return page.locator(".panels").inner_html(), page.locator(".readings").inner_text()


def test_sliders_are_moved_by_the_keyboard_and_by_buttons(opened, explorer):
    page = opened(explorer)
    start, slider = shown(page), explorer.sliders[0]
    first = page.get_by_label(slider.name, exact=True)
    page.keyboard.press("Tab")
    while not first.evaluate("slider => slider === document.activeElement"):
        page.keyboard.press("Tab")
    for key, expected in (("End", slider.high), ("ArrowLeft", slider.high - slider.step)):
        page.keyboard.press(key)
        assert first.evaluate("slider => slider.valueAsNumber") == pytest.approx(expected)
        assert all(a != b for a, b in zip(start, shown(page), strict=True))
    page.locator("button").first.click()
    assert shown(page) == start


def pixels(page):
    """Return what the canvas shows inside of its border, shape (rows, cols, 3)."""
    page.evaluate("new Promise(requestAnimationFrame)")
    picture = Image.open(io.BytesIO(page.locator("canvas").screenshot())).convert("RGB")
    return np.asarray(picture)[5:-5, 5:-5]


def changed(before, after):
    """Return the share of pixels that differ."""
    return np.mean(np.any(before != after, axis=2))


def test_the_block_is_turned_by_keyboard_mouse_and_buttons_and_comes_back(opened, block):
    page = opened(block)
    page.locator("canvas").focus()
    start = after = pixels(page)
    for key in ("ArrowLeft", "ArrowUp", "+", "ArrowRight", "ArrowDown", "-"):
        before = after
        page.keyboard.press(key)
        after = pixels(page)
        assert changed(before, after) > 0.01, key
    assert changed(start, after) < 0.001  # each undoes another
    box = page.locator("canvas").bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 220, box["y"] + 130, steps=3)
    page.mouse.up()
    assert changed(start, pixels(page)) > 0.01
    page.get_by_role("button", name="as at the start").click()
    page.locator("canvas").focus()
    assert changed(start, pixels(page)) < 0.001
    for layer in page.locator(".layers input").all():
        layer.click()
    assert page.locator(".view span:visible").count() == 0


# --- without a script, on paper, in the dark, names ------------------------------------------


def test_without_a_script_there_are_the_drawing_and_the_numbers_of_the_start(
    opened, explorer, block
):
    page = opened(explorer, java_script_enabled=False)
    assert page.locator(".panel svg").first.bounding_box()["height"] > 100
    cells = page.locator("tbody tr").first.locator("td").all_inner_texts()
    assert cells == explorer.readings(explorer.start)[0]
    assert page.locator("figcaption").inner_text() == explorer.caption
    page = opened(block, java_script_enabled=False)
    assert page.locator("svg path").count() >= 6
    assert page.locator("svg").bounding_box()["height"] > 200


def test_on_paper_there_are_the_drawing_and_the_numbers(opened, explorer, block):
    page = opened(explorer)
    page.emulate_media(media="print")
    assert page.locator(".panel svg:visible").count() == len(explorer.panels)
    assert page.locator("tbody tr:visible").count() == len(explorer.rows)
    assert page.locator("button:visible, input:visible").count() == 0
    page = opened(block)
    page.emulate_media(media="print")
    assert page.locator(".view svg").is_visible()
    assert page.locator("canvas:visible, button:visible, input:visible").count() == 0


def test_a_dark_page_has_light_lines(opened, explorer, block):
    stroke = "path => getComputedStyle(path).stroke.match(/\\d+/g).map(Number)"
    page = opened(explorer)
    path = page.locator(".marks path").first
    by_day = path.evaluate(stroke)
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    assert sum(path.evaluate(stroke)) > sum(by_day)
    page = opened(block)
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    assert (0x2F, 0xC9, 0x9C) in {tuple(colour) for colour in pixels(page).reshape(-1, 3)}


def test_names_are_shown_as_text(opened):
    at = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 50.0, 20.0]])
    points = Layer(name=NAMES[0], kind="points", colour="ink", at=at, labels=NAMES)
    page = opened(Scene(name="block", alt="points", caption=NAMES[0], layers=[points]))
    assert page.locator(".view span").all_text_contents() == NAMES
    assert page.locator(".layers label").inner_text().strip() == NAMES[0]
    assert page.evaluate("[window.alive, document.images.length]") == [None, 0]
