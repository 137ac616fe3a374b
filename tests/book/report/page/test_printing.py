"""Printing by Chromium: a PDF beside the report, or one line on what to install."""

import os
from pathlib import Path

import pytest
from pypdf import PdfReader

from acx4book.report.page import page, printing
from acx4lib.errors import OutputError

REPORT = """<!DOCTYPE html><html><head><meta name="generator" content="acx4 report">
<title>Calibration report: 飛</title></head><body><p>one</p></body></html>"""


@pytest.fixture
def report(tmp_path):
    path = tmp_path / "report.html"
    path.write_text(REPORT, encoding="utf-8")
    return path


def test_without_chromium_a_line_says_what_to_install(report, monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(printing.PrintError, match="install the package chromium"):
        page.write_pdf(report)
    assert [path.name for path in report.parent.iterdir()] == ["report.html"]


def test_another_pdf_is_not_replaced(report):
    report.with_suffix(".pdf").write_bytes(b"%PDF-1.4 of somebody")
    with pytest.raises(OutputError, match="is not a report of acx4"):
        page.check_pdf(report)


@pytest.mark.slow
def test_a_report_is_printed_beside_it_and_printed_again(report):
    try:
        printing.chromium()
    except printing.PrintError as error:
        (pytest.fail if os.environ.get("ACX4_REQUIRE_BROWSER") else pytest.skip)(str(error))
    made = page.write_pdf(report)
    assert made == report.with_suffix(".pdf")
    assert PdfReader(made).pages[0].extract_text().strip() == "one"
    page.write_pdf(report)
    assert {path.name for path in report.parent.iterdir()} == {"report.html", "report.pdf"}


def test_a_report_with_a_relative_path_is_printed(report, monkeypatch):
    """A browser that only says what it was asked for; it is started in another folder."""
    browser = report.parent / "chromium"
    browser.write_text(
        "#!/bin/sh\nfor a; do case $a in --print-to-pdf=*) pdf=${a#*=};; file://*) page=$a;; esac;"
        ' done\nprintf "%s %%%%EOF" "$page" > "$pdf"\n'
    )
    browser.chmod(0o755)
    monkeypatch.setenv("PATH", f"{report.parent}:/usr/bin:/bin")
    monkeypatch.chdir(report.parent.parent)
    made = page.write_pdf(Path(report.parent.name) / report.name)
    assert made.read_text().startswith(f"file://{report.parent}/")


def test_half_a_pdf_does_not_take_the_place_of_the_one_before(report, monkeypatch):
    """As a browser leaves it on a full disk."""
    before = report.with_suffix(".pdf")
    before.write_bytes(b"%PDF-1.4 " + page.PDF_MARK)
    browser = report.parent / "chromium"
    browser.write_text(
        '#!/bin/sh\nfor a; do case $a in --print-to-pdf=*) printf half > "${a#*=}";; esac; done\n'
    )
    browser.chmod(0o755)
    monkeypatch.setenv("PATH", f"{report.parent}:/usr/bin:/bin")
    with pytest.raises(printing.PrintError, match="no whole PDF"):
        page.write_pdf(report)
    assert page.PDF_MARK in before.read_bytes()
    assert {path.name for path in report.parent.iterdir()} == {
        *("chromium", "report.html", "report.pdf")
    }
