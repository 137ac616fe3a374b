"""All notebooks: of flights unlike the study, with every setting, and in plain papermill."""

import datetime as dt
import itertools
import json
import re
import shutil
import tomllib

import nbformat
import papermill
import pytest

import acx4sim
from acx4book.notebooks import runner
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.pages import build, flight_book
from acx4book.report import page
from acx4files.flight import reader
from acx4files.flight.settings import FLIGHT
from acx4files.flight.toml_file import NAME, rows
from acx4files.results import folder, provenance
from acx4files.results.folder import NOTEBOOKS, STAGES
from acx4files.results.provenance import KEPT
from support.flights import in_heads, planned
from support.helpers import ROOT, repeats

# --- unlike flights --------------------------------------------------------------------------
#
# Flights unlike the study run through all notebooks; no sentence says what cannot be true.


NEVER = {
    "an infinite or missing number": r"\b(inf|nan|NaN|None)\b",
    "a number as Python writes it": r"\d\.\d{13,}",
    "zero with a sign": r"(?<![\w.·⁻])[-−]0(\.0+)?(?![\d.,:])",
    "nothing where a value belongs": r"(finds|are|is|of|by)\s+[.,;°]",
    "several where there is one": (
        r"(?<![\d.,−-])1 (points|images|exposures|heads|check points|strips|pairs)\b"
    ),
    "a value of the code": r"<[A-Za-z_.]+ (object|at) |Failed\(|array\(",
    "a simulation": r"[Ss]imulated",
}
"""What no text of a real flight has, by what it would be."""

OF_STUDY = r"[Tt]he paper's|[Pp]rinted:"
"""What stands only beside flights of the paper's camera, in what is computed."""


SAYS = {
    "mounting held": ("09-weights", "3 check points of this block are compared"),
    "no check point": ("09-weights", "no check point is measured in this one"),
    "one strip, one check point": ("04-validation", "1 check point cannot show a distribution"),
    "parallel heads": ("02-synthetic-image", "make no mosaic"),
    "heads without control": ("02-synthetic-image", "make no mosaic"),
    "300 km": ("00-flight", "opposite directions"),
}
"""What is said of some flights, and where."""


OF_NAMES = [name if name == "parallel heads" else repeats(name) for name in planned.NAMES]


@pytest.fixture(scope="module", params=OF_NAMES)
def texts(request, tmp_path_factory):
    """What the cells of all notebooks show, by notebook and cell."""
    folder = tmp_path_factory.mktemp("unlike")
    flight = planned.write(request.param, folder)
    runner.run(flight, folder / "results", notebooks=NOTEBOOKS_PATH)
    executed = folder / "results" / "notebooks"
    places = {"flight_path": str(folder / "results" / KEPT), "results_path": str(executed.parent)}
    for name, stage in flight_book.CHAPTERS.items():
        of_stage = NOTEBOOKS[stage]
        if name != of_stage and (executed / f"{of_stage}.ipynb").is_file():
            build.run_here(name, executed, places)
    said = {}
    for path in sorted(executed.glob("*.ipynb")):
        for number, cell in enumerate(nbformat.read(path, as_version=4).cells):
            for output in cell.get("outputs", []):
                data = output.get("data", {})
                text = data.get("text/markdown", data.get("text/plain", output.get("text", "")))
                if "image/svg+xml" not in data:
                    said.setdefault((path.stem, number), []).append(text)
    return Texts(request.param, {where: "\n".join(parts) for where, parts in said.items()})


class Texts(dict):
    """What cells show, by notebook and cell, and which flight it is."""

    def __init__(self, name, said):
        super().__init__(said)
        self.name = name


def test_every_notebook_has_something_to_say(texts):
    assert len(texts) > 5


@pytest.mark.parametrize("what", NEVER)
def test_no_text_has(texts, what):
    found = {
        where: [text[max(0, m.start() - 60) : m.end() + 40] for m in re.finditer(NEVER[what], text)]
        for where, text in texts.items()
    }
    assert {where: hits for where, hits in found.items() if hits} == {}


def test_what_is_peculiar_to_a_flight_is_said(texts):
    notebook, sentence = SAYS.get(texts.name, ("00-flight", "measured image points"))
    said = " ".join(text for (name, _), text in texts.items() if name == notebook)
    assert sentence in " ".join(said.split())


