"""The built book in a browser, opened from disk, with no network."""

import numpy as np
import pytest

from acx4book.typesetting import style
from support.helpers import book_extension, repeats

HEIGHT = 900
DESKTOP, PHONE = 1280, 390
"""Widths of windows, px."""

ALIKE = ("_generated/api/", "teaching/lab-")
"""Begin of the names of pages that a program writes alike."""

LETTERS = {DESKTOP: 11, PHONE: 9}
"""Of figures, px at least. A figure of the whole column is 504 points wide."""

DRAWN = """async () => {
    if (window.MathJax?.startup?.promise) await MathJax.startup.promise;
    const missing = [...document.images].filter(i => i.complete && !i.naturalWidth);
    return {
        expected: document.querySelectorAll('.math').length,
        rendered: document.querySelectorAll('.math mjx-container').length,
        failed: document.querySelectorAll('mjx-merror').length,
        missing: missing.map(i => i.src),
        still: [...document.querySelectorAll('figure.acx4-explorer')].filter(
            figure => !figure.querySelector('input[type=range]')).map(figure => figure.id),
        drawings: document.querySelectorAll('div.drawing').length,
        overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
        scales: [...document.querySelectorAll('div.drawing svg')].map(
            drawing => drawing.getBoundingClientRect().width / drawing.viewBox.baseVal.width),
    };
}"""
CUT_OFF = """async () => {
    for (let frame = 0; frame < 3; frame++)  // in which the boxes that scroll are marked
        await new Promise(done => requestAnimationFrame(() => setTimeout(done)));
    const scrolls = box => /auto|scroll/.test(getComputedStyle(box).overflowX);
    const wide = document.documentElement.clientWidth;
    const cut = [];
    const parts = 'article :is(mjx-container, table, pre, .drawing svg)';
    for (const part of document.querySelectorAll(parts)) {
        if (part.closest('details:not([open]), .toggle-hidden')) continue;
        const {left, right, width} = part.getBoundingClientRect();
        let box = part;
        while (box && !scrolls(box)) box = box.parentElement;
        const inside = box && box.closest('article');
        const more = inside && box.scrollWidth > box.clientWidth + 1;
        if (width && !more && (left < -1 || right > wide + 1))
            cut.push(`cut off: ${part.textContent.trim().slice(0, 60)}`);
        if (more && !box.hasAttribute('data-scrolls'))
            cut.push(`scrolls, and nothing says so: ${part.textContent.trim().slice(0, 60)}`);
        if (more && box.tabIndex < 0)
            cut.push(`scrolls, and no key reaches it: ${part.textContent.trim().slice(0, 60)}`);
    }
    return cut;
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


class Window:
    """A browser window on a light desktop at first; it keeps what the browser complains of."""

    def __init__(self, browser, html):
        context = browser.new_context(color_scheme="light", reduced_motion="reduce")
        self.page = context.new_page()
        self.widen(DESKTOP)
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

    def widen(self, width):
        self.page.set_viewport_size({"width": width, "height": HEIGHT})

    def open(self, name):
        self.page.goto(f"{self.html.as_uri()}/{name}", wait_until="load")
        return self.page


@pytest.fixture
def window(browser, html):
    """Open a window on the book, which is closed after the test."""
    windows = []

    def open_window():
        windows.append(Window(browser, html))
        return windows[-1]

    yield open_window
    for opened in windows:
        opened.page.context.close()


@pytest.mark.parametrize("half", [0, 1])
@pytest.mark.parametrize("sampled", [True, repeats(False)])
def test_every_page_is_drawn_whole_and_in_peace(window, dark, chapters, sampled, half):
    """On a phone, when its window becomes as wide as a desktop's, and there in the dark.

    Of pages that a program writes alike, of modules and labs, the usual tests look at every fifth;
    and at every third page in the dark, whose colours come of one style sheet.
    """
    book = window()
    alike = [name for name in chapters if name.startswith(ALIKE)]
    left_out = {name for n, name in enumerate(alike) if n % 5} if sampled else set()
    names = [*(name for name in chapters if name not in left_out), "search.html"]
    for number, name in enumerate(names[half::2]):
        book.widen(PHONE)
        book.open(name)
        drawn_whole(book, PHONE)
        for cut in book.page.evaluate(CUT_OFF):
            book.complain(cut)
        book.widen(DESKTOP)
        drawings = drawn_whole(book, DESKTOP)
        in_the_dark = not sampled or number % 3 == 0
        if in_the_dark and drawings:
            with dark(book.page):
                light_on_the_dark(book)
    assert book.complaints == []


def drawn_whole(book, width):
    """Look for what is not as it should be, and return the number of drawings."""
    drawn = book.page.evaluate(DRAWN)
    if drawn["rendered"] != drawn["expected"] or drawn["failed"]:
        book.complain(f"mathematics: {drawn}")
    if drawn["missing"]:
        book.complain(f"images without content: {drawn['missing']}")
    if drawn["still"]:
        book.complain(f"explorers without a slider: {drawn['still']}")
    if drawn["overflow"] > 0:
        book.complain(f"{drawn['overflow']} px wider than the window of {width} px")
    letters = min(drawn["scales"], default=np.inf) * style.SMALL
    if letters < LETTERS[width]:
        book.complain(f"letters of {letters:.1f} px in a window of {width} px")
    return drawn["drawings"]


def light_on_the_dark(book):
    """Look for ink of figures that is dark, and for light cards, on the dark page."""
    seen = book.page.evaluate(IN_THE_DARK)
    if seen["page"] > 60 or min([seen["text"], *seen["letters"]]) < 180:
        book.complain(f"not light on dark: {seen}")
    if set(seen["cards"]) != {"rgba(0, 0, 0, 0)"}:
        book.complain(f"a card behind a figure in the dark: {seen['cards']}")


def test_the_button_switches_to_the_dark_and_back(window):
    page = window().open("intro.html")
    shown = set()
    for _ in range(3):
        page.locator("button.theme-switch-button:visible").first.click()
        shown.add(page.evaluate("document.documentElement.dataset.theme"))
    assert shown == {"light", "dark"}


@pytest.mark.parametrize(
    "words", ["boresight", "lever arm", repeats("collinearity"), repeats("distortion")]
)
def test_the_search_finds_chapters_before_modules(window, words):
    page = window().open(f"search.html?q={words}")
    page.wait_for_function("document.querySelector('.search-summary')?.textContent.match(/\\d/)")
    found = page.locator("#search-results li a").evaluate_all("all => all.map(a => a.href)")
    modules = ["_generated/api/" in url for url in found]
    assert "frames-and-notation" in " ".join(found)
    assert any(modules)
    assert modules == sorted(modules)


# --- what keeps readers out who see little or use no mouse -------------------------------------


KINDS = (
    *("intro.html", "_executed/19-from-pictures.html"),
    *("_generated/api/acx4files/conventions.html", "search.html"),
)
"""One page of each kind, of the shorter ones."""

FOUND = """async (options) => {
    const found = await axe.run({resultTypes: ['violations'], ...options});
    return found.violations
        .filter(one => ['serious', 'critical'].includes(one.impact))
        .map(one => `${one.id}, ${one.nodes.length} times: ${one.nodes[0].html.slice(0, 150)}`);
}"""
CONTRAST = {"runOnly": ["color-contrast"]}


def complaints(browser, html, axe, dark, names):
    """Return what axe finds in the light, and in the dark, where only contrasts differ."""
    size = {"width": 1280, "height": 900}
    context = browser.new_context(viewport=size, color_scheme="light", reduced_motion="reduce")
    page, found = context.new_page(), []
    for name in names:
        page.goto(f"{html.as_uri()}/{name}", wait_until="load")
        page.evaluate("async () => { await window.MathJax?.startup?.promise; }")
        page.evaluate(axe)
        found += [f"{name}: {one}" for one in page.evaluate(FOUND, {})]
        with dark(page):
            found += [f"{name}, dark: {one}" for one in page.evaluate(FOUND, CONTRAST)]
    context.close()
    return found


def test_pages_of_each_kind_have_no_serious_finding(browser, html, axe, dark, chapters):
    there = [name for name in KINDS if name in chapters or name == "search.html"]
    assert complaints(browser, html, axe, dark, there) == []


@pytest.mark.slow
@pytest.mark.repeats
def test_no_page_has_a_serious_finding(browser, html, axe, dark, chapters):
    assert complaints(browser, html, axe, dark, chapters) == []


# --- the page for addresses that the book never had, as a host shows it ------------------------


MISSING = book_extension("forwards").MISSING


@pytest.mark.parametrize("asked", ["nothing.html", "_executed/foundations/nothing.html", "a"])
def test_it_leads_to_the_front_page_from_any_folder(browser, asked):
    page = browser.new_page()
    page.route("**/*", lambda route: route.fulfill(body=MISSING, content_type="text/html"))
    page.goto(f"http://book.example/of/ours/{asked}")
    front = page.locator("a").evaluate("link => link.href")
    page.close()
    assert front == "http://book.example/of/ours/index.html"
