"""Flights from tables in memory: the same as from files, and told as clearly when wrong."""

# ruff: noqa: E501 a message stands on one line

import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal

from acx4lib.calibration import mounting
from acx4lib.errors import FlightError
from acx4lib.flight import reader
from acx4lib.flight.from_tables import from_tables
from support import blocks
from support.flights import written

TEXT = dict.fromkeys(("image", "camera", "exposure", "strip", "point"), str)
CONTROL = written.control_points()
SETTINGS = tomllib.loads(written.TOML + written.CAMERA.format(*written.MOUNTS["CAM"], name="CAM"))
TABLES = {
    "images": written.images(written.exposures(), ["CAM"]),
    "image_points": written.measure(written.exposures(), CONTROL, ["CAM"]),
    "trajectory": written.exposures(),
}
N = len(TABLES["image_points"])


def changed(table, **columns):
    """The good tables with some columns of one of them replaced, as a dict of arrays."""
    kept = {name: cells.to_numpy() for name, cells in TABLES[table].items()}
    return {**TABLES, table: {**kept, **columns}}


def told(settings=SETTINGS, control=CONTROL, **tables):
    with pytest.raises(FlightError) as caught:
        from_tables(settings, control_points=control, **tables)
    return list(caught.value.problems)


def arrays(value):
    """Every array of a frozen value, with the names of its fields."""
    return {name: one for name, one in vars(value).items() if isinstance(one, np.ndarray)}


# --- what is right ---------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["grid", "geographic"])
@pytest.mark.parametrize("table", [pd.DataFrame, lambda frame: dict(frame.items())])
def test_tables_give_the_flight_that_their_files_give(tmp_path, form, table):
    folder = written.write_flight(tmp_path / "f", blocks=("calibration", "validation"), form=form)
    given = {
        block: {
            name: table(pd.read_csv(folder / block / f"{name}.csv", dtype=TEXT))
            for name in ("images", "image_points", "trajectory")
        }
        for block in ("calibration", "validation")
    }
    control = pd.read_csv(folder / "control_points.csv", dtype=TEXT)
    settings = tomllib.loads((folder / "flight.toml").read_text())
    found = from_tables(settings, control_points=control, **given)
    expected = reader.read(folder)
    assert found.notes == expected.notes
    assert found.sha256.keys() < expected.sha256.keys()
    for name, block in expected.blocks.items():
        mine = found.blocks[name]
        assert (mine.points, mine.images.names) == (block.points, block.images.names)
        for part in ("images", "image_points", "control", "check", "trajectory"):
            for field, values in arrays(getattr(block, part)).items():
                assert_array_equal(getattr(getattr(mine, part), field), values)
        assert_array_equal(mine.trajectory.T_m_b.R, block.trajectory.T_m_b.R)
        assert_array_equal(mine.trajectory.T_m_b.r, block.trajectory.T_m_b.r)


def test_names_may_be_numbers_and_unused_columns_may_stand_there():
    number = {name: i for i, name in enumerate(CONTROL["point"])}
    points = TABLES["image_points"]["point"].map(number)
    found = from_tables(
        SETTINGS,
        control_points=CONTROL.assign(point=CONTROL["point"].map(number), remark="x"),
        calibration=changed("image_points", point=points, file=["a.tif"] * N),
    )
    assert found.calibration.points[0] == "0"
    assert found.notes[:2] == (
        "calibration.image_points: column 'file' is not read",
        "control_points: column 'remark' is not read",
    )


def test_a_standard_deviation_may_be_infinite():
    sigma = np.where(np.arange(N) == 3, np.inf, 0.4)
    found = from_tables(
        SETTINGS, control_points=CONTROL, calibration=changed("image_points", sigma_px=sigma)
    )
    assert_array_equal(found.calibration.image_points.sigma_px, sigma)


def test_numbers_of_numpy_are_good_settings():
    camera = {**SETTINGS["cameras"]["CAM"], "width_px": np.int32(4000), "k1": np.float32(1e-5)}
    settings = {**SETTINGS, "cameras": {"CAM": camera}, "stages": {"mounting": {"fix": ()}}}
    found = from_tables(settings, control_points=CONTROL, calibration=TABLES)
    assert found.cameras["CAM"].width_px == 4000