def test_no_overlap_is_larger_than_all(texts):
    table = next(t for (n, _), t in texts.items() if n == "00-flight" and "side overlap" in t)
    rows = [line.split("|")[-3:-1] for line in table.splitlines()[2:] if line.startswith("|")]
    shares = [float(cell) for row in rows for cell in row if cell.strip() not in {"–", ""}]
    assert all(0 <= share <= 100 for share in shares)


def test_the_papers_values_stand_beside_its_own_cameras_only(texts):
    found = {where: re.findall(OF_STUDY, text) for where, text in texts.items()}
    assert {where: hits for where, hits in found.items() if hits} == {}


def test_a_class_is_told_only_where_the_standard_has_enough_points(texts):
    said = [text for (name, _), text in texts.items() if name == "04-validation"]
    if any("not stated, n = " in text for text in said):
        assert not any("class A" in text for text in said)
        assert any("The standard PEC-PCD asks for 20 points" in text for text in said)


# --- every setting of flight.toml, through all notebooks and the report ------------------------


SINGLE, HEADS = "single-head", "acx4"
"""The flights: of one camera, and of four heads in which everything is measured."""

CAMERA = {SINGLE: "CAM", HEADS: "SYN"}

KNOWN = {keys: value for keys, value, _ in rows(FLIGHT)}
"""Every key of flight.toml."""

CHOICES = {keys: value.choices for keys, value in KNOWN.items() if value.choices}

MOUNTED = {"lever_x_m": 0.02, "lever_y_m": 0.01, "lever_z_m": -0.15}

TOGETHER = {
    "surveyed lever arm": {
        ("cameras", NAME, "lever_sigma_m"): [0.05, 0.05, 0.3],
        ("session", "date"): dt.date(2026, 5, 2),
        ("session", "temperature_c"): 12.5,
        ("certificate", "number"): "2026-031",
        ("certificate", "operator"): "Survey company",
        ("certificate", "laboratory"): "Laboratory",
        ("certificate", "imu"): "POS",
        ("certificate", "imu_serial"): "4711",
        ("certificate", "gnss_base"): "UFPR",
        ("certificate", "datum_epoch"): "2000.4",
        ("certificate", "antenna_lever_m"): [0.1, 0.0, 1.2],
        ("certificate", "valid_until"): dt.date(2028, 5, 2),
        **{
            ("certificate", "cameras", NAME, key): "A 1"
            for (*table, key), *_ in rows(FLIGHT)
            if table == ["certificate", "cameras", NAME]
        },
    },
    "declared boresight": {
        ("cameras", NAME, "mount_sigma_deg"): 0.5,
        ("refraction",): "standard",
        ("stages", "mounting", "gnss"): ["shift"],
        ("adjustment", "smallest_angle_deg"): 3.0,
    },
    "held boresight": {
        ("stages", "mounting", "fix"): ["boresight"],
        ("stages", "mounting", "weights"): "estimated",
        ("apriori", "gnss_correlated_share"): 0.5,
        ("apriori", "gnss_correlation_s"): 300.0,
        ("apriori", "attitude_correlated_share"): 0.5,
        ("apriori", "attitude_correlation_s"): 300.0,
    },
    "held lever arm and delay": {
        ("stages", "mounting", "fix"): ["lever_arm"],
        ("stages", "mounting", "gnss"): ["drift", "delay", "shift"],
        ("stages", "mounting", "attitude"): ["deviation"],
    },
}
"""Settings that are run through the notebooks of the flight of one camera, some at a time."""

USUAL = ("surveyed lever arm", "held lever arm and delay")
"""Of these, in the usual tests, without notebooks."""


def of_design(tables):
    """Return every setting, by its dotted key, that the tables of a flight.toml have."""
    return {keys for keys in KNOWN if value_of(tables, keys) is not None}


def value_of(tables, keys):
    for key in keys:
        one = next(iter(tables.values()), None) if key == NAME else tables.get(key)
        tables = one if isinstance(one, dict) else {}
    return one


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """Return a function that writes a small flight of a design, with other settings."""
    at = tmp_path_factory.mktemp("settings")

    def flown(design, name, changes):
        blocks = ("heads", "calibration") if design == HEADS else ("calibration",)
        options = acx4sim.Options(tie_points=dict.fromkeys(blocks, 60))
        acx4sim.write(acx4sim.DESIGNS[design](seed=1, options=options), at / name)
        toml = at / name / "flight.toml"
        tables = tomllib.loads(toml.read_text())
        for keys, value in changes.items():
            place = tables
            for key in keys[:-1]:
                place = place.setdefault(CAMERA[design] if key == NAME else key, {})
            place[keys[-1]] = value
        toml.write_text(written(tables))
        return at / name

    return flown


