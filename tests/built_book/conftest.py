"""The built book, and what its tests need; where it is missing they are skipped and say why.

`.ci/run` sets ACX4_REQUIRE_BOOK and ACX4_REQUIRE_BROWSER: there, what is missing is an error.
"""

import gc
import os
import re
import shutil
from collections.abc import Mapping
from contextlib import contextmanager
from importlib import resources

import pytest
from bs4 import BeautifulSoup

from support.helpers import ROOT

HTML = ROOT / "book" / "_build" / "html"
FORWARD = 'http-equiv="refresh"'
"""What a page at an old address has, which leads to another."""

LINES = re.compile(r"<(?:path|use)\b[^>]*/>")
"""Of drawings: a fifth of the elements of the book, and no test of files looks at them."""


class Pages(Mapping):
    """Pages by their paths inside the book, each parsed when it is asked for."""

    def __init__(self, html, names):
        self.html, self.names, self.parsed = html, names, {}

    def __getitem__(self, name):
        if name not in self.names:
            raise KeyError(name)
        if name not in self.parsed:
            gc.disable()  # which would look through all pages again and again
            self.parsed[name] = parse(self.html / name)
            gc.freeze()
            gc.enable()
        return self.parsed[name]

    def __iter__(self):
        return iter(self.names)

    def __len__(self):
        return len(self.names)

    def without(self, *names):
        """Return the pages but for some of them; they share what is parsed."""
        fewer = Pages(self.html, [name for name in self if name not in names])
        fewer.parsed = self.parsed
        return fewer


def give_up(reason, variable):
    if os.environ.get(variable):
        pytest.fail(f"{reason} ({variable} is set)")
    pytest.skip(reason)


@pytest.fixture(scope="session")
def html():
    """The folder of the built book."""
    if not (HTML / "index.html").is_file():
        give_up("the book is not built: make book", "ACX4_REQUIRE_BOOK")
    return HTML


@pytest.fixture(scope="session")
def pages(html):
    """Every page but forwards."""
    others = {"_static", "_downloads", "downloads"}  # no pages of the book
    found = [path for path in sorted(html.rglob("*.html")) if not others & {*path.parts}]
    files = [path for path in found if path.name != "404.html"]  # of no address
    own = [path for path in files if FORWARD not in path.read_text(encoding="utf-8")]
    return Pages(html, [path.relative_to(html).as_posix() for path in own])


def parse(path):
    text = LINES.sub("", path.read_text(encoding="utf-8"))
    return BeautifulSoup(text, "html.parser")


@pytest.fixture(scope="session")
def chapters(pages):
    """The pages that somebody wrote: no index, no search."""
    return pages.without("search.html", "index.html")


@pytest.fixture(scope="session")
def browser():
    """A browser that reaches no network."""
    chromium = shutil.which("chromium")
    if chromium is None:
        give_up("chromium is not installed", "ACX4_REQUIRE_BROWSER")
    flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--no-first-run",
        "--host-resolver-rules=MAP * ~NOTFOUND",
    ]
    try:
        from playwright.sync_api import sync_playwright  # noqa: PLC0415  may be missing
    except ImportError:
        give_up("playwright is not installed", "ACX4_REQUIRE_BROWSER")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=flags)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def dark():
    """Show a page, for a while, to a reader whose system is dark."""

    @contextmanager
    def shown_dark(page):
        switch(page, "dark")
        yield
        switch(page, "light")

    def switch(page, colours):
        page.emulate_media(color_scheme=colours)
        page.wait_for_function(f"document.documentElement.dataset.theme === '{colours}'")

    return shown_dark


@pytest.fixture(scope="session")
def axe():
    """The script that finds what is not accessible."""
    try:
        package = resources.files("axe_playwright_python")
    except ImportError:
        give_up("axe-playwright-python is not installed", "ACX4_REQUIRE_BROWSER")
    return (package / "axe.min.js").read_text(encoding="utf-8")
