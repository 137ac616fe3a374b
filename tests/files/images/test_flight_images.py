"""Synthetic images of a flight as files: right, made again only where needed, despite bad files."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
import tifffile
from scipy.ndimage import binary_erosion

from acx4files import flight as flights
from acx4files.images.flight_images import render_flight
from acx4files.images.tiff import read_about
from acx4files.results import folder as found_results
from acx4files.results import provenance, tables
from acx4lib.errors import AdjustmentError, FlightError
from support.flights import pictured

# --- flight images ---------------------------------------------------------------------------
#
# A flight's synthetic images as files: right, made again only where needed, despite bad files.


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a flight with two exposures, and the results of its heads."""
    folder = tmp_path_factory.mktemp("render")
    flight = pictured.write_flight(folder / "flight")
    return flight, pictured.write_results(folder / "results", flight)


@pytest.fixture
def own(made, tmp_path):
    """Return the same, to be spoilt."""
    flight, results = made
    return (
        shutil.copytree(flight, tmp_path / "flight"),
        shutil.copytree(results, tmp_path / "results"),
    )


@pytest.fixture
def rendered(made, tmp_path):
    """Render with options and return the folder and the report."""

    def run(*, of=made, **how):
        flight, results = of
        report = render_flight(flights.read(flight), results, tmp_path / "out", **how)
        return tmp_path / "out", report

    return run


def image(folder, exposure):
    return tifffile.imread(folder / f"{exposure}.tif", key=0)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def misfit(found, scene):
    """Return differences to the true frame, without the border of what the heads see."""
    seen = binary_erosion((found > 0).all(axis=2), iterations=2)
    return (found.astype(float) - pictured.frame_of(scene))[seen]


def test_the_files_show_the_scene(rendered):
    """Within what interpolation between pixels, there and back, takes of the finest texture."""
    folder, report = rendered()
    assert names(folder) == ["E0.tif", "E0_preview.jpg", "E1.tif", "E1_preview.jpg", "images.csv"]
    assert (report.rendered, report.kept, report.problems) == (("E0", "E1"), (), ())
    for seed, exposure in enumerate(("E0", "E1"), start=1):
        found, scene = image(folder, exposure), pictured.scene(seed)
        assert found.dtype == np.uint16
        assert found.shape == (375, 500, 3)
        d = misfit(found, scene)
        assert np.sqrt(np.mean(d**2)) < 0.03 * pictured.frame_of(scene).std()
        assert abs(np.median(d)) < 0.002 * 12000  # the response of heads that have none is noise


def test_an_image_says_what_it_was_made_from(rendered, made):
    folder, _ = rendered(blend="seam")
    about = read_about(folder / "E1.tif")
    assert about["f_mm"] == 25.0
    assert (about["width_px"], about["height_px"], about["pixel_mm"]) == (500, 375, 0.04)
    assert about["blend"] == "seam"
    assert about["orientation"] == "heads/relative_orientation"
    left, right = about["heads"]
    assert left["file"] == "E1_LEFT.tif"
    assert left["bytes"] == pictured.head_path(made[0], "E1", "LEFT").stat().st_size
    assert right["interior"]["k1"] == 1e-5
    assert right["omega_phi_kappa_deg"] == pytest.approx(
        np.degrees(pictured.orientation().opk[1]).tolist(), abs=1e-6
    )
    assert np.shape(left["response"]) == (3, 3)
    assert str(made[0]) not in json.dumps(about)  # the same from a copy of the flight


def test_the_same_input_gives_the_same_bytes_and_is_not_rendered_again(rendered):
    folder, first = rendered()
    before = {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.iterdir()}
    _, second = rendered()
    assert (second.rendered, second.kept) == ((), first.rendered)
    for name in ("E0.tif", "E1.tif"):
        assert (folder / name).stat().st_mtime_ns == before[name][0]
    (folder / "E0.tif").unlink()
    _, third = rendered()
    assert (third.rendered, third.kept) == (("E0",), ("E1",))
    assert (folder / "E0.tif").read_bytes() == before["E0.tif"][1]


