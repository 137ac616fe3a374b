"""The page on which geometry determines which parameter."""

from acx4book.pages.geometry import geometry_page, geometry_table
from acx4book.typesetting.labels import LABELS
from acx4lib.calibration import estimates
from acx4lib.calibration.trust.needs import needed
from acx4lib.geometry.parameters import REPORTED


def test_every_parameter_stands_once_among_those_that_need_a_geometry():
    listed = ", ".join(geometry_table()["Parameter"]).split(", ")
    assert sorted(listed) == sorted(LABELS[name] for name, _ in REPORTED.values())


def test_limits_and_geometries_are_those_of_the_messages():
    rows = geometry_table().set_index("Parameter")
    assert rows.loc["lever arm $z$", "It needs"] == needed("lever_z")
    assert rows.loc["lever arm $z$", "Largest σ"] == f"{estimates.LIMIT_LEVER_M:g} m"
    assert rows.loc["$x_p$, $y_p$", "Largest σ"] == "0.2 % of $f$"
    assert rows.loc["boresight $\\kappa$", "Largest σ"] == "0.1°"
    assert rows.loc["$k_1$", "Largest σ"] == "any"
    assert ":name: tab-geometry" in geometry_page()
