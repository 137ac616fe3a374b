"""`acx4 render` as its user meets it: lines, statuses, and what a stopped command leaves."""

import os
import resource
import shutil
import signal
import subprocess
import sys
import time

import cv2
import numpy as np
import pytest
import tifffile

import acx4sim
from acx4files.flight.reader import read
from acx4files.results.whole_files import SCRATCH
from support.flights import pictured as flights_pictured
from support.helpers import hears_interrupts, repeats
from support.pictures import measured


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return measured.flown(tmp_path_factory.mktemp("small"), ("C1-04", "C2-04"), reduce=16)


def test_pictures_become_a_flight_that_is_read(acx4, flight, tmp_path):
    out = tmp_path / "measured"
    status, said, err = acx4("measure", flight, "--out", out)
    assert (status, err) == (0, "")
    lines = said.splitlines()
    assert lines[0] == "calibration 1/16: done"
    assert lines[1].startswith("calibration: ")
    assert lines[-1] == str(out)
    assert len(read(out).calibration.image_points) > 100


def test_a_flight_is_not_measured_into_itself(acx4, flight):
    status, _, err = acx4("measure", flight, "--out", flight)
    assert status == 2
    assert err == f"{flight}: is the flight itself; choose another folder for the measured one\n"


COMMAND = [sys.executable, "-c", "from acx4book.command.acx4 import main; main()"]
WHOLE = {"E0.tif", "E0_preview.jpg", "E1.tif", "E1_preview.jpg", "images.csv"}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli")
    flight = flights_pictured.write_flight(folder / "flight")
    return flight, flights_pictured.write_results(folder / "results", flight)


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """More exposures than are rendered before a command can be stopped."""
    folder = tmp_path_factory.mktemp("many")
    flight = flights_pictured.write_flight(folder / "flight", ("E0", "E1", "E2", "E3"))
    return flight, flights_pictured.write_results(folder / "results", flight)


@pytest.fixture
def own(made, tmp_path):
    """Return the same flight, to be spoilt."""
    return shutil.copytree(made[0], tmp_path / "flight"), made[1]


@pytest.fixture
def render_acx4(acx4, tmp_path):
    """Render into a folder; return status, lines of standard output and of standard error."""

    def run(flight, *options):
        status, *said = acx4("render", flight[0], *arguments(flight, tmp_path / "out"), *options)
        return status, *(text.splitlines() for text in said)

    return run


def arguments(flight, out):
    return ["--results", str(flight[1]), "--out", str(out)]


def names(folder):
    return {path.name for path in folder.iterdir()}


def test_a_flight_is_rendered_with_a_line_for_each_image(render_acx4, made, tmp_path):
    status, out, err = render_acx4(made)
    assert (status, err) == (0, [])
    assert out[:3] == [
        "E0: done",
        "E1: done",
        f"heads as {made[1]} has them, heads/relative_orientation",
    ]
    assert out[3].startswith("response of the heads from E0, E1: overlaps disagree by at most 0.")
    assert out[4:] == [f"2 images rendered, in {tmp_path / 'out'}"]
    assert names(tmp_path / "out") == WHOLE
    status, out, err = render_acx4(made)
    assert (status, err) == (0, [])
    assert out[-1] == f"0 images rendered, 2 there already, in {tmp_path / 'out'}"


def test_options_reach_the_image(render_acx4, made, tmp_path):
    status, _, err = render_acx4(made, "--exposures", "E1", "--blend", "seam")
    assert (status, err) == (0, [])
    assert names(tmp_path / "out") == {"E1.tif", "E1_preview.jpg", "images.csv"}
    with tifffile.TiffFile(tmp_path / "out" / "E1.tif") as tiff:
        assert '"blend": "seam"' in tiff.pages.first.description


def test_one_bad_exposure_is_status_2_and_the_others_are_there(render_acx4, own, tmp_path):
    path = flights_pictured.head_path(own[0], "E0", "LEFT")
    path.write_bytes(b"no image")
    status, out, err = render_acx4(own)
    assert status == 2
    assert out[-1] == f"1 image rendered, in {tmp_path / 'out'}"
    (problem,) = err
    assert problem.startswith(f"E0: {path}: is no TIFF, or a damaged one (")
    assert names(tmp_path / "out") == {"E1.tif", "E1_preview.jpg", "images.csv"}


def test_no_pixels_at_all_is_said_with_the_cure(render_acx4, own, tmp_path):
    table = own[0] / "heads" / "images.csv"
    lines = [line.rpartition(",")[0] for line in table.read_text().splitlines()]
    table.write_text("\n".join(lines) + "\n")
    status, out, err = render_acx4(own)
    assert (status, out) == (2, [])
    assert err == [
        f"{table}: names no files of head images; give heads/images.csv a column 'file' with the "
        "TIFF of every head's image, relative to heads/"
    ]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [
        ("--blend", "multiband", "'multiband' is not one of 'feather', 'seam', 'stack'"),
        ("--exposures", "E9", "exposure E9: no files of this exposure; complete are E0, E1"),
        ("--exposures", "", "name at least one exposure"),
    ],
)
def test_a_wrong_option_is_said_and_nothing_is_made(
    render_acx4, made, tmp_path, option, value, says
):
    status, out, err = render_acx4(made, option, value)
    assert (status, out) == (2, [])
    assert says in " ".join(err)
    assert not (tmp_path / "out").exists()


