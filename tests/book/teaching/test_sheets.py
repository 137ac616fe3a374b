"""The sheets of the labs and their flights: tasks, seeds, and what is right."""

import csv
import hashlib
import hmac
import math
import re
import statistics
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, ttest_1samp

from acx4book.notebooks import runner
from acx4book.planning import design as designs
from acx4book.planning import plan as plans
from acx4book.planning.flown import flying_time_s, simulate
from acx4book.teaching import flights, grading, handed_in
from acx4book.teaching.grading import graded
from acx4book.teaching.sheets import calibrations, images
from acx4book.teaching.sheets.every import SHEETS
from acx4files.flight.reader import read
from acx4files.results import folder, tables
from acx4files.stages.mounting import calibrate
from acx4lib.calibration.mounting import single_step
from acx4lib.errors import FlightError
from acx4lib.georeferencing.validation import validate
from acx4lib.model import Model
from acx4sim.plan import Options
from support.helpers import ROOT

# --- design ----------------------------------------------------------------------------------


def test_fewer_strips_are_a_flight_with_fewer_rows(key, solved):
    """As a student can do it in the files: rows of strips 1 and 2 are left, then `calibrate`."""
    flight = flights.flight_of(SHEETS["lab-8"], "Ada", key)
    images = flight.tables["calibration/images.csv"]
    kept = images[images["strip"].isin(["1", "2"])]
    points = flight.tables["calibration/image_points.csv"]
    fewer = {
        **flight.tables,
        "calibration/images.csv": kept,
        "calibration/image_points.csv": points[points["image"].isin(kept["image"])],
    }
    case = flights.case_of(replace(flight, tables=fewer))
    single = calibrate(case.flight)["single_step"].calibration
    sigma = tables.calibration_tables(single)["parameters"].set_index("parameter")["sigma"]
    _, right = solved("lab-8", "Ada")
    for name in ("f_mm", "lever_x_m", "lever_z_m"):
        assert right[f"sigma_one_height_{name}"].value == pytest.approx(sigma[name], rel=1e-6)


def test_the_lesson_shows_for_every_student(solved):
    """One height leaves f and z of the lever arm nearly open."""
    for k in range(4):
        _, right = solved("lab-8", f"Student {k}")
        whole, one = (right[f"sigma_{d}_f_mm"].value for d in ("all", "one_height"))
        assert one > 5 * whole
        assert right["corr_f_lever_z_one_height"].value > 0.98


# --- estimates -------------------------------------------------------------------------------


def test_the_statistics_are_those_of_others(solved):
    case, right = solved("lab-7", "Ada")
    found = {name: one.value for name, one in right.items()}
    single = calibrate(case.flight)["single_step"].calibration
    d = validate(case.flight.block("validation"), single, method="single_step").points.d
    height = d[:, 2].tolist()
    assert found[calibrations.N] == len(d)
    assert found["rms_east_m"] == pytest.approx(np.sqrt(np.mean(d[:, 0] ** 2)))
    assert found[calibrations.MEAN] == pytest.approx(statistics.mean(height))
    assert found[calibrations.STD] == pytest.approx(statistics.stdev(height))
    assert found[calibrations.T] == pytest.approx(ttest_1samp(height, 0.0).statistic)
    assert found[calibrations.CHI] == pytest.approx(
        (len(d) - 1) * statistics.variance(height) / 0.15**2
    )


# --- the code of the lab pages, run on a student's flight ------------------------------------


PAGES = ROOT / "book" / "teaching"


@pytest.mark.parametrize("name", SHEETS)
def test_the_code_of_a_labs_page_runs(name, key, tmp_path, monkeypatch, capsys):
    text = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    codes = re.findall(r"^( *)```python\n(.*?)^\1```", text, re.MULTILINE | re.DOTALL)
    assert bool(codes) == (name != "lab-1")
    monkeypatch.chdir(tmp_path)
    handed_in.write(SHEETS[name], "Ada", key, tmp_path / "my_flight")
    if "acx4 run my_flight" in text:
        runner.run("my_flight", "my_results", stages=folder.STAGES)
    known = {}
    for indent, code in codes:
        exec(re.sub(f"^{indent}", "", code, flags=re.MULTILINE), known)
    assert bool(capsys.readouterr().out) == bool(codes)