def written(tables, above=()):
    """Return tables as TOML."""
    plain = [f"{key} = {shown(v)}" for key, v in tables.items() if not isinstance(v, dict)]
    head = [f"[{'.'.join(above)}]"] if above and plain else []
    inner = [written(v, (*above, key)) for key, v in tables.items() if isinstance(v, dict)]
    return "\n".join([*head, *plain, *inner]) + "\n"


def shown(value):
    return value.isoformat() if isinstance(value, dt.date) else json.dumps(value)


def run_whole(flight, notebooks=None):
    """Run a flight, write its report, and return the summary of its results."""
    results = flight.with_name(f"{flight.name} results")
    outcome = runner.run(flight, results, notebooks=notebooks)
    page.write(results, results.with_suffix(".html"))
    for path in results.glob("notebooks/*.ipynb"):
        text = path.read_text("utf-8")
        assert '"output_type": "error"' not in text
        assert '"name": "stderr"' not in text
    assert "validation" in outcome.ran
    return folder.entries(results)


def choices():
    """Yield every setting that has a few values, each with one of them, or with some in a list."""
    tried = {keys: value for changes in TOGETHER.values() for keys, value in changes.items()}
    for keys, known in CHOICES.items():
        if keys[-1] == "estimate":
            values = [list(known[n::3]) for n in range(3)]
        else:
            values = [one for one in known if tried.get(keys) != one]
            values = [] if isinstance(tried.get(keys), list) else values
        for value in values:
            yield keys, value


def test_no_setting_is_without_a_run(flights):
    """A key that is new in flight.toml has a value above, or stands in the flights' own file."""
    tried = {keys for changes in TOGETHER.values() for keys in changes} | {*CHOICES}
    for design in (SINGLE, HEADS):
        toml = flights(design, f"declared {design}", {}) / "flight.toml"
        tried |= of_design(tomllib.loads(toml.read_text()))
    lens = {keys for keys in KNOWN if keys[:2] == ("cameras", NAME)}
    assert KNOWN.keys() - tried - lens == {("format",)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "notebooks"),
    [
        (name, None) if name in USUAL and notebooks is None else repeats(name, notebooks)
        for name in TOGETHER
        for notebooks in (None, NOTEBOOKS_PATH)
    ],
)
def test_settings_run_through_all_stages_and_the_report(flights, name, notebooks):
    flight = flights(SINGLE, f"{name} {bool(notebooks)}", {**declared(), **TOGETHER[name]})
    summary = run_whole(flight, notebooks)
    assert summary["mounting/single_step"]["converged"]
    assert summary["validation/single_step"]["n_points"] > 0


def declared():
    """Return what the settings of a case are about."""
    values = {**MOUNTED, "xp_mm": 0.01, "yp_mm": -0.01, "k1": 1e-9, "k2": 0.0, "k3": 0.0}
    values |= {
        "p1": 0.0,
        "p2": 0.0,
        "b1": 0.0,
        "b2": 0.0,
        "mount_phi_deg": 0.1,
        "mount_omega_deg": 0.1,
    }
    return {("cameras", NAME, key): value for key, value in values.items()}


@pytest.mark.slow
@pytest.mark.parametrize("notebooks", [None, repeats(NOTEBOOKS_PATH)])
@pytest.mark.repeats
def test_heads_run_through_all_stages_and_the_report(flights, notebooks):
    changes = {("synthetic", "measured_in"): "heads", ("stages", "heads", "estimate"): ["k1", "k2"]}
    changes |= {("cameras", NAME, "lever_x_m"): 0.1, ("cameras", NAME, "lever_sigma_m"): 0.5}
    changes |= {("cameras", NAME, "mount_sigma_deg"): [1.0, 1.0, 1.0]}
    summary = run_whole(flights(HEADS, f"heads {bool(notebooks)}", changes), notebooks)
    assert {"heads/bundle/CAM1", "mounting/rig", "validation/rig"} <= summary.keys()


@pytest.mark.slow
def test_the_last_choice_of_every_setting_of_one_camera_runs_with_those_of_the_others(flights):
    chosen = {keys: value for keys, value in choices() if not {"heads", "synthetic"} & {*keys}}
    assert len(chosen) > 2
    summary = run_whole(flights(SINGLE, "chosen", {**declared(), **chosen}))
    assert {name.partition("/")[0] for name in summary} >= {"mounting", "validation"}


