"""Tables of results: rows of adjustments, files, and compiled lines and digits."""

import csv
import io
import os
from decimal import Decimal

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acx4files.results import compiled, folder, rows, table_files, tables
from acx4files.results.compiled import LONGEST, put_lines
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.bundle.network import camera_poses
from acx4lib.bundle.rejections import Rejection
from acx4lib.calibration import estimates
from acx4lib.errors import FlightError
from acx4lib.georeferencing.direct import georeference
from acx4lib.least_squares.covariance import propagate, sigmas
from support import blocks
from support.helpers import numeric_jacobian

# --- files of tables beside those that pandas and the module csv write -----------------------


NAMES = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=4)
NUMBERS = st.floats() | st.integers(-(10**6), 10**6).map(float)
ROWS = st.lists(st.tuples(NAMES, NAMES, NAMES, NUMBERS, NAMES), min_size=1, max_size=6)


def rejected(rows):
    """A table with names and numbers."""
    cells = [("mounting", "rig", *names, number, last) for *names, number, last in rows]
    return pd.DataFrame(cells, columns=list(table_files.COLUMNS["rejected"]))


def text_of(name, frame):
    return b"".join([table_files.header(name), *table_files.lines(name, frame)])


@given(ROWS)
def test_rows_are_written_as_the_module_csv_does(rows):
    frame = rejected(rows).replace("\r", "\n", regex=True)  # csv writes that without quotes
    out = io.StringIO(newline="")
    numbers = [repr(x) if np.isfinite(x) else "" for x in frame["statistic"].tolist()]
    cells = frame.assign(statistic=numbers).itertuples(index=False)
    csv.writer(out, lineterminator="\n").writerows(cells)
    assert b"".join(table_files.lines("rejected", frame)).decode() == out.getvalue()


@given(ROWS)
def test_categories_are_written_as_their_names(rows):
    frame = rejected(rows)
    coded = frame.astype({c: "category" for c in frame.columns if frame[c].dtype != float})
    assert text_of("rejected", coded) == text_of("rejected", frame)


def test_more_rows_than_are_written_together_are_those_of_pandas(rng, monkeypatch):
    monkeypatch.setattr(table_files, "ROWS", 64)
    n = 1000
    names = np.array(["E0", "", "a,b", 'the "one"', "ö"], dtype=object)
    frame = pd.DataFrame(
        {
            **{c: names[rng.integers(0, 5, n)] for c in table_files.COLUMNS["residuals"][:6]},
            **{c: rng.normal(size=n) for c in table_files.COLUMNS["residuals"][6:]},
        }
    )
    frame.loc[::7, "w"] = np.nan
    expected = frame.to_csv(index=False, lineterminator="\n").encode()
    assert text_of("residuals", frame) == expected
    counts = pd.DataFrame(
        [["heads", "bundle", "P", k, *rng.normal(size=6)] for k in range(20)],
        columns=list(table_files.COLUMNS["check_points"]),
    )
    expected = counts.to_csv(index=False, lineterminator="\n").encode()
    assert text_of("check_points", counts) == expected


