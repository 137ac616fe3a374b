"""Every setting of flight.toml, through all notebooks and the report."""

import datetime as dt
import json
import tomllib

import pytest

import acx4sim
from acx4book.notebooks import runner
from acx4book.notebooks.execute import Notebooks
from acx4book.notebooks.functions import Functions
from acx4book.report import page
from acx4lib.flight.reader import read
from acx4lib.flight.settings import FLIGHT
from acx4lib.flight.toml_file import NAME, rows
from acx4lib.results import folder
from support.helpers import repeats

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
    "held lever arm and delays": {
        ("stages", "mounting", "fix"): ["lever_arm"],
        ("stages", "mounting", "gnss"): ["drift", "delay", "attitude_delay", "shift"],
        ("stages", "mounting", "attitude"): ["deviation"],
    },
}
"""Settings that are run through the notebooks of the flight of one camera, some at a time."""

USUAL = [("surveyed lever arm", Functions), ("held lever arm and delays", Functions)]
"""Of these, and which way, in the usual tests."""


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


def run_whole(flight, way):
    """Run a flight, write its report, and return the summary of its results."""
    results = flight.with_name(f"{flight.name} results")
    outcome = runner.run(flight, results, way=way)
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
    ("name", "way"),
    [
        (name, way) if (name, way) in USUAL else repeats(name, way)
        for name in TOGETHER
        for way in (Functions, Notebooks)
    ],
)
def test_settings_run_through_all_stages_and_the_report(flights, name, way):
    flight = flights(SINGLE, f"{name} {way.__name__}", {**declared(), **TOGETHER[name]})
    summary = run_whole(flight, way())
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
@pytest.mark.parametrize("way", [Functions, repeats(Notebooks)])
@pytest.mark.repeats
def test_heads_run_through_all_stages_and_the_report(flights, way):
    changes = {("synthetic", "measured_in"): "heads", ("stages", "heads", "estimate"): ["k1", "k2"]}
    changes |= {("cameras", NAME, "lever_x_m"): 0.1, ("cameras", NAME, "lever_sigma_m"): 0.5}
    changes |= {("cameras", NAME, "mount_sigma_deg"): [1.0, 1.0, 1.0]}
    summary = run_whole(flights(HEADS, f"heads {way.__name__}", changes), way())
    assert {"heads/bundle/CAM1", "mounting/rig", "validation/rig"} <= summary.keys()


@pytest.mark.slow
def test_the_last_choice_of_every_setting_of_one_camera_runs_with_those_of_the_others(flights):
    chosen = {keys: value for keys, value in choices() if not {"heads", "synthetic"} & {*keys}}
    assert len(chosen) > 2
    summary = run_whole(flights(SINGLE, "chosen", {**declared(), **chosen}), Functions())
    assert {name.partition("/")[0] for name in summary} >= {"mounting", "validation"}


@pytest.mark.slow
@pytest.mark.repeats
@pytest.mark.parametrize(("keys", "value"), list(choices()), ids=str)
def test_every_choice_runs_through_all_stages_and_the_report(flights, keys, value):
    design = HEADS if {"heads", "synthetic"} & {*keys} else SINGLE
    changes = {**({} if design == HEADS else declared()), keys: value}
    name = f"{' '.join(keys)} {value}"
    flight = flights(design, name, changes)
    if keys == ("synthetic", "measured_in"):
        assert read(flight).synthetic.measured_in == value
    summary = run_whole(flight, Functions())
    assert {name.partition("/")[0] for name in summary} >= {"mounting", "validation"}