def test_without_control_points_there_are_none():
    found = from_tables(SETTINGS, calibration=TABLES)
    assert len(found.calibration.control) == 0


def test_distances_are_a_table_of_their_block():
    a, b = TABLES["image_points"]["point"].drop_duplicates()[:2]
    given = {"point_a": [a], "point_b": [b], "distance_m": [3.5], "sigma_m": [0.01]}
    found = from_tables(
        SETTINGS, control_points=CONTROL, calibration={**TABLES, "distances": given}
    )
    block = found.blocks["calibration"]
    assert [block.points[i] for i in block.distances.point_idx[0]] == [a, b]
    assert block.distances.distance_m.tolist() == [3.5]
    assert "calibration/distances.csv" in found.sha256
    wrong = {**given, "point_b": ["nowhere"], "sigma_m": [0.0]}
    sigma, unknown = told(calibration={**TABLES, "distances": wrong})
    assert sigma.startswith("calibration.distances, row 0: sigma_m: 0.0; must be positive")
    assert unknown.startswith("calibration.distances, row 0: point_b: 'nowhere' is unknown")


def test_a_checksum_tells_tables_apart():
    one, other = (
        from_tables(SETTINGS, calibration=changed("image_points", sigma_px=np.full(N, sigma)))
        for sigma in (0.3, 0.4)
    )
    differ = {name for name in one.sha256 if one.sha256[name] != other.sha256[name]}
    assert differ == {"calibration/image_points.csv"}


# --- what is wrong ---------------------------------------------------------------------------

POINTS = "calibration.image_points"
COL = TABLES["image_points"]["col_px"].to_numpy()
WRONG = [
    ({"sigma_px": 0.5}, f": sigma_px: the single value 0.5; must be one for each row: np.full({N}, 0.5)"),
    ({"sigma_px": [0.0] + [0.5] * (N - 1)}, ", row 0: sigma_px: 0.0; must be positive, at most 1e6"),
    ({"sigma_px": np.ones((N, 2))}, f": sigma_px: an array of shape ({N}, 2); must be one value for each row, shape ({N},)"),
    ({"col_px": COL[:-1]}, f": col_px: {N - 1} values; must be {N}, as image has"),
    ({"col_px": [np.nan, *COL[1:]]}, ", row 0: col_px: 'nan'; must be a finite number"),
    ({"col_px": [None, *COL[1:]]}, ", row 0: col_px: is empty; must be a finite number"),
    ({"col_px": [10**400, *COL[1:]]}, ", row 0: col_px: '1000"),
    ({"col_px": ["7,5", *COL[1:]]}, ", row 0: col_px: '7,5' (a decimal comma?); must be a finite number"),
    ({"col_px": [True, *COL[1:].tolist()]}, ", row 0: col_px: 'True'; must be a finite number"),
    ({"col_px": [4000.0, *COL[1:]]}, ", row 0: col_px: 4000.0; must lie on the sensor of CAM, from -0.5 to 3999.5"),
    ({"image": ["E9_CAM", *TABLES["image_points"]["image"][1:]]}, ", row 0: image: 'E9_CAM' is unknown"),
    ({"point": [1.5, *TABLES["image_points"]["point"][1:]]}, ", row 0: point: 1.5; must be a name: text, or a whole number"),
    ({"point": [pd.NA, *TABLES["image_points"]["point"][1:]]}, ", row 0: point: is empty; must be a name"),
    ({"point": ["G1", *TABLES["image_points"]["point"][1:]]}, ", row 1: image, point: 'E0_CAM', 'G1' stands in row 0 already; every image and point once"),
]  # fmt: skip