@given(ROWS)
def test_what_is_written_comes_back(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("files") / "rejected.csv"
    frame = rejected(rows)
    path.write_bytes(text_of("rejected", frame))
    back = table_files.read(path)
    assert back["statistic"].equals(frame["statistic"].replace([np.inf, -np.inf], np.nan))
    names = [column for column in frame.columns if column != "statistic"]
    assert back[names].to_numpy().tolist() == frame[names].to_numpy().tolist()


def test_numbers_come_back_to_the_last_bit(tmp_path, rng):
    bits = rng.integers(0, 1 << 64, 20_000, dtype=np.uint64).view(float)
    values = np.concatenate([bits[np.isfinite(bits)], rng.normal(size=20_000)])
    names = dict.fromkeys(("stage", "method", "row", "column"), "nan")
    frame = pd.DataFrame({**names, "value": values}, index=range(len(values)))
    path = tmp_path / "covariance.csv"
    path.write_bytes(text_of("covariance", frame))
    back = table_files.read(path)
    np.testing.assert_array_equal(back["value"].to_numpy().view(np.uint64), values.view(np.uint64))
    assert set(back["stage"]) == {"nan"}


OLD = [
    ("heads", "bundle", "A"),
    ("mounting", "rig", 'a "b"'),
    ("mounting", "rig", "two\nmounting,rig,lines"),
    ("mounting", "rig_calibration", "C"),
    ("validation", "given", "two\r\nheads,bundle"),
]


@pytest.mark.parametrize("at_a_time", [1, 40, 4_000_000])
@pytest.mark.parametrize(
    ("gone", "left"),
    [
        ([], [0, 1, 2, 3, 4]),
        (["mounting"], [0, 4]),
        (["mounting/rig"], [0, 3, 4]),
        (["heads", "validation/given"], [1, 2, 3]),
        (["heads/bundle/A", "synthetic"], [0, 1, 2, 3, 4]),
    ],
)
def test_rows_that_stay_are_copied_as_they_are(tmp_path, monkeypatch, at_a_time, gone, left):
    monkeypatch.setattr(table_files, "BYTES", at_a_time)
    columns = table_files.COLUMNS["parameters"]
    cells = [(*row, "f_mm", 0.1, np.nan, "mm", 0.0) for row in OLD]
    frame = pd.DataFrame(cells, columns=list(columns))
    path = tmp_path / "parameters.csv"
    path.write_bytes(text_of("parameters", frame))
    begin = table_files.begins("parameters", gone)
    kept = list(table_files.others(path, begin))
    rows = b"".join(table_files.lines("parameters", frame.iloc[left]))
    assert b"".join(text for _, text in kept) == rows
    assert list(dict.fromkeys(cell for cell, _ in kept)) == list(
        dict.fromkeys(OLD[k][0] for k in left)
    )
    if len(left) < len(OLD):
        assert table_files.holds(path, begin)


BEFORE = b"stage,method,camera,parameter,value,sigma,unit\n"
"""Header of parameters.csv without the part of sigma from calibrations before."""


def test_a_file_without_a_later_column_is_read_and_its_rows_go_on(tmp_path):
    path = tmp_path / "parameters.csv"
    rows = b'heads,bundle,"a,\n""b""",f_mm,74.5,0.1,mm\nmounting,rig,C,f_mm,74.25,0.25,mm\n'
    path.write_bytes(BEFORE + rows)
    found = table_files.read(path)
    assert list(found.columns) == list(table_files.COLUMNS["parameters"])
    assert found["sigma"].tolist() == [0.1, 0.25]
    assert found["sigma_before"].isna().all()
    some = table_files.read_some(path, table_files.begins("parameters", ["mounting"]))
    assert some["camera"].tolist() == ["C"]
    kept = b"".join(text for _, text in table_files.others(path, ()))
    path.write_bytes(table_files.header("parameters") + kept)
    pd.testing.assert_frame_equal(table_files.read(path), found)


def test_a_stage_that_is_run_again_in_an_older_folder_keeps_the_other_stages(tmp_path):
    path = tmp_path / "parameters.csv"
    path.write_bytes(BEFORE + b"heads,bundle,A,f_mm,74.5,0.1,mm\n")
    row = ("mounting", "single_step", "S", "f_mm", 74.4, 0.5, "mm", 0.4)
    new = pd.DataFrame([row], columns=list(table_files.COLUMNS["parameters"]))
    folder.replace(tmp_path, ["mounting"], tables={"parameters": new}, summary={})
    assert path.read_text().splitlines()[1:] == [
        "heads,bundle,A,f_mm,74.5,0.1,mm,",
        "mounting,single_step,S,f_mm,74.4,0.5,mm,0.4",
    ]


def test_a_cell_that_is_no_number_is_named_in_a_file_without_a_later_column(tmp_path):
    path = tmp_path / "parameters.csv"
    path.write_bytes(BEFORE + b"heads,bundle,A,f_mm,long,0.1,mm\n")
    with pytest.raises(FlightError, match=r"parameters.csv:2: value: 'long'; must be a finite"):
        table_files.read(path)


@pytest.mark.parametrize(
    ("name", "gone", "begin"),
    [
        ("validation", ["validation"], (b"",)),
        ("validation", ["validation/given"], (b"given,",)),
        ("validation", ["mounting/given"], ()),
        ("synthetic_points", ["synthetic"], (b"",)),
        ("synthetic_points", ["synthetic/points"], (b"",)),
        ("synthetic_points", ["synthetic/refined"], ()),
        ("residuals", ["heads", "mounting/rig"], (b"heads,", b"mounting,rig,")),
    ],
)
def test_tables_without_columns_for_it_are_of_one_stage(name, gone, begin):
    assert table_files.begins(name, gone) == begin


def test_a_table_without_rows_holds_nothing(tmp_path):
    path = tmp_path / "validation.csv"
    path.write_bytes(table_files.header("validation"))
    assert not table_files.holds(path, (b"",))
    assert list(table_files.others(path, ())) == []
    assert len(table_files.read(path)) == 0


def test_what_is_no_table_is_said_with_its_cure(tmp_path):
    path = tmp_path / "covariance.csv"
    path.write_text("stage,method,value,row,column\n")
    with pytest.raises(FlightError, match=r":1: header: .*; must be stage,method,row"):
        table_files.holds(path, (b"mounting,",))
    path.write_text("stage,method\n")
    with pytest.raises(FlightError, match=r":1: header: 'stage,method'; must be stage,method,row"):
        table_files.read(path)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(FlightError, match=r":1: file: is no regular file; .*remove it and run"):
        table_files.read(path)


def test_the_rows_of_a_method_are_those_of_the_whole_table(tmp_path):
    path = tmp_path / "rejected.csv"
    cells = [("a\nb", "", '"', 1.0, ""), ("2", "", "é", np.nan, "x"), ("3", "", "", 2.0, "")]
    frame = rejected([cell for cell in cells for _ in range(3)])
    frame["method"] = [*3 * ["two_step"], *2 * ["rig"], "two_step", "rig", *2 * ["single_step"]]
    path.write_bytes(text_of("rejected", frame))
    whole = table_files.read(path)
    for method, first, last in (("two_step", 0, 5), ("rig", 3, 6), ("single_step", 7, 8)):
        begin = table_files.begins("rejected", [f"mounting/{method}"])
        expected = whole.loc[first:last].reset_index(drop=True)
        pd.testing.assert_frame_equal(table_files.read_some(path, begin), expected)


def test_a_table_that_was_written_otherwise_is_read_whole(tmp_path):
    path = tmp_path / "rejected.csv"
    frame = rejected([("1", "", "", 1.0, ""), ("2", "", "", 2.0, "")])
    frame.to_csv(path, index=False, quoting=csv.QUOTE_NONNUMERIC)
    text = path.read_bytes().split(b"\n", 1)[1]
    path.write_bytes(table_files.header("rejected") + text)
    begin = table_files.begins("rejected", ["mounting/rig"])
    assert len(table_files.read_some(path, begin)) == 2


# --- tables of an adjusted bundle, against what follows from its unknowns one by one ---------


def test_distances_have_rows_of_their_own_kind(noisy_block):
    block = blocks.taped(noisy_block, [[11, 20], [3, 42]], sigma=0.1, off=[0.05, -0.02])
    bundle = adjust(mounted_orientation(block, free=("f",)))
    calibration = estimates.from_bundle(bundle)
    table = rows.bundle_tables("mounting", "single_step", bundle, calibration)["residuals"]
    found = table[table["kind"] == "distance"]
    group = bundle.solution.group("distance")
    assert found["point"].tolist() == ["P11", "P3"]
    assert found["image_or_exposure"].tolist() == ["P20", "P42"]
    assert set(found["component"]) == {"distance_m"}
    for column in ("v", "sigma", "redundancy", "w"):
        assert_allclose(found[column], getattr(group, column).ravel())
    out = Rejection(kind="distance", row=1, component=-1, statistic=7.0)
    (row,) = rows.rejected_table(
        "mounting", "single_step", block, [out], pose_names=block.trajectory.exposures
    ).to_dict("records")
    assert (row["point"], row["image_or_exposure"]) == ("P3", "P42")
    assert row["reason"] == "distance: w = 7.0 exceeds 3.9"


def _in_grid(network, state):
    """Return E, N, h, omega, phi, kappa (degrees) of every image, flat."""
    enh, opk = network.block.frame.pose_to_grid(camera_poses(network, state))
    return np.hstack([enh, np.degrees(opk)]).ravel()


def test_exterior_orientations_have_the_sigma_of_all_unknowns_together(mounted):
    network, state = mounted.network, mounted.state
    still = np.zeros_like(state.x_m)
    J = numeric_jacobian(
        lambda dx: _in_grid(network, network.moved(state, dx, still)),
        np.zeros(network.n_columns),
        step=1e-3,  # coordinates of 7000 km are rounded to 1e-9 m
    )
    cov = propagate(J, mounted.solution.cov) * mounted.solution.sigma0_sq
    found = rows.exterior_orientations(mounted)
    assert list(found.columns) == list(folder.COLUMNS["exterior_orientation"][2:])
    assert tuple(found["image"]) == network.block.images.names
    values, sigma = found.iloc[:, 1:7].to_numpy(), found.iloc[:, 7:].to_numpy()
    assert_allclose(values.ravel(), _in_grid(network, state), rtol=1e-14)
    expected = sigmas(cov).reshape(-1, 6)
    assert_allclose(sigma[:, 2:], expected[:, 2:], rtol=1e-5)
    # sigma in plan are metres, of which the grid's scale makes a little less
    assert_allclose(sigma[:, :2], expected[:, :2], rtol=5e-4)
    # the mounting's part cannot be neglected: the bodies' attitudes alone are known worse
    bodies = network.layout.pose[:, 3:]
    alone = np.degrees(np.sqrt(np.diagonal(mounted.solution.cov)[bodies]))
    assert not np.allclose(np.sort(alone, axis=1), np.sort(sigma[:, 3:], axis=1), rtol=1e-2)


# --- tables ----------------------------------------------------------------------------------
#
# Tables for programs: the numbers of the values that they are made of, and clear mistakes.


PAIR = blocks.pair()
CALIBRATION = blocks.calibrated(PAIR)
IMAGES = PAIR.images.names[:2]
PIXELS = {"image": IMAGES, "col_px": [2000.0, 10.0], "row_px": [1500, 20], "height_m": [900.0] * 2}


def test_parameters_and_covariance_are_those_of_the_results_folder():
    found, cov = tables.parameters(CALIBRATION), tables.covariance(CALIBRATION)
    kept = rows.calibration_tables("mounting", "single_step", CALIBRATION)["parameters"]
    columns = ["camera", "parameter", "value", "sigma", "unit", "sigma_before"]
    determined = found.loc[found["determined"], columns].reset_index(drop=True)
    pd.testing.assert_frame_equal(determined, kept[columns])
    assert cov.index.tolist() == cov.columns.tolist()
    assert cov.index[0] == "CAM/f_mm"
    assert_allclose(np.sqrt(np.diag(cov)), found["sigma"])


def test_an_undetermined_parameter_has_a_row_that_says_so():
    loose = blocks.calibrated(PAIR)
    loose.cov[:, :] *= 1e6
    found = tables.parameters(loose)
    assert not found.loc[found["parameter"] == "lever_x_m", "determined"].any()


def test_pixels_on_the_ground_have_sigma_that_grow_with_what_errs():
    sigma = ["sigma_east_m", "sigma_north_m", "sigma_height_m"]
    poses = georeference(PAIR, CALIBRATION)
    exact = georeference(PAIR, estimates.given(PAIR.cameras))
    found = tables.ground_points(PAIR, poses, PIXELS)
    rough = tables.ground_points(PAIR, poses, {**PIXELS, "sigma_px": np.full(2, 5.0)})
    assert found.columns.tolist() == [
        *("image", "col_px", "row_px", "east_m", "north_m", "height_m"),
        *sigma,
    ]
    assert_allclose(found["height_m"], 900.0, atol=1e-5)
    assert (rough[sigma[:2]] > found[sigma[:2]]).all(axis=None)
    assert (found[sigma[:2]] > tables.ground_points(PAIR, exact, PIXELS)[sigma[:2]]).all(axis=None)
    assert_allclose(found["sigma_height_m"], 0.0, atol=1e-7)
    uncertain = pd.DataFrame(PIXELS).assign(sigma_height_m=[0.5, 0.2])
    assert_allclose(tables.ground_points(PAIR, poses, uncertain)["sigma_height_m"], [0.5, 0.2])


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"image": ["0_CAM", "0_TAIL"]}, "pixels, row 1: image: '0_TAIL' is unknown"),
        ({"height_m": 900.0}, "pixels: height_m: the single value 900.0; must be one for each row"),
        ({"height_m": [900.0, np.nan]}, "pixels, row 1: height_m: 'nan'; must be a finite number"),
        ({"sigma_px": np.zeros(2)}, "pixels, row 0: sigma_px: 0.0; must be positive"),
    ],
)
def test_a_wrong_table_of_pixels_is_told_by_row_and_column(columns, says):
    poses = georeference(PAIR, CALIBRATION)
    with pytest.raises(FlightError) as caught:
        tables.ground_points(PAIR, poses, {**PIXELS, **columns})
    assert caught.value.problems[0].startswith(says)


