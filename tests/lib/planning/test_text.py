"""Plans from TOML: what is read, what is wrong and where, what is written."""

import datetime as dt
import re
import tomllib

import pytest

from acx4lib.errors import FlightError
from acx4lib.planning import text
from support.flights.planned import values
from support.helpers import ROOT

PLAN = text.written(values())


def problems(written, tmp_path):
    """Return the problems of a plan's text, without the path."""
    path = tmp_path / "p.toml"
    path.write_text(written)
    with pytest.raises(FlightError) as error:
        text.read(path)
    return [line.removeprefix(str(path)) for line in error.value.problems]


def test_what_is_written_is_read_again(tmp_path):
    (tmp_path / "p.toml").write_text(PLAN)
    read, made = text.read(tmp_path / "p.toml"), text.from_values(values())
    assert read.values == made.values
    assert read.setup.apriori == made.setup.apriori
    assert read.blocks["calibration"].strips == made.blocks["calibration"].strips
    assert text.written(read.values) == PLAN


def test_text_that_toml_escapes_is_written_so_that_it_is_read():
    day = dt.date(2026, 5, 2)
    odd = {
        "name": 'a "b" \\ é\x7f',
        "on": day,
        "t": {"a b": 1.5, "on": True, "at": [[1, 2], [3.5, 4]]},
    }
    assert tomllib.loads(text.written(odd)) == odd


def test_an_overlap_becomes_a_base_by_the_side_of_the_image_along_the_flight():
    # turned by 90 degrees: the short side, 8708 px of 4.6 um, lies along the flight
    strip = {"flying_height_m": 500.0, "course_deg": 0.0, "length_m": 300.0, "overlap": 0.75}
    plan = text.from_values(values(calibration={"strips": {"s": strip}, "tie_points": 0}))
    base = plan.blocks["calibration"].strips["s"].base_m
    assert base == pytest.approx(0.25 * 8708 * 0.0046 * 500 / 50)


def test_parallel_strips_lie_beside_each_other_and_are_flown_to_and_fro():
    strip = {
        "flying_height_m": 500.0,
        "course_deg": 90.0,
        "length_m": 300.0,
        "base_m": 100.0,
        "parallel": 3,
        "side_overlap": 0.5,
    }
    plan = text.from_values(values(calibration={"strips": {"s": strip}, "tie_points": 0}))
    strips = plan.blocks["calibration"].strips
    assert [*strips] == ["s-1", "s-2", "s-3"]
    assert [s.course_deg for s in strips.values()] == [90.0, 270.0, 90.0]
    # to the left of a course to the east is north, the axis forward
    apart = 0.5 * 11608 * 0.0046 * 500 / 50
    assert [s.forward_m for s in strips.values()] == pytest.approx([apart, 0.0, -apart])
    assert [s.left_m for s in strips.values()] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def changed(old, new):
    assert PLAN.count(old) == 1
    return PLAN.replace(old, new)


LOW = PLAN.splitlines().index("[calibration.strips]") + 2
"""Line of the first strip."""

FIELD = PLAN.splitlines().index("[field]") + 1

