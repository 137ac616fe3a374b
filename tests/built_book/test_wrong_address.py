"""The page for addresses that the book never had, as a host shows it."""

import pytest

from support.helpers import book_extension

MISSING = book_extension("forwards").MISSING


@pytest.mark.parametrize("asked", ["nothing.html", "_executed/foundations/nothing.html", "a"])
def test_it_leads_to_the_front_page_from_any_folder(browser, asked):
    page = browser.new_page()
    page.route("**/*", lambda route: route.fulfill(body=MISSING, content_type="text/html"))
    page.goto(f"http://book.example/of/ours/{asked}")
    front = page.locator("a").evaluate("link => link.href")
    page.close()
    assert front == "http://book.example/of/ours/index.html"