# --- compiled lines and digits ---------------------------------------------------------------


# --- lines beside what Python's ``repr`` writes, for very many numbers -----------------------


def written(values):
    """The lines of a table of one column of numbers."""
    bits = np.ascontiguousarray(values, dtype=float).view(np.uint64)[None]
    out = np.empty((LONGEST + 1) * bits.shape[1], dtype=np.uint8)
    codes, texts, starts = np.zeros((1, bits.shape[1]), dtype=int), out[:0], np.zeros(1, dtype=int)
    n = put_lines(out, np.array([-1]), codes, texts, starts, bits)
    return out[:n].tobytes().decode().splitlines()


@pytest.mark.parametrize(
    "draw",
    [
        lambda rng: rng.integers(0, 1 << 64, 100_000, dtype=np.uint64).view(float),
        lambda rng: rng.normal(size=100_000),
        lambda rng: rng.normal(size=100_000) * 10.0 ** rng.integers(-9, 20, 100_000),
        lambda rng: np.round(rng.normal(size=100_000) * 1e4, 6),
        lambda rng: rng.integers(-(1 << 60), 1 << 60, 100_000).astype(float),
        lambda rng: 10.0 ** rng.integers(-323, 309, 1_000),
    ],
)
def test_numbers_are_written_as_python_does(draw, rng):
    values = draw(rng)
    values = values[np.isfinite(values)]
    assert written(values) == [repr(value) for value in values.tolist()]