def limited():
    """Let no file grow beyond what one image needs, as if the disk were full."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (800_000, 800_000))


def test_a_full_disk_is_a_line_for_each_image_and_leaves_none(render_acx4, made, tmp_path):
    """In a process of its own, whose files may not grow; what is compiled was kept before."""
    assert render_acx4(made)[0] == 0
    shutil.rmtree(tmp_path / "out")
    done = subprocess.run(
        [*COMMAND, "render", str(made[0]), *arguments(made, tmp_path / "out")],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        preexec_fn=limited,
    )
    assert done.returncode == 2
    err = done.stderr.splitlines()
    assert [line.partition(": No space")[0] for line in err] == [
        f"{name}: {tmp_path / 'out' / name}.tif" for name in ("E0", "E1")
    ]
    assert not [*(tmp_path / "out").iterdir()]


@pytest.mark.slow
@pytest.mark.parametrize("number", [repeats(signal.SIGINT), signal.SIGTERM])
def test_a_stopped_command_leaves_no_half_image(render_acx4, many, tmp_path, number):
    """Stopped as soon as an image is begun; what is whole stays, and is taken up again."""
    whole = [*COMMAND, "render", str(many[0]), *arguments(many, tmp_path / "out")]
    all_files = 2 * 4 + len({"images.csv"})
    how = {"stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    how |= {"stdout": subprocess.DEVNULL, "preexec_fn": hears_interrupts}
    command = subprocess.Popen(whole, **how)
    for _ in range(3000):
        if (tmp_path / "out").is_dir() and any((tmp_path / "out").glob(f"{SCRATCH}*.tif")):
            break
        time.sleep(0.02)
    os.killpg(command.pid, number)
    _, err = command.communicate(timeout=60)
    assert command.returncode == 128 + number
    assert err.splitlines() == [{15: "terminated", 2: "interrupted"}[number]]
    left = names(tmp_path / "out") if (tmp_path / "out").exists() else set()
    assert len(left) < all_files
    assert {name for name in left if name.startswith(".")} == set()
    status, out, _ = render_acx4(many)
    assert status == 0
    assert len(names(tmp_path / "out")) == all_files
    assert "images rendered" in " ".join(out)


# --- `acx4 check` of a flight with pictures


SIDES = {"small": 64, "large": 600}


@pytest.fixture(params=SIDES)
def pictured(request, tmp_path):
    """A flight whose first image has a picture; noise, so that its file is large."""
    flight = tmp_path / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=3), flight)
    table = flight / "calibration" / "images.csv"
    head, first, *others = table.read_text().splitlines()
    rows = [f"{head},file", f"{first},images/a.jpg", *(f"{one}," for one in others)]
    table.write_text("\n".join(rows) + "\n")
    side = SIDES[request.param]
    noise = np.random.default_rng(1).integers(0, 255, (side, side), dtype=np.uint8)
    (flight / "calibration" / "images").mkdir()
    picture = flight / "calibration" / "images" / "a.jpg"
    picture.write_bytes(cv2.imencode(".jpg", noise)[1].tobytes())
    return flight, picture


def test_a_jpeg_that_was_cut_in_half_is_one_line(acx4, pictured):
    flight, picture = pictured
    assert acx4("check", flight)[0] == 0
    whole = picture.read_bytes()
    picture.write_bytes(whole[: len(whole) // 2])
    status, _, wrong = acx4("check", flight)
    assert (status, wrong) == (2, f"{picture}: is cut off, its pixels have no end; copy it again\n")


@pytest.mark.parametrize("kept", [0.5, 0.98])
def test_a_tiff_that_was_cut_is_one_line(acx4, pictured, kept):
    """In the middle of its pixels, and in the tags at its end."""
    flight, jpeg = pictured
    picture = jpeg.with_suffix(".tif")
    pixels = cv2.imread(str(jpeg), cv2.IMREAD_GRAYSCALE)
    cv2.imwrite(str(picture), pixels)
    table = flight / "calibration" / "images.csv"
    table.write_text(table.read_text().replace("a.jpg", "a.tif"))
    assert acx4("check", flight)[0] == 0
    whole = picture.read_bytes()
    picture.write_bytes(whole[: int(kept * len(whole))])
    status, _, wrong = acx4("check", flight)
    assert (status, wrong) == (2, f"{picture}: is cut off, its pixels have no end; copy it again\n")