# --- gross errors ----------------------------------------------------------------------------


def strongest(bundle, kind):
    return max((r for r in bundle.rejected if r.kind == kind), key=lambda r: r.statistic).row


def digits_of(name):
    return int("".join(filter(str.isdigit, name)))


def test_what_was_planted_is_what_the_library_finds(solved):
    """The sheet can be solved: for every student the three large errors are rejected."""
    for k in range(6):
        case, right = solved("lab-5", f"Student {k}")
        block = case.block
        bundle = calibrate(case.flight)["single_step"].bundle
        point = block.points[block.control.point_idx[strongest(bundle, "control_point")]]
        assert digits_of(point) == right["control_point"].truth
        for kind, question in (("gnss", "gnss_exposure"), ("attitude", "attitude_exposure")):
            name = block.trajectory.exposures[strongest(bundle, kind)]
            assert digits_of(name) == right[question].truth
        found = sum(rejection.kind == "image_point" for rejection in bundle.rejected)
        assert abs(found - right["rejected_points"].truth) <= 2


@pytest.mark.parametrize("student", ["Student 0", "Student 1"])
def test_a_check_point_shows_the_error_of_the_survey(student, key, solved, tmp_path):
    """As the page says: the wrong control point becomes a check point, and is compared."""
    _, right = solved("lab-5", student)
    handed_in.write(SHEETS["lab-5"], student, key, tmp_path / "flight")
    survey = tmp_path / "flight" / "control_points.csv"
    wrong = f"P{right['control_point'].truth:02.0f}"
    header, *rows = survey.read_text().splitlines()
    marked = [f"{row},{'check' if row.startswith(wrong) else ''}" for row in rows]
    survey.write_text("\n".join([f"{header},role", *marked]) + "\n")
    runner.run(tmp_path / "flight", tmp_path / "r", stages=folder.STAGES)
    found = folder.rows(folder.read(tmp_path / "r"), "check_points", "mounting/single_step")
    d = found.loc[found["point"] == wrong, ["d_east_m", "d_north_m", "d_height_m"]].to_numpy()[0]
    error = -d[abs(d).argmax()]
    assert abs(error - right["control_error_m"].truth) <= right["control_error_m"].bound


# --- intersection ----------------------------------------------------------------------------


def test_the_points_are_the_simulators_within_sigma(solved):
    """The squares of errors over σ; a σ that is a third off would show."""
    errors = []
    for k in range(20):
        _, right = solved("lab-3", f"Student {k}")
        errors += [
            (right[name].value - right[name].truth) / right[name].sigma for name in images.POINT
        ]
    low, high = chi2.ppf([0.0005, 0.9995], 60)  # three axes of a point are weakly correlated
    assert 0.6 * low < np.sum(np.square(errors)) < 1.4 * high


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"lever_x_m": 0.0, "lever_y_m": 0.0, "lever_z_m": 0.0}, "lever arm is forgotten"),
        (dict.fromkeys(("k1", "k2", "k3", "p1", "p2"), 0.0), "distortion is forgotten"),
        ({"mount_omega_deg": 0.0, "mount_phi_deg": 0.0, "mount_kappa_deg": 90.0}, "small angles"),
    ],
)
def test_a_mistake_made_in_the_flights_files_is_named(changed, says, key, solved, handed):
    flight = flights.flight_of(SHEETS["lab-3"], "Ada", key)
    lines = [
        f"{name} = {changed[name]}" if (name := line.split(" = ")[0]) in changed else line
        for line in flight.toml.splitlines()
    ]
    spoilt = flights.case_of(replace(flight, toml="\n".join(lines) + "\n"))
    wrong = {name: answer.value for name, answer in SHEETS["lab-3"].solve(spoilt).items()}
    case, right = solved("lab-3", "Ada")
    verdicts = grading.graded(SHEETS["lab-3"], case, handed("lab-3", right, **wrong))
    assert [v for v in verdicts if v.says]
    assert all(says in v.says for v in verdicts if v.says)


