"""Single rows of control points that are absurd: named and rejected, and nothing else changes."""

import csv
from dataclasses import replace

import numpy as np
import pytest

import acx4sim
from acx4lib import flight
from acx4lib.bundle.gross_errors.rejections import Rejection, without
from acx4lib.calibration import heads, mounting
from acx4lib.calibration.estimates import from_bundle, given
from acx4lib.errors import FlightError
from acx4lib.flight.design import ground_height
from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.georeferencing.validation import validate
from acx4lib.results.validations import of_validation
from support.flights.simulated import HEADS, fly, named, of_calibration
from support.helpers import repeats


def by(metres):
    """Return what moves a coordinate."""
    return lambda cell: repr(float(cell) + metres)


ABSURD = {
    "east 90": {"east_m": "90"},
    "0, 0": {"east_m": "0", "north_m": "0"},
    "100 km": {"north_m": by(1e5)},
    "1e8": {"east_m": "1e8"},
    "1 km": {"east_m": by(1e3)},
    "160 m": {"east_m": by(160.0)},
    "height 0": {"height_m": "0"},
    "too high": {"height_m": "1e5"},
    "degrees": {"east_m": "-49.3", "north_m": "-25.4"},
}


def spoil(folder, design, values, rows, *, table="control_points.csv", options=None):
    """Write a simulated flight and change rows of control; return the folder and their names."""
    acx4sim.write(acx4sim.DESIGNS[design](seed=1, options=options or acx4sim.Options()), folder)
    with (folder / table).open(newline="") as file:
        lines = list(csv.reader(file))
    for row in rows:
        for name, value in values.items():
            at = lines[0].index(name)
            lines[row][at] = value(lines[row][at]) if callable(value) else value
    with (folder / table).open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(lines)
    return folder, [lines[row][0] for row in rows]


def lacking(block, names):
    """Return a block whose control does not have some points."""
    rows = [k for k, i in enumerate(block.control.point_idx) if block.points[i] in names]
    return without(
        block, [Rejection(kind="control_point", row=k, component=-1, statistic=0.0) for k in rows]
    )


def assert_as_without(found, clean, names, block):
    """Assert that a bundle is what it is without these points, and that they are named.

    Of a point with three rays these may go as well; that moves a head by 0.03 sigma.
    """
    a, b = of_calibration(from_bundle(found)), of_calibration(from_bundle(clean))
    known = a.sigma > 0
    np.testing.assert_allclose((a.values - b.values)[known] / a.sigma[known], 0, atol=0.05)
    said = {point for kind, _, point in named(block, found.rejected) if kind == "control_point"}
    assert set(names) <= said
    more = named(block, found.rejected) - named(block, clean.rejected)
    assert {point for _, _, point in more} <= set(names)


@pytest.mark.parametrize("rows", [repeats([3]), [3, 12]], ids=["one", "two"])
@pytest.mark.parametrize("kind", ABSURD)
def test_absurd_control_is_rejected_in_a_single_step(tmp_path, kind, rows):
    options = acx4sim.Options(blocks=("calibration",))
    path, names = spoil(tmp_path / "f", "single-head", ABSURD[kind], rows, options=options)
    spoilt, clean = flight.read(path), fly("single-head", seed=1).flight
    free = clean.estimate_mounting
    found = mounting.calibrate(spoilt.calibration, free=free)
    assert not found.failures
    reference = mounting.single_step(lacking(clean.calibration, names), free=free)
    bundle = found["single_step"].bundle
    assert_as_without(bundle, reference.bundle, names, spoilt.calibration)
    chance = named(clean.calibration, reference.bundle.rejected)
    absurd = {("control_point", "", name) for name in names}
    assert named(spoilt.calibration, bundle.rejected) == chance | absurd
    for method in ("two_step", "two_step_gnss"):
        assert found[method].bundle.rejected == bundle.rejected


