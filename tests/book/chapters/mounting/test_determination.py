"""Tables on what is determined: one of a run, one of what any flight needs."""

from dataclasses import replace

import pytest

from acx4book.chapters.mounting.determination import geometry_page, geometry_table
from acx4book.chapters.mounting.tables import determination
from acx4book.typesetting.labels import LABELS
from acx4lib.calibration import estimates, mounting
from acx4lib.calibration.trust.determination import strong_correlations
from acx4lib.calibration.trust.needs import needed
from acx4lib.geometry.parameters import REPORTED
from support import blocks


@pytest.fixture(scope="module")
def table(noisy_block):
    found = mounting.single_step(noisy_block, free=("f", "xp", "yp", "k1", "k2", "k3"))
    return found, determination({"single_step": found})


@pytest.fixture(scope="module")
def two_cameras():
    aft = replace(blocks.CAMERA, name="AFT")
    block = blocks.standard(cameras=(blocks.CAMERA, aft))
    return mounting.single_step(block, free=("k1", "k2"))


def test_a_method_has_its_condition_and_its_correlations(table):
    found, rows = table
    (row,) = rows.to_dict("records")
    assert row["Method"] == "Single-step"
    power = f"{found.bundle.solution.condition:.0e}"
    assert row["Condition"].startswith(power[0] + "·10")
    pair = strong_correlations(found.calibration)[0]
    assert {pair.row, pair.column} <= {"CAM/k1", "CAM/k2", "CAM/k3"}
    assert row["Correlations above 0.9"].startswith(
        f"{LABELS[pair.row[4:]]}, {LABELS[pair.column[4:]]} {pair.correlation:+.2f}".replace(
            "-", "\N{MINUS SIGN}"
        )
    )
    assert row["Weakest combination"].split("; ")[0].endswith(" %")
    assert "CAM" not in row["Weakest combination"]


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


def test_several_cameras_are_told_apart(two_cameras):
    (row,) = determination({"single_step": two_cameras}).to_dict("records")
    listed = row["Correlations above 0.9"].split("; ")
    assert "CAM $k_1$, CAM $k_2$" in listed[0] or "AFT $k_1$, AFT $k_2$" in listed[0]
