"""The report of a run: its record as JSON, a page of HTML, and the same page as a PDF/A."""

from __future__ import annotations

import errno
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from importlib import import_module, resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment

from acx4book.report.findings import findings
from acx4book.report.groups import qualities
from acx4book.report.material import Material, checked_points, read, validated
from acx4book.report.verdict import NOT_EXAMINED, Finding, rows, statement
from acx4book.report.words import adjustment_title, begun, listed, parameter_title, with_unit
from acx4book.typesetting.myst import numbers, p_value, value_and_sigma
from acx4files.flight.settings import Device
from acx4files.results import folder, whole_files
from acx4files.results.whole_files import check_file
from acx4lib.errors import Acx4Error, OutputError, visible
from acx4lib.geometry.camera import INTERIOR, Camera
from acx4lib.geometry.parameters import AXES, REPORTED
from acx4lib.least_squares.verdict import FAILS, LEVEL

FORMAT = 2
"""Version of the record; raised when a key is removed or changes its meaning."""

MARKS = {
    ".html": b'<meta name="generator" content="acx4',
    ".json": b'"made_by": "acx4 report"',
    ".pdf": b"/Title(Calibration report)",
}
"""Marks of reports, which a newer report may replace; of a PDF the first of its bookmarks."""

TESTS = (
    *("n_observations", "n_unknowns", "redundancy", "sigma0_squared", "chi_square_p"),
    *("n_rejected", "expected_rejections", "condition", "weakest", "declared"),
)
"""Entries of summary.json repeated for every adjustment."""

HERE = resources.files("acx4book.report")

STANDARDS = ["a-2a", "ua-1"]
"""Archival and accessible: PDF/A-2 with tags, PDF/UA-1."""


class TypesetError(Acx4Error):
    """A report was not typeset."""


def write(results: str | Path, out: str | Path, *, pdf: bool = False) -> None:
    """Write the calibration report of a run as an HTML file, with its record as JSON beside it.

    Parameters
    ----------
    results : path
        Results of a run.
    out : path
        The page; an existing report is replaced, any other existing file is not. The other files
        have the endings .json and .pdf.
    pdf : bool
        Whether to write it as PDF/A, too.

    Raises
    ------
    FlightError
        Where the results are missing, not complete, or do not belong together.
    OutputError
        Where a file must not be replaced by a report, or there is no space for it.
    TypesetError
        Where the package typst is missing, or does not typeset the report.
    OSError
        Where a file cannot be written otherwise.
    """
    out = Path(out)
    if not out.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(out.parent))
    if out.suffix in (".json", ".pdf"):
        msg = f"{out}: name the page, such as {out.with_suffix('.html').name}"
        raise OutputError(f"{msg}; JSON and PDF stand beside it")
    places = {kind: out.with_suffix(kind) for kind in MARKS if pdf or kind != ".pdf"}
    places[".html"] = out
    for kind, place in places.items():
        check_file(place, mark=MARKS[kind], what="a report of acx4")
    material = read(results)
    found = findings(material)
    shown = texts(material, found)
    written: dict[str, str | bytes] = {
        ".json": json.dumps(record(material, found), indent=1, ensure_ascii=False) + "\n",
        ".html": _template().render(shown),
        **({".pdf": _typeset(shown)} if pdf else {}),
    }
    whole_files.write_all({places[kind]: content for kind, content in written.items()})


def _template() -> Any:
    jinja = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return jinja.from_string((HERE / "report.html").read_text("utf-8"))


def _typeset(shown: Mapping[str, Any]) -> bytes:
    """Return the PDF/A of the texts of a page, the same bytes every time."""
    try:
        typst: Any = import_module("typst")
    except ImportError as error:
        what = "a PDF is set by the package typst, which is not here"
        raise TypesetError(f"{what}: pip install 'acx4lib[pdf]'") from error
    from matplotlib import get_data_path  # noqa: PLC0415 has the fonts, and few reports need them

    files = {
        "main.typ": (HERE / "report.typ").read_bytes(),
        "report.json": json.dumps(_changed(shown, _with_glyphs)).encode(),
    }
    try:
        return bytes(
            typst.compile(
                files,
                format="pdf",
                font_paths=[str(Path(get_data_path(), "fonts", "ttf"))],
                ignore_system_fonts=True,
                pdf_standards=STANDARDS,
            )
        )
    except typst.TypstError as error:
        msg = f"the report was not typeset: {error.message.splitlines()[0]}"
        raise TypesetError(msg) from error


def _changed(value: Any, change: Callable[[Any], Any]) -> Any:
    """Return nested mappings and lists with every value changed."""
    if isinstance(value, Mapping):
        return {key: _changed(part, change) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_changed(part, change) for part in value]
    return change(value)


