"""The block in space in a browser: drawn, turned and brought nearer, its parts switched."""

import io

import numpy as np
import pytest
from PIL import Image

from acx4book.chapters.mounting import figures
from acx4book.typesetting.moving import Layer, Scene
from acx4lib.calibration.estimates import from_bundle
from acx4lib.calibration.mounting import Mounting
from support.helpers import ROOT

SCRIPT = ROOT / "book" / "_moving" / "block.js"
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
    script = f'<script src="{SCRIPT.as_uri()}" defer></script>'
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