@pytest.mark.parametrize(("columns", "says"), WRONG, ids=[says for _, says in WRONG])
def test_a_wrong_column_is_told_with_table_row_and_cure(columns, says):
    found = told(calibration=changed("image_points", **columns))
    assert len(found) == 1
    assert found[0].startswith(POINTS + says)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (None, "settings: settings: is None; must be a dict"),
        ({**SETTINGS, "crs": None}, "settings: crs: missing; required"),
        ({**SETTINGS, "cameras": {}}, "settings: cameras: no cameras; must hold one table per camera"),
        ({**SETTINGS, "crs": "EPSG:4326"}, "settings: crs: 'EPSG:4326' (WGS 84) is not a projected CRS; must be a projected CRS in metres"),
        ({**SETTINGS, "hights": 1}, "settings: hights: unknown key (did you mean 'heights'?)"),
        ({**SETTINGS, "cameras": {"CAN": SETTINGS["cameras"]["CAM"]}}, "calibration.images, row 0: camera: 'CAM' is unknown (did you mean 'CAN'?); must be a camera of settings"),
    ],
)  # fmt: skip
def test_wrong_settings_are_told_by_their_keys(settings, says):
    assert told(settings, calibration=TABLES)[0].startswith(says)


def test_missing_tables_and_misspelt_ones_are_told():
    assert told() == ["flight: blocks: no block at all; must have one at least: heads, calibration or validation"]  # fmt: skip
    tables = {"images": TABLES["images"], "image_point": 0, "trajectory": TABLES["trajectory"]}
    assert told(calibration=tables) == [
        "calibration: image_point: unknown table (did you mean 'image_points'?); must be one of "
        "images, image_points, trajectory, control_points, distances",
        "calibration: image_points: missing; required",
    ]
    assert told(calibration=TABLES["images"]) == [
        "calibration: tables: is a DataFrame; must be a dict of the tables images, image_points, "
        "trajectory"
    ]
    assert told(calibration={**TABLES, "trajectory": [1, 2]}) == [
        "calibration.trajectory: table: is a list; must be a DataFrame, or a dict of arrays"
    ]


@pytest.mark.parametrize("column", ["point", "col_px", "sigma_px"])
def test_no_cell_however_odd_is_answered_with_an_error_of_python(column):
    odd = (
        None,
        -np.inf,
        "",
        "a\nb",
        "=1",
        "x" * 300,
        b"x",
        object(),
        [1, 2],
        {},
        pd.NA,
        pd.NaT,
        1j,
        pd.Timestamp(0),
        10**400,
    )
    for value in odd:
        cells = np.empty(N, dtype=object)
        cells[:] = TABLES["image_points"].get(column, 0.5)
        cells[5] = value
        lines = told(calibration=changed("image_points", **{column: cells}))
        assert all(
            line.startswith(f"calibration.image_points, row 5: {column}: ") for line in lines
        )


def test_a_flight_from_tables_says_that_it_has_no_folder():
    found = from_tables(SETTINGS, control_points=CONTROL, calibration=TABLES)
    with pytest.raises(FlightError, match=r"^tables in memory: the flight has no block heads$"):
        found.block("heads")


def test_missing_columns_and_rows_are_told():
    without = TABLES["images"].rename(columns={"camera": "Camera"})
    assert told(calibration={**TABLES, "images": without}) == [
        "calibration.images: camera: missing in the header (is it 'Camera'?); required"
    ]
    none = TABLES["image_points"].iloc[:0]
    assert told(calibration={**TABLES, "image_points": none})[0] == (
        "calibration.image_points: table: has no rows; must have one at least"
    )


def test_a_control_point_that_lies_elsewhere_is_noted_with_its_row():
    far = CONTROL.assign(east_m=CONTROL["east_m"] + 3000.0 * (np.arange(9) == 4))
    found = from_tables(SETTINGS, control_points=far, calibration=TABLES)
    assert "'G4' (row 4)" in found.notes[-1]


# --- a block from arrays ---------------------------------------------------------------------


def test_a_block_from_arrays_alone_is_calibrated_as_one_that_says_everything():
    whole = blocks.balanced()
    trajectory = whole.trajectory
    short = type(whole)(
        cameras=whole.cameras,
        images=type(whole.images)(names=whole.images.names),
        points=whole.points,
        image_points=whole.image_points,
        control=whole.control,
        trajectory=replace(trajectory),
    )
    fits = [mounting.single_step(block, free=("f",)) for block in (whole, short)]
    values = [fit.calibration.cameras[0].interior.f for fit in fits]
    assert values[0] == values[1]