def test_what_depends_on_a_changed_file_or_option_is_rendered_again(rendered, own):
    rendered(of=own)
    _, other = rendered(of=own, blend="stack")
    assert other.rendered == ("E0", "E1")
    path = pictured.head_path(own[0], "E1", "LEFT")
    tifffile.imwrite(path, tifffile.imread(path) + 100, photometric="rgb")  # of the same size
    _, changed = rendered(of=own, blend="stack")
    assert (changed.rendered, changed.kept) == (("E1",), ("E0",))
    _, flight_wide = rendered(of=own)  # the response of all is from both
    assert flight_wide.rendered == ("E0", "E1")


def test_a_bad_file_is_named_and_the_others_are_finished(rendered, own):
    path = pictured.head_path(own[0], "E0", "RIGHT")
    path.write_bytes(path.read_bytes()[:-5000])
    folder, report = rendered(of=own)
    assert report.rendered == ("E1",)
    (problem,) = report.problems
    assert problem.startswith(f"E0: {path}: ends after")
    assert names(folder) == ["E1.tif", "E1_preview.jpg", "images.csv"]


def test_only_named_exposures_need_all_files(rendered, own):
    flight, _ = own
    table = pd.read_csv(flight / "heads" / "images.csv", dtype=str, keep_default_na=False)
    table.loc[table["image"] == "E1_LEFT", "file"] = ""
    table.to_csv(flight / "heads" / "images.csv", index=False)
    _, report = rendered(of=own)
    assert (report.rendered, report.problems) == (("E0",), ())
    assert "left out, without the files of all heads: E1" in report.notes
    _, report = rendered(of=own, exposures=["E1", "E0", "E1"])
    assert report.kept == ("E0",)
    (problem,) = report.problems
    assert problem.startswith(f"E1: {flight}/heads/images.csv: exposure E1: no file for LEFT")


def test_an_exposure_without_files_is_named_with_those_that_have_them(rendered):
    with pytest.raises(FlightError) as error:
        rendered(exposures=["E0", "E7"])
    assert error.value.problems == ("exposure E7: no files of this exposure; complete are E0, E1",)


def test_heads_are_needed_with_their_orientation(rendered, own, tmp_path):
    flight, results = own
    with pytest.raises(FlightError, match="no results of stage heads; run first"):
        rendered(of=(flight, tmp_path / "nothing"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(FlightError, match="no results of stage heads; run first"):
        rendered(of=(flight, tmp_path / "empty"))
    said = {"heads/relative_orientation": {"left_out": ["RIGHT is not determined"]}}
    found_results.replace(results, ["heads/relative_orientation"], tables={}, summary=said)
    with pytest.raises(AdjustmentError, match="RIGHT is not determined"):
        rendered(of=own)


def test_a_refined_orientation_goes_before_the_other(rendered, own):
    refined = pictured.orientation()
    provenance.write(
        own[1],
        "synthetic",
        [tables.of_relative_orientation("synthetic/refined", refined)],
        flight=flights.read(own[0]),
    )
    _, report = rendered(of=own)
    assert report.notes[0] == f"heads as {own[1]} has them, synthetic/refined"


def test_a_stack_has_the_bands_of_every_head(rendered):
    folder, report = rendered(blend="stack", exposures=["E0"])
    assert not any(note.startswith("response") for note in report.notes)
    stack, scene = image(folder, "E0"), pictured.frame_of(pictured.scene(1))
    assert stack.shape == (375, 500, 6)
    for bands in np.split(stack, 2, axis=2):
        seen = binary_erosion((bands > 0).all(axis=2), iterations=2)
        assert np.sqrt(np.mean((bands.astype(float) - scene)[seen] ** 2)) < 0.03 * scene.std()