def _with_glyphs(value: Any) -> Any:
    """Escape characters that the fonts do not have, and let long words break anywhere."""
    from acx4book.typesetting.style import shapes  # noqa: PLC0415 loads matplotlib

    if not isinstance(value, str):
        return value
    drawn = "".join(c if ord(c) in shapes() else ascii(c)[1:-1] for c in value)
    return re.sub(r"\S{24,}", lambda word: re.sub("(.{8})", "\\1\u200b", word[0]), drawn)


# --- the record ------------------------------------------------------------------------------


def record(material: Material, found: Sequence[Finding]) -> dict[str, Any]:
    """Return the content of the report for JSON; book/results.md explains the keys.

    An unknown number is None.
    """
    flight = material.flight
    whole = {
        "made_by": "acx4 report",
        "format": FORMAT,
        "results_of": material.date.isoformat(),
        "flight": {
            "name": flight.name,
            "date": flight.session.date,
            "temperature_c": flight.session.temperature_c,
            "crs": flight.grid.crs,
            "sha256": material.provenance.digest,
            "files_sha256": dict(material.provenance.files),
        },
        "software": {n: dict(s["versions"]) for n, s in material.provenance.stages.items()},  # type: ignore[call-overload] # read from JSON
        "certificate": _stated(asdict(flight.certificate)),
        "statement": {
            **statement(found),
            "level": LEVEL,
            "procedure": "Holm",
            "findings": [_finding(f) for f in found],
            "not_examined": NOT_EXAMINED,
        },
        "calibration": material.calibration or None,
        "methods": {name: _method(material, name) for name in material.methods},
        "adjustments": {
            name: {key: material.entry(name).get(key) for key in TESTS}
            for name in material.adjustments
        },
        "groups": [asdict(quality) for quality in qualities(material)],
        "check_points": _checked(material.entry(validated(material))),
    }
    plain: dict[str, Any] = _changed(whole, _plain)
    return plain


def _finding(finding: Finding) -> dict[str, Any]:
    """Return a finding with its tests; p is the smallest, by itself and among all tests."""
    return {
        **{key: getattr(finding, key) for key in ("question", "state", "p", "p_joint", "answer")},
        "tests": [
            {
                **{key: getattr(test, key) for key in ("name", "p", "p_joint", "state")},
                **{key: getattr(test, key) for key in ("size", "limit", "unit")},
                "fails": test.state == FAILS,
            }
            for test in finding.tests
        ],
    }


def _stated(value: dict[str, Any]) -> dict[str, Any]:
    """Return a nested dictionary without its empty entries."""
    inner = {k: _stated(v) if isinstance(v, dict) else v for k, v in value.items()}
    return {key: entry for key, entry in inner.items() if entry}


def _method(material: Material, name: str) -> dict[str, Any]:
    cov = folder.covariance(material.found, name)
    return {
        "cameras": {
            camera: _camera(
                material.flight.cameras[camera], folder.parameters(material.found, name, camera)
            )
            for camera in folder.cameras(material.found, name)
        },
        "parameters": list(cov.index),
        "covariance_matrix": cov.to_numpy().tolist(),
    }


def _camera(camera: Camera, rows: pd.DataFrame) -> dict[str, Any]:
    columns = rows.rename(columns={"sigma": "standard_deviation"})
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "pixel_um": 1000 * camera.pixel_mm,
        "interior": {
            REPORTED[key][0]: rows["value"].get(REPORTED[key][0], getattr(camera.interior, key))
            for key in INTERIOR
        },
        "parameters": columns[["value", "standard_deviation", "unit"]].to_dict("index"),
    }


def _checked(entry: Mapping[str, Any]) -> dict[str, Any] | None:
    points = entry.get("points")
    if not isinstance(points, dict):
        return None
    return {
        "n_points": entry.get("n_points"),
        **{key: points.get(key) for key in ("mean", "std", "rms", "mean_sigma", "classes")},
        "joint_chi_square_p": entry.get("joint_chi_square_p"),
    }


