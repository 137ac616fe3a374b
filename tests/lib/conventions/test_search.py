"""Mistakes planted in flights are named, clean flights get no sentence."""

from __future__ import annotations

from itertools import cycle, product

import numpy as np
import pandas as pd
import pytest

from acx4lib.conventions.search import Found, best_reading, notes
from acx4lib.errors import FlightError
from acx4lib.flight.reader import read
from support.flights import planted, sized
from support.helpers import repeats

VARIANTS = list(product(sized.DESIGNS, ("small", "medium"), sized.FORMS))


def cases():
    """Return every mistake in two of the variants, all variants in turn."""
    turn = cycle(VARIANTS)
    for name, mistake in planted.MISTAKES.items():
        for form in mistake.forms:
            design, size = next((d, s) for d, s, f in turn if f == form)
            yield pytest.param(name, design, size, form, id=f"{name}, {design}, {size}, {form}")


def said(folder):
    """Return what `acx4 check` says of the calibration block."""
    try:
        flight = read(folder)
    except FlightError as error:
        return str(error)
    found = best_reading(flight, "calibration")
    return found.sentence if found else ""


@pytest.mark.parametrize(("name", "design", "size", "form"), list(cases()))
def test_a_planted_mistake_is_named(tmp_path, name, design, size, form):
    mistake = planted.MISTAKES[name]
    flight = sized.clean(design, form, size)
    message = said(planted.write(flight, tmp_path / "flight", mistake))
    assert planted.is_right(mistake, form, message), message


@pytest.mark.parametrize(("design", "size", "form"), VARIANTS)
@pytest.mark.parametrize("seed", [1, repeats(2), repeats(3)])
def test_a_clean_flight_gets_no_sentence(tmp_path, design, size, form, seed):
    flight = sized.clean(design, form, size, seed=seed)
    assert said(planted.write(flight, tmp_path / "flight")) == ""


@pytest.mark.parametrize("name", ["sign of roll", "gon", "the next row", "row from the bottom"])
@pytest.mark.parametrize("form", sized.FORMS)
def test_tie_points_are_enough(tmp_path, name, form):
    mistake = planted.MISTAKES[name]
    flight = sized.clean("single-head", form, "small")
    for folder, planted_in in (("right", None), ("wrong", mistake)):
        planted.write(flight, tmp_path / folder, planted_in)
        control = pd.read_csv(tmp_path / folder / "control_points.csv")
        control[:0].to_csv(tmp_path / folder / "control_points.csv", index=False)
    assert said(tmp_path / "right") == ""
    assert planted.is_right(mistake, form, said(tmp_path / "wrong"))


def test_too_few_exposures_say_nothing(tmp_path):
    folder = planted.write(
        sized.clean("single-head", "geodetic", "small"),
        tmp_path / "flight",
        planted.MISTAKES["sign of roll"],
    )
    images = pd.read_csv(folder / "calibration/images.csv")[:5]
    points = pd.read_csv(folder / "calibration/image_points.csv")
    images.to_csv(folder / "calibration/images.csv", index=False)
    points[points["image"].isin(images["image"])].to_csv(
        folder / "calibration/image_points.csv", index=False
    )
    assert best_reading(read(folder), "calibration") is None


def test_gross_errors_do_not_hide_a_sign(tmp_path):
    folder = planted.write(
        sized.clean("single-head", "geodetic", "medium"),
        tmp_path / "flight",
        planted.MISTAKES["sign of pitch"],
    )
    points = pd.read_csv(folder / "calibration/image_points.csv")
    points.loc[::20, "col_px"] += 60.0  # 5 %
    points.to_csv(folder / "calibration/image_points.csv", index=False)
    (sentence,) = notes(read(folder))
    assert sentence.startswith("calibration: with pitch of opposite sign the residuals of attitude")


def test_a_block_that_is_not_there_is_named(tmp_path):
    flight = read(planted.write(sized.clean("single-head", "grid", "small"), tmp_path / "f"))
    with pytest.raises(FlightError, match="no block heads"):
        best_reading(flight, "heads")


@pytest.mark.parametrize(
    ("given", "found", "unit", "says"),
    [
        (0.61, 0.0061, "°", "the residuals of it fall from 0.61° to 0.0061°"),
        (418.2, 0.16, "m", "the residuals of it fall from 418 m to 0.16 m"),
        (3e-4, 1.04, "σ", "the residuals of it rise from 0.0003 σ to 1 σ"),
        (np.inf, 1.2, "px", "the residuals of it are 1.2 px; as the numbers are, rays do not meet"),
    ],
)
def test_the_figure_stands_beside_the_given_one(given, found, unit, says):
    reading = Found(name="this", quantity="it", given=given, found=found, unit=unit)
    assert reading.sentence == f"with this {says}"
