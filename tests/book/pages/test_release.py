"""What is given away: the wheel, the archive of the book, and the program for its readers."""

import subprocess
import zipfile

import pytest

from acx4book.pages import release


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A working copy of a package of one module, committed."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["setuptools"]\nbuild-backend = "setuptools.build_meta"\n'
        '[project]\nname = "acx4lib"\nversion = "1.2.0"\n[tool.setuptools]\npy-modules = ["one"]\n'
    )
    (tmp_path / "one.py").write_text("")
    (tmp_path / "CITATION.cff").write_text(
        "title: acx4lib\nversion: 1.2.0\nlicense: MIT\nauthors: [{name: us}]\n"
    )
    (tmp_path / ".gitignore").write_text("build*\nhtml/\n*.egg-info\n")
    (tmp_path / "html" / "a").mkdir(parents=True)
    for name in ("index.html", "a/x.html"):
        (tmp_path / "html" / name).write_text("book")
    monkeypatch.setenv("GIT_COMMITTER_DATE", "1700000000 +0000")
    who = ("-c", "user.name=us", "-c", "user.email=us@example.org")
    for arguments in (("init", "-q"), ("add", "."), (*who, "commit", "-qm", "all")):
        subprocess.run(["git", *arguments], check=True)
    return tmp_path


@pytest.mark.slow
def test_a_release_is_a_wheel_and_the_book(clone):
    version, wheel, book = release.make(clone / "html", clone / "build")
    assert version.startswith("acx4lib 1.2.0, commit ")
    assert wheel.endswith("acx4lib-1.2.0-py3-none-any.whl")
    assert book.endswith("acx4lib-book-1.2.0.zip")
    with zipfile.ZipFile(clone / "build" / "acx4lib-book-1.2.0.zip") as held:
        assert {"a/x.html", "index.html"} <= {*held.namelist()}


def test_readers_get_the_last_commit_or_are_told_why_not(clone, tmp_path, monkeypatch):
    link = release.program(clone / "build.zip")
    assert link.startswith("{download}`acx4lib.zip </_generated/build.zip>`")
    with zipfile.ZipFile(clone / "build.zip") as held:
        assert "acx4lib/one.py" in held.namelist()
    monkeypatch.setenv("GIT_DIR", str(tmp_path / "none"))
    assert "not made from a clone" in release.program(clone / "again.zip")
