"""The built book in a browser, opened from disk, with no network."""

import pytest

from acx4book.typesetting import style

WIDTHS, HEIGHT = (1280, 390), 900
"""Of a desktop's window and a phone's, px."""

DRAWN = """async () => {
    if (window.MathJax?.startup?.promise) await MathJax.startup.promise;
    const missing = [...document.images].filter(i => i.complete && !i.naturalWidth);
    return {
        expected: document.querySelectorAll('.math').length,
        rendered: document.querySelectorAll('.math mjx-container').length,
        failed: document.querySelectorAll('mjx-merror').length,
        missing: missing.map(i => i.src),
        overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    };
}"""
IN_THE_DARK = """() => {
    const light = colour => Math.min(...colour.match(/[\\d.]+/g).slice(0, 3).map(Number));
    const style = element => getComputedStyle(element);
    const inked = [...document.querySelectorAll('div.drawing [style*="fill: var(--figure-ink)"]')];
    return {
        page: light(style(document.body).backgroundColor),
        text: light(style(document.querySelector('article section > p')).color),
        letters: inked.map(element => light(style(element).fill)),
        cards: [...document.querySelectorAll('div.drawing')].map(
            drawing => style(drawing).backgroundColor),
    };
}"""

PIXELS_PER_POINT = """() => [...document.querySelectorAll('div.drawing svg')].map(
    drawing => drawing.getBoundingClientRect().width / drawing.viewBox.baseVal.width)"""


class Window:
    """A browser window of some width; it keeps what the browser complains of."""

    def __init__(self, browser, html, *, colours):
        size = {"width": WIDTHS[0], "height": HEIGHT}
        self.page = browser.new_context(viewport=size, color_scheme=colours).new_page()
        self.html = html
        self.complaints = []
        self.page.on("pageerror", self.complain)
        self.page.on("console", lambda m: self.complain(m.text) if m.type == "error" else None)
        self.page.on("requestfailed", self.miss)
        self.page.on("request", self.watch)

    def complain(self, of):
        self.complaints.append(f"{self.page.url.removeprefix(self.html.as_uri())}: {of}")

    def watch(self, request):
        if not request.url.startswith(("file:", "data:", "blob:")):
            self.complain(f"asks for {request.url}")

    def miss(self, request):
        if request.failure != "net::ERR_ABORTED":  # the page was left before it came
            self.complain(f"{request.failure}: {request.url}")

    def open(self, name):
        self.page.goto(f"{self.html.as_uri()}/{name}", wait_until="load")
        return self.page


@pytest.fixture
def window(browser, html):
    """Open a window on the book, which is closed after the test."""
    windows = []

    def open_window(colours="light"):
        windows.append(Window(browser, html, colours=colours))
        return windows[-1]

    yield open_window
    for opened in windows:
        opened.page.context.close()


def test_every_page_is_drawn_whole_and_in_peace(window, chapters):
    """On the desktop, and when the window becomes as narrow as a phone."""
    book = window()
    for name in [*chapters, "search.html"]:
        book.page.set_viewport_size({"width": WIDTHS[0], "height": HEIGHT})
        book.open(name)
        for width in WIDTHS:
            book.page.set_viewport_size({"width": width, "height": HEIGHT})
            drawn = book.page.evaluate(DRAWN)
            if drawn["rendered"] != drawn["expected"] or drawn["failed"]:
                book.complain(f"mathematics: {drawn}")
            if drawn["missing"]:
                book.complain(f"images without content: {drawn['missing']}")
            if drawn["overflow"] > 0:
                book.complain(f"{drawn['overflow']} px wider than the window of {width} px")
    assert book.complaints == []


def test_some_pages_have_mathematics(chapters):
    """Or the comparison above would compare nothing."""
    assert len(chapters["frames-and-notation.html"].select("div.math")) >= 14


def test_figures_are_light_on_the_dark_page(window, chapters):
    book = window(colours="dark")
    with_figures = [name for name, page in chapters.items() if page.select("div.drawing")]
    assert with_figures
    for name in with_figures:
        seen = book.open(name).evaluate(IN_THE_DARK)
        assert seen["page"] < 60, name
        assert seen["text"] > 180, name
        assert min(seen["letters"], default=255) > 180, name
        assert set(seen["cards"]) == {"rgba(0, 0, 0, 0)"}, name


def test_letters_of_figures_can_be_read_on_the_desktop_and_on_a_phone(window, chapters):
    """The smallest letters have `style.SMALL` points; a figure of the whole column 504 of them."""
    book = window()
    for name in [name for name, page in chapters.items() if page.select("div.drawing")]:
        book.open(name)
        for width, px in zip(WIDTHS, (11, 9), strict=True):
            book.page.set_viewport_size({"width": width, "height": HEIGHT})
            scales = book.page.evaluate(PIXELS_PER_POINT)
            assert min(scales) * style.SMALL >= px, (name, width)


def test_the_button_switches_to_the_dark_and_back(window):
    page = window(colours="light").open("intro.html")
    shown = set()
    for _ in range(3):
        page.locator("button.theme-switch-button:visible").first.click()
        shown.add(page.evaluate("document.documentElement.dataset.theme"))
    assert shown == {"light", "dark"}


@pytest.mark.parametrize("words", ["boresight", "lever arm", "collinearity", "distortion"])
def test_the_search_finds_chapters_before_modules(window, words):
    page = window().open(f"search.html?q={words}")
    page.wait_for_function("document.querySelector('.search-summary')?.textContent.match(/\\d/)")
    found = page.locator("#search-results li a").evaluate_all("all => all.map(a => a.href)")
    modules = ["_generated/api/" in url for url in found]
    assert "frames-and-notation" in " ".join(found)
    assert any(modules)
    assert modules == sorted(modules)
