"""What a book names as its sources."""

import subprocess

from acx4book.pages import provenance


def test_only_files_of_the_clone_count_as_changes(tmp_path, monkeypatch):
    def git(*arguments):
        who = ("-c", "user.name=A", "-c", "user.email=a@b.c")
        subprocess.run(["git", *who, *arguments], cwd=tmp_path, check=True, capture_output=True)

    git("init")
    (tmp_path / "a.py").write_text("one\n")
    git("add", "a.py")
    git("commit", "-m", "one")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_flight").mkdir()
    (tmp_path / "my_flight" / "flight.toml").write_text("")
    assert "with changes" not in provenance.short(provenance.commit())
    assert "differ" not in provenance.commit()
    (tmp_path / "a.py").write_text("two\n")
    assert provenance.commit().endswith(", 1 files differ")
    assert provenance.short(provenance.commit()).endswith(" with changes")
