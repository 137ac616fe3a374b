"""The changelog as a page."""

from acx4book.pages.back import changelog


def test_links_to_files_become_their_names_and_the_title_is_left_out(tmp_path):
    file = tmp_path / "CHANGELOG.md"
    file.write_text("# Changelog\n\nSee [A.md](A.md), [b](https://example.org/b).\n\n## 1.0\n")
    assert changelog.page(file) == "See A.md, [b](https://example.org/b).\n\n## 1.0\n"