def test_the_longest_numbers_fit_and_what_is_not_finite_is_empty():
    values = [-2.2250738585072014e-308, -0.00012345678901234567, -1.7976931348623157e308, -0.0]
    assert written(values) == list(map(repr, values))
    assert max(map(len, map(repr, values))) == LONGEST
    assert written([np.nan, np.inf, -np.inf, 0.0]) == ["", "", "", "0.0"]


def test_columns_of_text_and_numbers_stand_in_the_order_that_is_asked_for():
    cells = [b"a", b"\xc3\xa4,", b""]
    starts = np.cumsum([0, *map(len, cells)])
    bits = np.array([[0.5, 1e16, -3.0], [1.0, 2.0, np.nan]]).view(np.uint64)
    out = np.empty(200, dtype=np.uint8)
    texts = np.frombuffer(b"".join(cells), dtype=np.uint8)
    n = put_lines(out, np.array([-2, 0, -1]), np.array([[0, 1, 2]]), texts, starts, bits)
    assert out[:n].tobytes().decode() == "1.0,a,0.5\n2.0,ä,,1e+16\n,,-3.0\n"


# --- the shortest digits beside Python's own, which come from another algorithm --------------


EDGES = [5e-324, 2.2250738585072009e-308, 2.2250738585072014e-308, 1.7976931348623157e308]