# --- the notebooks of the stages, run by papermill itself with the usual kernel ----------------


WITHOUT_HEADS = {
    "01-head-calibration": "the flight has no block heads",
    "02-synthetic-image": "the flight has no block heads",
    "08-rig": "there are no heads",
}
USUAL_FLIGHT = {"mounting": "03-mounting-calibration"}
"""Notebooks that are run in the usual tests, on a flight of one camera, by their stages."""

DIRECTIVE = re.compile(r"^\s*(`{3,}|:{3,})\{", re.MULTILINE)


@pytest.fixture(scope="module", params=["single", repeats("heads"), repeats("single, all")])
def ran(request, tmp_path_factory):
    """The name of a flight, a folder with its results, and the outputs of every notebook."""
    at = tmp_path_factory.mktemp(request.param)
    heads = request.param == "heads"
    flown = in_heads.small() if heads else acx4sim.DESIGNS["single-head"](seed=1)
    acx4sim.write(flown, at / "flight")
    (at / "empty").mkdir()
    stages = USUAL_FLIGHT if request.param == "single" else NOTEBOOKS
    outputs = {name: run(at, name, "results") for name in stages.values()}
    assert not list((at / "empty").iterdir())
    return request.param, at, outputs


def run(at, name, results, **parameters):
    """Run a notebook in an empty folder; return the outputs of its cells."""
    given = {"flight_path": str(at / "flight"), "results_path": str(at / results)}
    out = at / f"{name}.ipynb"
    papermill.execute_notebook(
        ROOT / "notebooks" / f"{name}.ipynb",
        out,
        parameters={**given, **parameters},
        cwd=at / "empty",
        kernel_name="python3",
        progress_bar=False,
    )
    cells = nbformat.read(out, as_version=4).cells
    return [output for cell in cells for output in cell.get("outputs", [])]


@pytest.mark.slow
def test_every_figure_is_an_image_and_nothing_is_an_error(ran):
    for output in itertools.chain(*ran[2].values()):
        assert output.output_type in ("display_data", "execute_result")
        if "<Figure" in output.data.get("text/plain", ""):
            assert "image/png" in output.data


@pytest.mark.slow
def test_no_output_has_a_directive(ran):
    shown = itertools.chain(*ran[2].values())
    text = [o.data[kind] for o in shown for kind in o.data if kind.startswith("text/")]
    assert not [one for one in text if DIRECTIVE.search(one)]


@pytest.mark.slow
def test_the_results_are_those_of_a_run_and_name_the_flight(ran):
    kind, at, _ = ran
    stages = [*USUAL_FLIGHT] if kind == "single" else STAGES
    runner.run(at / "flight", at / "by_run", stages=stages)
    plain, by_run = (
        {p.relative_to(at / name): p.read_bytes() for p in (at / name).rglob("*") if p.is_file()}
        for name in ("results", "by_run")
    )
    assert plain == by_run
    said = provenance.read_run(at / "results")
    assert said.provenance.files == provenance.checksums(reader.read(at / "flight"))


@pytest.mark.slow
def test_report_export_and_compare_take_the_results(ran, acx4, tmp_path):
    kind, at, _ = ran
    results = shutil.copytree(at / "results", tmp_path / "results")
    assert acx4("report", results, "--out", tmp_path / "report.html")[0] in (0, 1)  # by its verdict
    assert (tmp_path / "report.html").is_file()
    assert acx4("export", results, "--to", "toml", "--out", tmp_path / "exported")[0] == 0
    if kind == "single, all":
        acx4sim.write(acx4sim.DESIGNS["single-head"](seed=2), tmp_path / "flight2")
        runner.run(tmp_path / "flight2", tmp_path / "results2")
        assert acx4("compare", results, tmp_path / "results2", "--out", tmp_path / "c")[0] in (0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["04-validation", repeats("02-synthetic-image")])
def test_a_stage_alone_says_in_its_last_line_what_to_run_first(ran, name):
    kind, at, _ = ran
    if kind != "heads" and name in WITHOUT_HEADS:
        pytest.skip("ends in a sentence")
    with pytest.raises(papermill.PapermillExecutionError) as caught:
        run(at, name, "none")
    assert "run first: notebook 0" in str(caught.value).strip().splitlines()[-1]