# --- lens ------------------------------------------------------------------------------------


def test_the_distortion_is_browns_formula(solved):
    case, right = solved("lab-4", "Ada")
    of = calibrate(case.flight)["single_step"].calibration.cameras[0].interior
    radial, (dx, dy) = (
        [right[n].value for n in names] for names in (calibrations.RADIAL, calibrations.AT_PLACE)
    )
    r = np.array(calibrations.RADII_MM)
    assert radial == pytest.approx(1e3 * (of.k1 * r**3 + of.k2 * r**5 + of.k3 * r**7))
    x, y, r_sq = 20.0, 15.0, 625.0
    scale = of.k1 * r_sq + of.k2 * r_sq**2 + of.k3 * r_sq**3
    assert dx == pytest.approx(1e3 * (x * scale + of.p1 * (r_sq + 2 * x * x) + 2 * of.p2 * x * y))
    assert dy == pytest.approx(1e3 * (y * scale + of.p2 * (r_sq + 2 * y * y) + 2 * of.p1 * x * y))


WITH_SIGMA = {
    "lab-4": ("f_mm", "dr_20_um", "dx_um"),
    "lab-6": (*calibrations.BORESIGHT, *calibrations.LEVER, calibrations.TWO_STEP),
}


@pytest.mark.parametrize("sheet", WITH_SIGMA)
def test_estimates_are_within_their_sigma_of_the_truth(sheet, solved):
    for name in WITH_SIGMA[sheet]:
        errors = []
        for k in range(20):
            _, right = solved(sheet, f"Student {k}")
            errors.append((right[name].value - right[name].truth) / right[name].sigma)
        low, high = chi2.ppf([0.0005, 0.9995], 20)
        assert low < np.sum(np.square(errors)) < high


# --- mounting --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(key, tmp_path_factory):
    """Return a student's flight and the folder of a run of it."""
    at = tmp_path_factory.mktemp("lab")
    handed_in.write(SHEETS["lab-6"], "Ada", key, at / "flight")
    runner.run(at / "flight", at / "results", stages=folder.STAGES)
    return read(at / "flight"), at / "results"