WRONG = {
    "a misspelt table": (
        changed("[field]", "[feild]"),
        [
            ":1: field: missing; required",
            f":{FIELD}: feild: unknown key (did you mean 'field'?); must be one of name,",
        ],
    ),
    "a number that is text": (
        changed("east_m = 385000.0", 'east_m = "385000"'),
        [": field.east_m: '385000'; must be a number"],
    ),
    "a height beyond all aircraft": (
        changed("low-1 = {flying_height_m = 600.0", "low-1 = {flying_height_m = 60000.0"),
        [
            f":{LOW}: calibration.strips.low-1.flying_height_m: 60000.0; "
            "must lie between 1 and 30000"
        ],
    ),
    "a strip without a base": (
        changed(
            "low-1 = {flying_height_m = 600.0,", "low-1 = {overlap = 0.8, flying_height_m = 1,"
        ),
        [f":{LOW}: calibration.strips.low-1: both base_m and overlap; needs one of the two"],
    ),
    "an unknown key of a strip": (
        changed("low-1 = {flying_height_m", "low-1 = {height = 3, flying_height_m"),
        [f":{LOW}: calibration.strips.low-1.height: unknown key"],
    ),
    "a strip that is no table": (
        changed("[calibration.strips]\n", "[calibration.strips]\nx = 3\n"),
        [f":{LOW}: calibration.strips.x: 3; must be a table, as {{flying_height_m = 600"],
    ),
    "a field where there is no map": (
        changed("east_m = 385000.0", "east_m = 99999999.0"),
        [f":{FIELD + 1}: field.east_m: 1e+08 east, 5.518e+06 north; must lie where EPSG:32633"],
    ),
    "a layout that is unknown": (
        changed("number = [3, 3]", 'layout = "grdi"\nnumber = [3, 3]'),
        [": control.layout: 'grdi' (did you mean 'grid'?); must be one of grid, corners"],
    ),
    "a grid with one number": (
        changed("number = [3, 3]", "number = 9"),
        [": control.number: 9; must be a list of 2 numbers"],
    ),
    "a camera's mistake": (
        changed("pixel_um = 4.6", "pixel_um = 0.0046"),
        [": cameras.CAM.pixel_um: 0.0046 (millimetres or metres?); must lie between"],
    ),
    "no block": (
        PLAN[: PLAN.index("[calibration]")],
        [":1: calibration: no block at all; needs one of heads, calibration, validation"],
    ),
    "too many exposures": (
        changed(
            "low-1 = {flying_height_m = 600.0",
            "low-1 = {parallel = 200, spacing_m = 9, flying_height_m = 600.0",
        ).replace("length_m = 600.852", "length_m = 600852.0"),
        [": calibration.strips: "],
    ),
    "a truth that is no camera's": (
        PLAN + "\n[truth.OTHER]\nfocal_mm = 3.0\n",
        [": truth.OTHER: unknown key; must be one of CAM"],
    ),
    "a truth outside its range": (
        PLAN + "\n[truth.CAM]\nfocal_mm = 0.05\n",
        [": truth.CAM.focal_mm: 0.05 (metres?); must lie between 1 and 10000"],
    ),
    "no TOML": (changed("[field]", "[field"), [": character"]),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_named_with_line_key_and_cure(name, tmp_path):
    written, expected = WRONG[name]
    found = problems(written, tmp_path)
    assert len(found) == len(expected)
    for line, part in zip(sorted(found, key=lambda p: part_of(p, expected)), expected, strict=True):
        assert part in line


def part_of(line, expected):
    return next((i for i, part in enumerate(expected) if part in line), len(expected))


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FlightError, match=r"nothing\.toml"):
        text.read(tmp_path / "nothing.toml")


def test_a_validation_needs_check_points_and_heads_need_more_than_one_camera():
    strips = values()["calibration"]["strips"]
    with pytest.raises(FlightError, match=r"validation\.check: missing"):
        text.from_values(values(validation={"strips": strips}))
    with pytest.raises(FlightError, match="heads: one camera; heads are several"):
        text.from_values(values(heads={"strips": strips}))


def test_the_plans_in_the_book_can_be_read(tmp_path):
    page = (ROOT / "book" / "planning.md").read_text("utf-8")
    shown = [
        part for part in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "[field]" in part
    ]
    for part in shown:
        (tmp_path / "p.toml").write_text(part)
        assert "calibration" in text.read(tmp_path / "p.toml").blocks
    plan = text.from_values(tomllib.loads(shown[0]))
    assert [*plan.blocks["calibration"].strips] == ["low-1", "low-2", "high", "back"]


def test_a_middle_in_degrees_is_named(tmp_path):
    field = {"east_m": 13.4, "north_m": 49.8, "height_m": 430.0, "relief_m": 20.0}
    (line,) = problems(text.written(values(field=field)), tmp_path)
    assert re.fullmatch(
        r":\d+: field.east_m: 13.4 east, 49.8 north \(longitude, latitude in degrees\?\); "
        r"must be metres where EPSG:32633 is meant for",
        line,
    )