@pytest.mark.parametrize(
    "kind", ["160 m", "too high", *map(repeats, ("east 90", "1e8", "height 0", "degrees"))]
)
def test_absurd_control_is_rejected_in_every_head_that_sees_it(tmp_path, kind):
    options = acx4sim.Options(blocks=("heads",))
    path, names = spoil(tmp_path / "f", "acx4", ABSURD[kind], [3, 12], options=options)
    spoilt, clean = flight.read(path), fly("acx4", seed=1, blocks=("heads",)).flight
    free = clean.estimate_heads
    found = heads.calibrate_heads(spoilt.heads, HEADS, free=free)
    assert not found.failures
    reference = heads.calibrate_heads(lacking(clean.heads, names), HEADS, free=free)
    for head, bundle in found.bundles.items():
        own = bundle.network.block
        seen = [own.points[i] for i in np.flatnonzero(own.rays) if own.points[i] in names]
        assert_as_without(bundle, reference.bundles[head], seen, own)


@pytest.mark.parametrize("kind", ["east 90", "1e8", "height 0", "too high"])
def test_an_absurd_check_point_is_rejected_and_the_others_stay(tmp_path, kind):
    options = acx4sim.Options(blocks=("validation",))
    table = "validation/control_points.csv"
    path, names = spoil(
        tmp_path / "f", "single-head", ABSURD[kind], [3, 5], table=table, options=options
    )
    spoilt = flight.read(path).validation
    clean = fly("single-head", seed=1, blocks=("validation",)).flight.validation
    found, reference = (validate(b, given(b.cameras), method="given") for b in (spoilt, clean))
    record = of_validation(found).tables
    rejected = record["rejected"]
    rejected = rejected[rejected["kind"] == "control_point"]
    assert list(rejected["point"]) == names
    assert rejected["reason"].str.fullmatch(r"position: w = \d+\.\d exceeds 3.9").all()
    other = of_validation(reference).tables["check_points"]
    other = other[~other["point"].isin(names)]
    np.testing.assert_array_equal(record["check_points"]["d_east_m"], other["d_east_m"])
    assert found.n_left_out == reference.n_left_out


def test_a_check_point_that_is_off_by_metres_stays_for_all_to_see(tmp_path):
    options = acx4sim.Options(blocks=("validation",))
    table, moved = "validation/control_points.csv", {"east_m": by(10.0)}
    path, _ = spoil(tmp_path / "f", "single-head", moved, [3], table=table, options=options)
    block = flight.read(path).validation
    found = validate(block, given(block.cameras), method="given")
    assert not [r for r in found.rejected if r.kind == "control_point"]
    assert np.abs(found.points.d[:, 0]).max() > 9


@pytest.mark.parametrize("kind", ["east 90", "1e8", "too high"])
def test_a_single_absurd_row_is_a_note_and_named(tmp_path, kind):
    path, (first, second) = spoil(tmp_path / "f", "single-head", ABSURD[kind], [3, 12])
    (note,) = [n for n in flight.read(path).notes if "nowhere near" in n]
    assert note.startswith(f"calibration: 2 of 20 surveyed points of {path / 'control_points.csv'}")
    assert f"{first!r} (line 4)" in note
    assert f"{second!r} (line 13)" in note


@pytest.mark.parametrize(("kind", "said"), [("1e8", "is nowhere"), ("too high", "is below")])
def test_more_than_single_absurd_rows_are_refused_as_ever(tmp_path, kind, said):
    path, _ = spoil(tmp_path / "f", "single-head", ABSURD[kind], [3, 6, 12])
    with pytest.raises(FlightError, match=said):
        flight.read(path)


def test_an_absurd_height_is_no_part_of_the_ground(tmp_path):
    path, _ = spoil(tmp_path / "f", "single-head", ABSURD["too high"], [3])
    spoilt, clean = flight.read(path), fly("single-head", seed=1).flight
    for name, block in spoilt.blocks.items():
        # the mean of the surveyed points is that of one point fewer
        assert ground_height(block) == pytest.approx(ground_height(clean.blocks[name]), abs=2.0)


def test_a_bad_start_casts_no_doubt_on_single_points(exact_block):
    """The mounting 12 degrees off, which every point shows alike: none is taken out."""
    turn = rotation_from_opk(np.radians([12.0, 0.0, 0.0]))
    turned = [replace(c, T_b_c=replace(c.T_b_c, R=c.T_b_c.R @ turn)) for c in exact_block.cameras]
    found = mounting.single_step(replace(exact_block, cameras=tuple(turned)), free=("xp", "yp"))
    assert found.bundle.rejected == ()