def _plain(value: Any) -> Any:
    """Convert a value to a type of JSON; a non-finite number becomes None."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if isinstance(value, int | str | None) else str(value)  # a date


# --- the texts of the page, which both templates show ----------------------------------------


def texts(material: Material, found: Sequence[Finding]) -> dict[str, Any]:
    """Return the texts of the page, by the names in the templates.

    Characters that are no text, such as control characters, are escaped as in Python.
    """
    told = statement(found)
    whole = {
        "name": material.flight.name,
        "date": f"{material.date.day} {material.date:%B %Y}",
        "day": [material.date.year, material.date.month, material.date.day],
        "state": told["state"],
        "title": told["title"],
        "sentences": [numbers(sentence) for sentence in told["sentences"]],
        "stated": [*_items(material)],
        "values": [*_values(material), *_points(material)],
        "questions": [*rows(found)],
        "evidence": [_adjustments(material), _groups(material)],
        "identity": [*_identity(material)],
        "not_examined": "; ".join(NOT_EXAMINED),
    }
    escaped: dict[str, Any] = _changed(whole, lambda v: visible(v) if isinstance(v, str) else v)
    return escaped


def _items(material: Material) -> Iterator[tuple[str, str]]:
    """Yield what flight.toml states for the certificate, and the formats of the cameras."""
    flight, stated, session = material.flight, material.flight.certificate, material.flight.session
    names = [name for m in material.methods for name in folder.cameras(material.found, m)]
    formats: dict[str, list[str]] = {}
    for name in dict.fromkeys(names or flight.cameras):
        camera = flight.cameras[name]
        if device := stated.cameras.get(name):
            yield f"Camera {name}", _device(device)
        size = f"{camera.width_px} × {camera.height_px} pixels of {1000 * camera.pixel_mm:.3g} µm"
        formats.setdefault(size, []).append(name)
    yield from ((f"Format of {listed(names)}", size) for size, names in formats.items())
    celsius, lever = session.temperature_c, ", ".join(f"{m:+.3f}" for m in stated.antenna_lever_m)
    said = {
        "Certificate number": stated.number,
        "Calibrated by": stated.laboratory,
        "Flown by": stated.operator,
        "Flown on": str(session.date or ""),
        "Temperature": f"{celsius:g} °C" if np.isfinite(celsius) else "",
        "IMU": " no. ".join(filter(None, (stated.imu, stated.imu_serial))),
        "GNSS antenna": f"{lever} m from the IMU, along the body's x, y, z" if lever else "",
        "GNSS base, datum": "; ".join(filter(None, (stated.gnss_base, stated.datum_epoch))),
        "Valid until": str(stated.valid_until or ""),
        "Simulated": "the measurements were computed" if flight.simulated else "",
    }
    yield from ((label, text) for label, text in said.items() if text)


def _device(device: Device) -> str:
    """Return maker, models and serial numbers in one line."""
    parts = (
        ("camera", f"{device.maker} {device.model}".strip(), device.serial),
        ("lens", device.lens and f"lens {device.lens}", device.lens_serial),
        ("sensor", device.sensor and f"sensor {device.sensor}", device.sensor_serial),
    )
    return "; ".join(
        f"{model or kind} no. {serial}" if serial else model
        for kind, model, serial in parts
        if model or serial
    )


Table = dict[str, Any]
"""Texts of a table: title, note, head, rows, and pairs below it."""


def _table(
    title: str, note: str, head: Sequence[str], rows: Sequence[Sequence[str]], **more: Any
) -> Table:
    return {"title": title, "note": note, "head": head, "rows": rows, "below": [], **more}


VALUES = {"heads/bundle": "The heads", "heads/relative_orientation": "Heads in the synthetic frame"}


def _values(material: Material) -> Iterator[Table]:
    """Yield the tables of calibrated values, a column per camera."""
    for name in (material.calibration or "mounting/rig", *VALUES):
        if not folder.has(material.found, name):
            continue
        table = folder.rows(material.found, "parameters", name)
        cameras, cells = [*dict.fromkeys(table["camera"])], dict[str, dict[str, str]]()
        for row in table.to_dict("records"):
            title = with_unit(parameter_title(row["parameter"]), row["unit"])
            text = numbers(value_and_sigma(row["value"], row["sigma"]))
            cells.setdefault(title, {})[row["camera"]] = text
        yield _table(
            VALUES.get(name, "Calibrated values and their standard deviations"),
            _origin(material, name),
            ["Parameter", *(camera or "whole flight" for camera in cameras)],
            [[title, *(own.get(c, "") for c in cameras)] for title, own in cells.items()],
        )


def _origin(material: Material, name: str) -> str:
    """Return how values were obtained, and what was held."""
    adjusted = [n for n in material.adjustments if f"{n}/".startswith(f"{name}/")]
    if not adjusted:
        return "Mean of the exposures that all heads share; σ from the covariance of the heads."
    entries = [material.entry(n) for n in adjusted]
    n = sum(int(entry["n_observations"]) for entry in entries)
    held = {
        f"{parameter_title(key)} = {told['value']:g}"
        for entry in entries
        for key, told in (entry.get("held") or {}).items()
        if "/" in key
    }
    held |= {part.replace("_", " ") for part in material.flight.fix if not name.startswith("heads")}
    sigma0 = listed([f"{float(entry['sigma0_squared']) ** 0.5:.3f}" for entry in entries])
    how = (
        "Every head by itself, from"
        if len(entries) > 1
        else f"{begun(adjustment_title(name))} adjustment of"
    )
    said = f"{how} {n:,} observations; σ are multiplied by σ₀ = {sigma0}."
    return f"{said} Held: {listed(sorted(held))}." if held else said


def _points(material: Material) -> Iterator[Table]:
    """Yield the tables of differences at check points, and of the accuracy classes reached."""
    entry = material.entry(validated(material))
    points = entry.get("points")
    if not isinstance(points, dict) or not entry.get("n_points"):
        return
    by_axis = []
    for k, axis in enumerate(AXES):
        sigma = checked_points(material)[f"sigma_{axis}_m"].to_numpy(dtype=float)
        mean = numbers(value_and_sigma(points["mean"][k], points["mean_sigma"][k]))
        predicted = float(np.sqrt(np.mean(sigma**2)))
        by_axis.append([axis, mean, f"{points['rms'][k]:.3f}", f"{predicted:.3f}"])
    yield _table(
        f"{entry['n_points']} independent check points",
        "Estimated minus surveyed, one difference per point from all its rays.",
        ["", "Mean (m)", "RMS (m)", "Predicted RMS (m)"],
        by_axis,
        below=[*_classes(points.get("classes") or {})],
    )


def _classes(told: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the accuracy classes that are reached, by standard."""
    scales = sorted(told.get("pec_pcd", {}).items(), key=lambda of: (len(of[0]), of[0]))
    if of := {scale: f"{reached['plan']} / {reached['height']}" for scale, reached in scales}:
        each = "; ".join(f"{scale} {classes}" for scale, classes in of.items())
        yield "PEC-PCD, plan / height", each if len({*of.values()}) > 1 else min(of.values())
    if reached := told.get("asprs_2023"):
        classes = (str(reached[key]) for key in ("horizontal", "vertical", "three_d"))
        yield "ASPRS 2023, horizontal / vertical / 3D", " / ".join(dict.fromkeys(classes))