@pytest.fixture(scope="module")
def by_hand(run):
    """Return difference of places on the grid, attitude of the body, and of the camera."""
    flight, results = run
    rows = folder.read(results).exterior_orientation
    row = rows[(rows["method"] == "two_step") & (rows["image"] == "C1-03")].iloc[0]
    block = flight.calibration
    place, opk = block.frame.pose_to_grid(block.T_m_b_images[[2]])
    between = row[["east_m", "north_m", "height_m"]].to_numpy(float) - place[0]
    camera = row[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy(float)
    return (
        between,
        Rotation.from_euler("XYZ", opk[0]),
        Rotation.from_euler("XYZ", camera, degrees=True),
    )


def of_image(lever, R):
    angles = R.as_euler("XYZ", degrees=True)
    return dict(zip(calibrations.OF_IMAGE, [*lever, *angles], strict=True))


def test_a_run_answers_what_it_has(run, solved):
    case, right = solved("lab-6", "Ada")
    given = handed_in.read(run[1])
    assert (given.student, given.sheet) == ("Ada", "lab-6")
    for name in (*calibrations.BORESIGHT, *calibrations.LEVER, calibrations.TWO_STEP):
        assert given.answers[name].value == pytest.approx(right[name].value, abs=1e-9)
        assert given.answers[name].sigma == pytest.approx(right[name].sigma, rel=1e-6)
    verdicts = grading.graded(SHEETS["lab-6"], case, given.answers)
    assert {v.says for v in verdicts} == {"", "not answered"}


def test_an_image_by_hand_gives_the_right_answer_and_mistakes_are_named(by_hand, solved, handed):
    between, body, camera = by_hand
    case, right = solved("lab-6", "Ada")
    lever, boresight = body.inv().apply(between), body.inv() * camera
    for wrong, says in (
        (of_image(lever, boresight), ""),
        (of_image(between, boresight), "mapping axes"),
        (of_image(camera.inv().apply(between), boresight), "camera axes"),
        (of_image(lever, camera), "camera against the grid"),
        (of_image(lever, boresight.inv()), "transposed"),
        (of_image(-lever, boresight), "lever arm's sign"),
    ):
        verdicts = grading.graded(SHEETS["lab-6"], case, handed("lab-6", right, **wrong))
        assert bool(says) == bool([v for v in verdicts if v.says])
        assert all(says in v.says for v in verdicts if v.says)


# --- by hand, from the numbers in the tables -------------------------------------------------


@pytest.fixture(scope="module")
def pixels_by_hand(key):
    """Return what a student reads: column, row, heights."""
    flight = flights.flight_of(SHEETS["lab-1"], "Ada", key)
    points = flight.tables["calibration/image_points.csv"]
    control = flight.tables["control_points.csv"].set_index("point")
    row = points[points["point"].isin(control.index)].iloc[0]
    over = flight.tables["calibration/trajectory.csv"].set_index("exposure")["height_m"]
    ground = control.loc[row["point"], "height_m"]
    return row["col_px"], row["row_px"], over[row["image"]], ground


def test_the_right_answers_are_the_textbooks_formulas(pixels_by_hand, solved):
    column, row, over, ground = pixels_by_hand
    _, right = solved("lab-1", "Ada")
    x, y = 0.0046 * (column - 11607 / 2), 0.0046 * (8707 / 2 - row)
    expected = {
        "x_mm": x,
        "y_mm": y,
        "off_axis_deg": math.degrees(math.atan(math.hypot(x, y) / 50)),
        "height_above_ground_m": over - ground,
        "scale_number": (over - ground) / 0.050,
        "gsd_m": 4.6e-6 * (over - ground) / 0.050,
        "sigma_ground_m": 0.4 * 4.6e-6 * (over - ground) / 0.050,
    }
    assert {name: answer.value for name, answer in right.items()} == pytest.approx(expected)


def test_mistakes_made_by_hand_are_named(pixels_by_hand, solved, handed):
    column, row, over, _ = pixels_by_hand
    case, right = solved("lab-1", "Ada")
    for wrong, says in (
        ({"x_mm": 0.0046 * (column - 5804), "y_mm": 0.0046 * (4354 - row)}, "half a pixel"),
        ({"x_mm": 0.0046 * (4353.5 - row), "y_mm": 0.0046 * (column - 5803.5)}, "swapped"),
        ({"x_mm": column - 5803.5, "y_mm": 4353.5 - row}, "in pixels"),
        ({"y_mm": 0.0046 * (row - 4353.5)}, "rows count downwards"),
        ({"height_above_ground_m": over, "scale_number": over / 0.05}, "ground's height"),
    ):
        verdicts = grading.graded(SHEETS["lab-1"], case, handed("lab-1", right, **wrong))
        for verdict in verdicts:
            assert (says in verdict.says) == (verdict.question.name in wrong)


# --- planning --------------------------------------------------------------------------------


def test_a_student_who_plans_flies_and_adjusts_has_all_points(key, tmp_path, solved, handed):
    """With nothing but the files of the folder, by the same steps as the commands."""
    sheet, folder = SHEETS["lab-9"], tmp_path / "lab"
    folder.mkdir()
    handed_in.write(sheet, "Ada", key, folder)
    assert {p.name for p in folder.iterdir()} == {"README.md", "answers.csv", "plan.toml"}
    plan = plans.read(folder / "plan.toml")
    given = (folder / "README.md").read_text("utf-8")
    wanted = {name: float(x) for name, x in re.findall(r"(\w+) at most ([\d.e-]+) ", given)}
    assert {*wanted} == {"f_mm", "lever_z_m", "boresight_kappa_deg"}
    found, minutes = shortest(plan, wanted)
    seed = int(given.partition("--seed ")[2].split("`")[0])
    flown = simulate(found, seed=seed, options=Options())
    case = flights.case_of(flown)
    estimates = single_step(case.block, Model(free=case.flight.estimate_mounting)).calibration
    _, right = solved("lab-9", "Ada")
    value = estimates.cameras[0].interior.f
    assert right["f_mm"].value == pytest.approx(value, abs=1e-9)
    answers = handed(
        "lab-9", right, strips=len(found.blocks["calibration"].strips), minutes=minutes
    )
    verdicts = graded(sheet, solved("lab-9", "Ada")[0], answers)
    assert sum(v.points for v in verdicts) == sum(v.of for v in verdicts) == 9
    with (folder / "answers.csv").open() as file:
        assert [row["question"] for row in csv.DictReader(file)] == [*right]


def shortest(plan, wanted):
    """Try every choice of strips by the covariance of its flight; return the shortest, minutes."""
    strips, best = plan.blocks["calibration"].strips, (None, np.inf)
    for bits in range(1, 2 ** len(strips)):
        flown = plan.with_strips({n: s for k, (n, s) in enumerate(strips.items()) if bits >> k & 1})
        minutes = flying_time_s(tuple(flown.blocks["calibration"].strips.values())) / 60
        if minutes < best[1]:
            sigma = designs.sigmas(flown)
            if all(sigma[name] <= limit for name, limit in wanted.items()):
                best = flown, minutes
    return best


def test_what_is_wanted_needs_a_choice(solved):
    case, right = solved("lab-9", "Ada")
    assert 2 <= right["strips"].value < 6
    assert len({*case.block.images.strips}) == right["strips"].value


def test_strips_that_nobody_needs_are_named(solved, handed):
    case, right = solved("lab-9", "Ada")
    mistake = next(m for m in SHEETS["lab-9"].mistakes(case, right) if "all strips" in m.says)
    verdicts = graded(SHEETS["lab-9"], case, handed("lab-9", right, **mistake.gives))
    said = {v.question.name: v.says for v in verdicts if v.says}
    assert {"strips", "minutes"} <= {*said}
    assert all("leave out what is not needed" in one for one in said.values())


# --- with scipy's rotations and PROJ, none of the library's ----------------------------------


def opk_deg(R):
    """Angles of M = R3 R2 R1, object to image."""
    return R.as_euler("XYZ", degrees=True)


@pytest.fixture(scope="module")
def rotations_by_hand(key):
    """Return the body's attitude against true north, the convergence, and the boresight."""
    flight = flights.flight_of(SHEETS["lab-2"], "Ada", key)
    row = flight.tables["calibration/trajectory.csv"].iloc[1]
    gamma = pyproj.Proj("EPSG:32633").get_factors(row["lon_deg"], row["lat_deg"])
    ned = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    frd = Rotation.from_euler("x", 180, degrees=True)
    turned = Rotation.from_euler("ZYX", row[["heading_deg", "pitch_deg", "roll_deg"]], degrees=True)
    mount = flight.plan.cameras["CAM"].boresight_deg
    boresight = Rotation.from_euler("XYZ", mount, degrees=True)
    return ned * turned * frd, gamma.meridian_convergence, boresight


def named(body, camera):
    return dict(zip((*images.BODY, *images.CAMERA), [*body, *camera], strict=True))


def test_the_right_answers_are_scipys_and_projs(rotations_by_hand, solved):
    true_north, gamma, boresight = rotations_by_hand
    _, right = solved("lab-2", "Ada")
    body = Rotation.from_euler("z", gamma, degrees=True) * true_north
    expected = named(opk_deg(body), opk_deg(body * boresight))
    values = {name: right[name].value for name in expected}
    assert values == pytest.approx(expected, abs=2e-6)
    assert right[images.GAMMA].value == pytest.approx(gamma, abs=1e-9)


def test_the_right_attitude_is_the_simulators_but_for_noise(solved):
    for k in range(5):
        case, right = solved("lab-2", f"Student {k}")
        true = case.truth["exposures"]["calibration"]["C1-02"][3:]
        off = [right[name].value - angle for name, angle in zip(images.BODY, true, strict=True)]
        assert np.all(np.abs(off) < 5 * 0.015)


def test_mistakes_made_by_hand_are_named_of_rotations(rotations_by_hand, solved, handed):
    true_north, gamma, boresight = rotations_by_hand
    case, right = solved("lab-2", "Ada")
    body = Rotation.from_euler("z", gamma, degrees=True) * true_north
    for wrong, says in (
        (named(opk_deg(true_north), opk_deg(true_north * boresight)), "forgotten"),
        (named(opk_deg(body.inv()), opk_deg((body * boresight).inv())), "transposed"),
        (named(opk_deg(body), opk_deg(body * boresight.inv())), "boresight is transposed"),
        (named(opk_deg(body), opk_deg(body)), "these are the body's"),
        (named(opk_deg(body * boresight), opk_deg(body * boresight)), "these are the camera's"),
        (named(opk_deg(body) / 0.9, opk_deg(body * boresight) / 0.9), "in gon"),
        (named(np.radians(opk_deg(body)), opk_deg(body * boresight)), "in radians"),
    ):
        verdicts = grading.graded(SHEETS["lab-2"], case, handed("lab-2", right, **wrong))
        assert [v for v in verdicts if v.says]
        assert all(says in v.says for v in verdicts if v.says)


# --- flights ---------------------------------------------------------------------------------


KEY = bytes(range(32))


def test_a_seed_is_the_hmac_of_purpose_sheet_and_name():
    """RFC 2104 written out: two hashes with padded keys."""
    padded = KEY.ljust(64, b"\0")
    inner = bytes(b ^ 0x36 for b in padded) + "truth\0lab-6\0zoë".encode()
    outer = bytes(b ^ 0x5C for b in padded) + hashlib.sha256(inner).digest()
    expected = int.from_bytes(hashlib.sha256(outer).digest(), "big")
    assert flights.seed(KEY, sheet="lab-6", student="Zoë", purpose="truth") == expected
    assert hmac.new(KEY, inner[64:], "sha256").digest() == expected.to_bytes(32, "big")


@pytest.mark.parametrize("spelling", ["Zoë Ng", "  zoë   NG ", "Zoe\u0308 Ng", "Zoë\u00a0Ng"])
def test_spellings_of_one_name_have_one_seed(spelling):
    one = flights.seed(KEY, sheet="lab-1", student="Zoë Ng", purpose="truth")
    assert flights.seed(KEY, sheet="lab-1", student=spelling, purpose="truth") == one


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("Ada Lovelace", "lab-6-ada-lovelace"),
        ("../../etc/passwd", "lab-6-etc-passwd"),
        ("O'Neil; rm -rf $HOME", "lab-6-o-neil-rm-rf-home"),
        ("李小龙", "lab-6-李小龙"),
        ("...", "lab-6"),
    ],
)
def test_the_folder_of_a_name_is_safe(name, folder):
    assert flights.folder_name("lab-6", name) == folder
    assert len(flights.folder_name("lab-6", "é" * 200).encode()) < 255


