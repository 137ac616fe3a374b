"""Radial distortion of the synthetic image beside Table 3's."""

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters.beyond.synthetic_cost import radial, study


def test_it_is_the_polynomial_of_eq_7():
    found = radial.radial_um(np.array([1e-7, 1e-10, 1e-13]), np.array([10.0, 0.0]))
    assert found == pytest.approx([1000 * (1e-4 + 1e-5 + 1e-6), 0])


def test_the_radius_ends_at_the_corner_of_the_frame():
    assert radial.radius_mm()[-1] == pytest.approx(np.hypot(67.2, 90.72) / 2)


def test_a_line_is_followed_to_the_focal_length_of_the_print():
    differences = pd.DataFrame({"k1": [-1.0, 1.0], "k2": [-3.0, -1.0]}, index=[74.0, 74.2])
    assert radial.focal_lengths(differences) == pytest.approx([74.1, 74.3])


def test_the_print_itself_is_no_sigma_away():
    found = study.read()
    own = found.sweep.copy()
    for name, value in zip(radial.RADIAL, radial.printed_with_sigma()[0], strict=True):
        own.loc[(own["camera"] == "SYN") & (own["parameter"] == name), "value"] = value
    planted = study.Study(**{**vars(found), "sweep": own})
    assert all((table == 0).all(axis=None) for table in radial.in_sigma(planted).values())


def test_without_distance_of_the_centres_there_is_hardly_any_distortion():
    curves = radial.squares(study.read())
    corner = radial.radial_um(curves.to_numpy().T, radial.radius_mm())[-1]
    assert abs(corner[0]) < 0.5
    assert corner[2] == pytest.approx(2 * corner[1], rel=0.1)  # in proportion to the side