def _adjustments(material: Material) -> Table:
    tested = []
    for name in material.adjustments:
        entry = material.entry(name)
        p, expected = entry["chi_square_p"], entry.get("expected_rejections")
        by_chance = "" if expected is None else f" ({expected:.1f})"
        tested.append(
            [
                begun(adjustment_title(name)),
                *(f"{entry[key]:,}" for key in ("n_observations", "redundancy")),
                *(f"{entry['sigma0_squared']:.3f}", "" if p is None else p_value(p)),
                f"{entry['n_rejected'] or 0:,}{by_chance}",
            ]
        )
    return _table(
        "The adjustments",
        "p: two-sided probability of a σ₀² as far from one; in brackets what chance rejects.",
        ["", "Observations", "Redundancy", "σ₀²", "p", "Rejected"],
        tested,
    )


def _groups(material: Material) -> Table:
    groups = [
        [
            with_unit(f"{begun(adjustment_title(g.adjustment))}: {g.group}", g.unit),
            *(f"{g.n:,}", f"{g.sigma:.3g}", f"{g.sigma * g.ratio:.3g}"),
            *("" if np.isnan(g.p) else p_value(g.p), f"{g.detectable:.3g}", f"{g.weak:,}"),
        ]
        for g in qualities(material)
    ]
    return _table(
        "Groups of observations",
        "σ as stated and by the residuals; the error that is found with 80 % (median); the number "
        "with a redundancy number below 0.1, in which an error would hardly be seen.",
        ["", "Number", "σ stated", "σ found", "p", "Detectable", "Weak"],
        groups,
    )


def _identity(material: Material) -> Iterator[tuple[str, str]]:
    """Yield the identity of the flight, its files and the software."""
    flight, stages = material.flight, material.provenance.stages
    heights = flight.grid.height_system
    versions = {
        ", ".join(f"{name} {v}" for name, v in dict(run["versions"]).items())  # type: ignore[call-overload] # read from JSON
        for run in stages.values()
    }
    yield "Flight", flight.name
    yield "Coordinate system", f"{flight.grid.name} ({flight.grid.crs})"
    yield "Heights", "above the ellipsoid" if heights == "ellipsoidal" else f"by {heights}"
    yield "Refraction", flight.refraction
    yield "Stages", listed([*stages])
    yield "Software", "; ".join(sorted(versions))
    yield "Data, SHA-256", material.provenance.digest
    yield from material.provenance.files.items()