@pytest.mark.parametrize("content", [None, b"", b"secret"])
def test_a_key_that_is_missing_or_short_is_refused_with_the_cure(tmp_path, content):
    path = tmp_path / "key.txt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FlightError, match="token_hex"):
        flights.read_key(path)


def bytes_of(flight):
    return flight.toml + "".join(table.to_csv() for table in flight.tables.values())


@pytest.mark.parametrize("name", SHEETS)
def test_a_student_has_one_flight_and_another_student_another(name, key):
    ada, again, bob = (
        flights.flight_of(SHEETS[name], student, key) for student in ("Ada", " ADA", "Bob")
    )
    assert bytes_of(ada).replace("ADA", "Ada") == bytes_of(again).replace("ADA", "Ada")
    assert ada.truth == again.truth
    assert ada.truth["cameras"] != bob.truth["cameras"]
    assert not ada.tables["calibration/trajectory.csv"].equals(
        bob.tables["calibration/trajectory.csv"]
    )


def test_the_errors_do_not_depend_on_the_truth():
    """A seed that became known would not tell the other."""
    one, two = (
        flights.fly(5, "x", flights.drawn_camera(seed), flights.WHOLE[:1]) for seed in (1, 2)
    )
    same = "calibration/trajectory.csv"
    assert one.tables[same].equals(two.tables[same])
