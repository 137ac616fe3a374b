import shutil

import pytest

from acx4lib.errors import FlightError
from acx4tools.measuring.measure import _given, read_unmeasured


@pytest.fixture
def own(whole, tmp_path):
    return shutil.copytree(whole.flight, tmp_path / "own", copy_function=shutil.os.link)


def test_image_points_may_be_missing_or_empty(own):
    assert len(read_unmeasured(own).flight.calibration.image_points) == 0
    for text in ("", "image,point,col_px,row_px\n", "\n\n"):
        (own / "calibration" / "image_points.csv").write_text(text)
        assert len(read_unmeasured(own).flight.calibration.image_points) == 0


def test_control_points_may_be_missing(own):
    (own / "control_points.csv").unlink()
    assert len(read_unmeasured(own).tables["calibration"].control) == 0


def test_measurements_that_are_there_are_kept(whole, own):
    known = whole.outcome.surveyed.rows[0]
    place = f"{known.image},{known.point},{known.col_px},{known.row_px}"
    table = f"image,point,col_px,row_px,sigma_px\n{place},0.7\n"
    (own / "calibration" / "image_points.csv").write_text(table)
    (row,) = _given(read_unmeasured(own).tables["calibration"], 0.4)
    assert (row.image, row.point, row.sigma_px) == (known.image, known.point, 0.7)


def test_what_is_wrong_in_a_table_is_said_with_its_line(own):
    (own / "calibration" / "image_points.csv").write_text("image,point,col_px,row_px\nX,P,1,2\n")
    with pytest.raises(FlightError, match=r"image_points.csv:2: image: 'X' is unknown"):
        read_unmeasured(own)


def test_a_block_without_pictures_and_measurements_is_refused(own):
    images = own / "calibration" / "images.csv"
    lines = [line.rsplit(",", 1)[0] for line in images.read_text().splitlines()]
    images.unlink()
    images.write_text("\n".join(lines) + "\n")
    with pytest.raises(FlightError, match=r"images.csv: column file: names no picture"):
        read_unmeasured(own)


def test_a_flight_that_is_measured_already_and_has_no_picture_is_refused(own):
    images = own / "calibration" / "images.csv"
    header, first, *_ = images.read_text().splitlines()
    image = first.partition(",")[0]
    for table, text in (
        (images, "\n".join(line.rsplit(",", 1)[0] for line in (header, first))),
        (own / "calibration" / "image_points.csv", f"image,point,col_px,row_px\n{image},P,1,1"),
    ):
        table.unlink(missing_ok=True)
        table.write_text(f"{text}\n")
    with pytest.raises(FlightError, match=r"images.csv: column file: names no picture"):
        read_unmeasured(own)


def test_a_folder_without_blocks_is_refused(tmp_path):
    with pytest.raises(FlightError, match="nowhere: no such folder; expected the folder of a"):
        read_unmeasured(tmp_path / "nowhere")
    with pytest.raises(FlightError, match="no block to measure; a flight has heads/"):
        read_unmeasured(tmp_path)
