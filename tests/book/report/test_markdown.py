"""Markdown of a report becomes HTML."""

from acx4book.report import markdown


def test_markdown_becomes_html_with_numbers_and_without_foreign_markup():
    document = markdown.Document(numbers={"tab-x": "Table 1"})
    text = (
        "See {numref}`tab-x` and {eq}`eq-14`: $x_p$, $\\omega$, $\\chi^2$, "
        "<script>a < b</script>.\n\n"
        "```{table} A *caption*\n:name: tab-x\n\n"
        "| Flight |\n| :--- |\n| ✗ fails |\n| <b>x</b> |\n```"
    )
    html = markdown.to_html(text, document)
    assert "See Table 1 and (14):" in html
    assert "<i>x</i><sub><i>p</i></sub>, <i>ω</i>, <i>χ</i><sup>2</sup>" in html
    assert "<script>" not in html
    assert "&lt;script&gt;a &lt; b&lt;/script&gt;" in html
    assert '<table id="tab-x"><caption><b>Table 1.</b> A <em>caption</em></caption>' in html
    assert "<td>✗ fails</td>" in html or 'align:left">✗ fails</td>' in html  # a name, no answer
    verdict = markdown.to_html(text.replace("tab-x", "tab-report-verdict"), document)
    assert 'class="state fails">✗&nbsp;fails</td>' in verdict
    assert "&lt;b&gt;x" in html
