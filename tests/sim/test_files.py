"""Mistakes in measurements are those that the truth lists, and no others."""

import json

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import acx4sim
from acx4sim.plan import GrossErrors, SlowErrors

BLOCK = ("calibration",)


SHIFT = ["east_m", "north_m", "height_m"]


def acx4(**options):
    return acx4sim.acx4_ideal(seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


def single_head(**options):
    return acx4sim.DESIGNS["single-head"](seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


@pytest.fixture(scope="module")
def plain():
    return acx4()


@pytest.fixture(scope="module")
def spoiled():
    return acx4(gross_errors=GrossErrors())


def changed(flight, other, name):
    """Return the differences of the number columns, rows without any left out."""
    a, b = flight.tables[name], other.tables[name]
    numbers = a.select_dtypes("number").columns
    difference = (b[numbers] - a[numbers]).set_index(pd.MultiIndex.from_frame(a.iloc[:, :2]))
    return difference[(difference != 0).any(axis=1)]


def mistakes(flight, kind):
    return [m for m in flight.truth["gross_errors"] if m["kind"] == kind]


def test_exactly_the_listed_image_points_are_wrong_by_what_is_listed(plain, spoiled):
    found = changed(plain, spoiled, "calibration/image_points.csv")
    listed = {(m["image_or_exposure"], m["point"]): m for m in mistakes(spoiled, "image_point")}
    assert set(found.index) == set(listed)
    for where, row in found.iterrows():
        told = [listed[where]["col_px"], listed[where]["row_px"]]
        assert_allclose(row[["col_px", "row_px"]].to_numpy(float), told, atol=2e-6)


def test_two_percent_of_the_image_points_are_wrong_by_5_to_200_px(plain, spoiled):
    size = [np.hypot(m["col_px"], m["row_px"]) for m in mistakes(spoiled, "image_point")]
    n = len(plain.tables["calibration/image_points.csv"])
    assert abs(len(size) - 0.02 * n) < 3.3 * np.sqrt(0.02 * n)  # binomial, 0.1 %
    assert min(size) >= 5 - 1e-6
    assert max(size) <= 200 + 1e-6
    assert abs(np.median(size) - np.sqrt(5 * 200)) < 10  # logarithmic: as many below 32 px


def test_spoiled_measurements_stay_on_the_sensor(plain, spoiled):
    measured = spoiled.tables["calibration/image_points.csv"]
    assert measured["col_px"].between(0, 11999).all()
    assert measured["row_px"].between(0, 16199).all()


def test_one_position_is_3_m_off_and_no_other(plain, spoiled):
    (told,) = mistakes(spoiled, "gnss")
    found = changed(plain, spoiled, "calibration/trajectory.csv")[SHIFT]
    found = found[(found.abs() > 1e-5).any(axis=1)]
    assert found.index.get_level_values("exposure").tolist() == [told["image_or_exposure"]]
    assert_allclose(found.to_numpy()[0], [told[name] for name in SHIFT], atol=2e-6)
    assert np.linalg.norm(found.to_numpy()) == pytest.approx(3.0, abs=1e-5)


def test_another_exposures_heading_is_wrong_by_what_is_listed():
    """Where the tables have headings; body and horizon are a degree apart, hence the tolerance."""
    flights = single_head(), single_head(gross_errors=GrossErrors())
    (told,) = mistakes(flights[1], "attitude")
    found = changed(*flights, "calibration/trajectory.csv")["heading_deg"]
    found = found[found.abs() > 1e-5]
    assert found.index.get_level_values("exposure").tolist() == [told["image_or_exposure"]]
    assert abs(told["heading_deg"]) == 0.3
    assert found.iloc[0] == pytest.approx(told["heading_deg"], rel=2e-3)
    assert told["image_or_exposure"] != mistakes(flights[1], "gnss")[0]["image_or_exposure"]


def test_one_coordinate_of_a_control_point_in_images_is_a_metre_off(plain, spoiled):
    (told,) = mistakes(spoiled, "control_point")
    (name,) = set(told) & set(SHIFT)
    a, b = (f.tables["control_points.csv"].set_index("point")[SHIFT] for f in (plain, spoiled))
    difference = b - a
    assert difference.loc[told["point"], name] == pytest.approx(told[name], abs=2e-6)
    assert (difference != 0).to_numpy().sum() == 1
    assert abs(told[name]) == 1.0
    measured = plain.tables["calibration/image_points.csv"]["point"]
    assert (measured == told["point"]).sum() >= 4


def test_the_truth_with_its_mistakes_is_json_and_the_flight_hides_them(spoiled, plain):
    assert json.loads(json.dumps(spoiled.truth))["gross_errors"] == spoiled.truth["gross_errors"]
    assert spoiled.truth["exposures"] == plain.truth["exposures"]
    assert spoiled.toml == plain.toml


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GrossErrors(image_points=1.2), "must be a share"),
        (lambda: GrossErrors(image_px=(9.0, 5.0)), "the lower first"),
        (lambda: acx4(gross_errors=GrossErrors(block="heads")), "'heads' is not simul"),
        (lambda: SlowErrors(gnss=-0.1), "gnss must be a share"),
        (lambda: SlowErrors(gnss_constant_s=0.0), "gnss_constant_s must be positive"),
        (lambda: acx4sim.Options(refraction="some"), "refraction is 'none' or 'standard'"),
    ],
)
def test_misuse_is_a_value_error(make, message):
    with pytest.raises(ValueError, match=message):
        make()
