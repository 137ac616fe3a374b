"""What is written, and what is refused."""

import pytest

from acx4lib.errors import OutputError
from acx4tools.exchange.lens import Left
from acx4tools.exchange.outward import taken
from acx4tools.exchange.outward.taken import Taken

FAR = Taken(
    files={"a/b.txt": "1\n"},
    lenses={"A": Left(largest_px=0.2, rms_px=0.1), "B": Left(largest_px=0.01, rms_px=0.0)},
    assumed=("y is down",),
    left_out=("colours",),
)


def test_files_and_what_is_said_of_them_are_written_and_replaced(tmp_path):
    taken.write(FAR, tmp_path / "out", title="some: A, B", origin="by hand")
    assert (tmp_path / "out/a/b.txt").read_text() == "1\n"
    assert (tmp_path / "out/export.md").read_text() == (
        "# some: A, B\n\nBy hand.\n\n## Lenses\n\n"
        "- A: lens refitted over the whole image, off by at most 0.2000 px, rms 0.1000 px\n"
        "- B: lens refitted over the whole image, off by at most 0.0100 px, rms 0.0000 px\n\n"
        "## Conventions\n\n- y is down\n\n## Left out\n\n- colours\n"
    )
    taken.write(Taken(files={"c.txt": ""}), tmp_path / "out", title="other", origin="x")
    left = {path.name for path in (tmp_path / "out").rglob("*")}
    assert left == {"c.txt", "export.md", ".acx4.json"}


def test_a_folder_of_others_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="holds what acx4 export did not write"):
        taken.write(FAR, tmp_path, title="some", origin="x")
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_lens_that_is_too_far_is_refused_with_what_would_allow_it():
    with pytest.raises(OutputError, match=r"A: .* differs by 0\.2 px .* 0\.05 px; --allow 0\.21 "):
        taken.require_near(FAR)
    taken.require_near(FAR, 0.21)
    with pytest.raises(OutputError, match="nan px"):
        taken.require_near(Taken(files={}, lenses={"A": Left(largest_px=float("nan"), rms_px=0)}))
