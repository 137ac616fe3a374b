"""The chapter's flight, measured once; it takes half a minute."""

import numpy as np
import pytest

from acx4book.chapters import from_pictures
from acx4book.chapters.from_pictures import EXPOSURES


@pytest.fixture(scope="session")
def measured():
    """Return the flight with what was measured, and its single step."""
    found, mounting = from_pictures.measured(1)
    yield found, mounting
    found.folder.cleanup()


@pytest.fixture(scope="session")
def found(measured):
    return measured[0]


pytestmark = pytest.mark.repeats


def test_nothing_but_the_pictures_was_measured(found):
    assert found.block.images.names == EXPOSURES
    assert len(found.block.image_points) == len(found.outcome.matched.rays) + len(
        found.outcome.surveyed.rows
    )


def test_ties_and_control_are_good_to_a_tenth_of_a_pixel(found):
    ties, control = from_pictures.of_ties(found), from_pictures.of_control(found)
    assert ties.rms < 0.1
    assert control.rms < 0.1
    assert ties.wrong == control.wrong == 0


def test_a_shifted_measurement_is_seen(found):
    errors = from_pictures.of_control(found)
    assert np.all(np.abs(errors.off) < 0.5)
    moved = type(errors)(**{**errors.__dict__, "off": errors.off + 2.0})
    assert moved.wrong == len(errors.off)


def test_points_of_one_height_have_no_ray_of_the_other(found):
    errors = from_pictures.of_ties(found)
    alike = from_pictures.same_height(found, errors)
    strips = np.array([found.block.images.strips[i] in ("4", "5") for i in errors.image_idx])
    for point in np.unique(errors.point_idx[alike])[:50]:
        own = strips[errors.point_idx == point]
        assert own.all() or not own.any()


def test_patches_of_four_pictures_are_shown_twice(found):
    fig = from_pictures.patches(found.outcome)
    assert len(fig.axes) == 8
    assert [ax.images[0].get_array().shape for ax in fig.axes] == [(49, 49)] * 8


def test_points_lie_on_the_picture(found):
    ax = from_pictures.cover(found.outcome, found.block).axes[0]
    rows, cols = ax.images[0].get_array().shape
    x, y = (values for line in ax.lines[2:3] for values in line.get_data())
    assert x.min() > 0
    assert x.max() < cols
    assert y.max() < rows


def test_errors_rise_to_one(found):
    ties = from_pictures.of_ties(found)
    fig = from_pictures.sizes(ties, from_pictures.same_height(found, ties))
    assert [line.get_ydata()[-1] for line in fig.axes[0].lines] == [1.0, 1.0]


def test_rows_add_up_to_all_measurements(found):
    shown = from_pictures.pictures(found.block)
    total = shown["tie points"].sum() + shown["control points"].sum()
    assert total == len(found.block.image_points)
    assert shown["height (m)"].between(550, 1050).all()
    assert abs(abs(shown["heading (°)"][0] - shown["heading (°)"][2]) - 180) < 5  # opposite


def test_every_parameter_is_within_four_sigma_of_the_truth(measured):
    found, mounting = measured
    table = from_pictures.camera(mounting, found.truth(mounting))
    assert len(table) == 14
    assert (table["difference / σ"].abs() < 4).all()
    off = table["value"] - table["truth"].str.replace("\N{MINUS SIGN}", "-").iloc[:3].astype(float)
    assert (off.dropna().abs() < 0.01).all()