def of_python(value):
    _, cells, exponent = Decimal(repr(value)).normalize().as_tuple()
    return int("".join(map(str, cells))), exponent


def ours(value):
    whole, exponent = compiled.shortest(np.array(value).view(np.uint64)[()])
    whole = int(whole)
    while whole % 10 == 0:
        whole, exponent = whole // 10, exponent + 1
    return whole, exponent


@given(st.floats(min_value=5e-324, max_value=1.7976931348623157e308))
def test_digits_are_those_of_python(value):
    assert ours(value) == of_python(value)


@pytest.mark.parametrize("value", [*EDGES, 0.1, 0.3, 1.0, 4.35, 1e15, 1e22, 1e23, 2.0**53 + 2])
def test_digits_of_edges_are_those_of_python(value):
    assert ours(value) == of_python(value)


def test_powers_where_a_neighbour_is_nearer_have_the_digits_of_python():
    for exponent in range(-1074, 1024, 7):
        assert ours(2.0**exponent) == of_python(2.0**exponent)


def test_powers_of_ten_are_rounded_up_to_128_bits():
    for row in (0, 100, -compiled.SMALLEST, 400, len(compiled._POWERS) - 1):
        high, low = map(int, compiled._POWERS[row])
        found, exponent = high << 64 | low, row + compiled.SMALLEST
        power = Decimal(10) ** exponent
        assert 1 << 127 <= found < 1 << 128
        bits = (10 ** abs(exponent)).bit_length()
        shift = 128 - bits if exponent >= 0 else 127 + bits
        exact = 10**exponent * 2**shift if exponent >= 0 and shift >= 0 else None
        if exact is not None:
            assert found == exact
        assert abs(Decimal(found) / (power * Decimal(2) ** shift) - 1) < Decimal("1e-27")
