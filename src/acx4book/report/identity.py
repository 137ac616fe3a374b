"""Certificate, identification, method and data of a calibration."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.report.findings import Finding, statement
from acx4book.report.markdown import Text, heading, listed, parameter_title, show, table
from acx4book.report.material import Material
from acx4book.report.parameters import balanced, head_table, lenses
from acx4book.typesetting.myst import LABELS, say, scientific, with_unit
from acx4book.typesetting.plain_text import Markup, code
from acx4files.flight.settings import Certificate, Device
from acx4files.results import folder
from acx4files.results.folder import STAGES
from acx4lib.block import Block
from acx4lib.bundle.rejections import CRITICAL
from acx4lib.calibration.estimates import TWO_STEP
from acx4lib.design import levels
from acx4lib.geometry.camera import Camera
from acx4lib.least_squares.covariance import GaussMarkov

# --- The first page: who certifies what, the calibrated values, and what was not examined


VALUES = "Calibrated values and standard deviations"
HEADS = "Interior orientation parameters of the heads, with their standard deviations"
ALONE = (
    "a bundle adjustment with self-calibration of every head by itself; standard deviations as "
    "above, with the variance of unit weight of each head; what is not listed is held as "
    "flight.toml gives it"
)


def first_page(material: Material, found: Sequence[Finding]) -> Text:
    """Return the first page of a report: the cameras, their values and the verdict."""
    stated = table(_certificate_table(material), "The calibration", name="tab-report-certificate")
    heads = pd.DataFrame()
    if folder.has(material.found, "heads/bundle"):
        heads = head_table(material, "heads/bundle")
    return show(
        _missing_sentence(material) or stated,
        stated if _missing_sentence(material) else "",
        statement(found),
        table(_value_table(material), VALUES, name="tab-report-values", obtained=_origin(material)),
        "" if heads.empty else table(heads, HEADS, name="tab-report-heads", obtained=ALONE),
    )


def _certificate_table(material: Material) -> pd.DataFrame:
    """Tabulate the identity of the calibration, as far as flight.toml states it."""
    return pd.DataFrame(_items(material), columns=[ITEM, VALUE])


def _items(material: Material) -> Iterator[tuple[str, str]]:
    stated, session = material.flight.certificate, material.flight.session
    cameras = [material.flight.cameras[name] for name in _certified(material)]
    for camera in cameras:
        if device := stated.cameras.get(camera.name):
            yield f"Camera {camera.name}", _device(device)
    for size, names in _by_format(cameras).items():
        yield "Image format", f"{listed(names)}: {size}"
    imu = " no. ".join(filter(None, (stated.imu, stated.imu_serial)))
    texts = {
        "Certificate number": stated.number,
        "Calibrated by": stated.laboratory,
        "Flown by": stated.operator,
        "Flown on": session.date.isoformat() if session.date else "",
        "Temperature": _degrees(session.temperature_c),
        "IMU": imu,
        "GNSS antenna": _antenna(stated.antenna_lever_m),
        "GNSS base, datum": "; ".join(filter(None, (stated.gnss_base, stated.datum_epoch))),
        "Valid until": stated.valid_until.isoformat() if stated.valid_until else "",
    }
    yield from ((label, text) for label, text in texts.items() if text)


def _degrees(celsius: float) -> str:
    return f"{celsius:g} °C" if np.isfinite(celsius) else ""


def _antenna(lever: tuple[float, ...]) -> str:
    if not lever:
        return ""
    xyz = ", ".join(f"{value:+.3f}" for value in lever)
    return f"{xyz} m from the IMU, along the body's x, y, z"


def _certified(material: Material) -> list[str]:
    """Return the names of the certified cameras: calibrated ones, else the given ones."""
    methods = [material.calibration] if material.calibration else []
    methods += [m for m in ("heads/bundle",) if folder.has(material.found, m)]
    names = [name for m in methods for name in folder.cameras(material.found, m)]
    return list(dict.fromkeys(names)) or list(material.flight.cameras)


def _by_format(cameras: Iterable[Camera]) -> dict[str, list[str]]:
    """Group the names of cameras by a text on the size of their images."""
    names: dict[str, list[str]] = {}
    for camera in cameras:
        width, height = camera.pixel_mm * np.array([camera.width_px, camera.height_px])
        pixels = f"{camera.width_px} × {camera.height_px} pixels of {1000 * camera.pixel_mm:.3g} µm"
        names.setdefault(f"{pixels}, {width:.2f} × {height:.2f} mm", []).append(camera.name)
    return names


def _device(device: Device) -> str:
    """Return maker, models and serial numbers in one line."""
    parts = (
        (f"{device.maker} {device.model}".strip(), device.serial),
        (device.lens and f"lens {device.lens}", device.lens_serial),
        (device.sensor and f"sensor {device.sensor}", device.sensor_serial),
    )
    kinds = ("camera", "lens", "sensor")
    return "; ".join(
        f"{model or kind} no. {serial}" if serial else model
        for kind, (model, serial) in zip(kinds, parts, strict=True)
        if model or serial
    )


def _missing_sentence(material: Material) -> str:
    """Return a sentence on a flight that states nothing for its certificate."""
    if material.flight.certificate != Certificate():
        return ""
    return (
        "The table [certificate] of flight.toml states no serial numbers, laboratory or operator: "
        "this report identifies the camera by its format alone."
    )


def _value_table(material: Material) -> pd.DataFrame:
    """Return the calibrated values; of several heads beside each other."""
    method = material.calibration
    names = folder.cameras(material.found, method) if method else ()
    if len(names) != 1:
        return head_table(material, method) if names else pd.DataFrame()
    estimates = folder.parameters(material.found, method, names[0])
    rows = [
        _row(parameter_title(str(name)), row["value"], row["sigma"], str(row["unit"]))
        for name, row in estimates.iterrows()
    ]
    (lens,) = lenses(material, method)
    balance = balanced(lens)
    rows.insert(1, _row(Markup("balanced focal length"), balance.f, balance.sigma, "mm"))
    return pd.DataFrame(rows)


def _row(label: str, value: float, sigma: float, unit: str) -> dict[str, str]:
    return {
        "Parameter": with_unit(label, unit),
        "Value": _digits(float(value), float(sigma)),
        "Standard deviation": _digits(float(sigma), float(sigma)) if sigma > 0 else "not known",
    }


def _digits(value: float, sigma: float) -> str:
    """Return a number to the second digit of its standard deviation; small ones as powers."""
    if not (sigma > 0 and np.isfinite(value)):
        return f"{value:.6g}"
    last = int(np.floor(np.log10(sigma))) - 1
    if abs(value) < 1e-3 and sigma < 1e-3 and value != 0:
        return scientific(value, digits=max(0, int(np.floor(np.log10(abs(value)))) - last))
    return f"{value:.{max(0, -last)}f}"


def _origin(material: Material) -> str:
    """Return how the calibrated values were obtained, in one or two sentences."""
    if not material.calibration:
        return "Nothing was calibrated: the cameras were validated as flight.toml gives them."
    entry = material.found.summary[material.calibration]
    sigma0 = float(str(entry["sigma0_squared"]))
    return (
        f"{heading(material.calibration)} adjustment of {entry['n_observations']:,} observations; "
        "standard deviations are the roots of the diagonal of the covariance matrix of its unknowns"
        f", multiplied by σ₀ = {np.sqrt(sigma0):.3f}."
    )


# --- Identification, method and data of a report


ITEM, VALUE = "Item", "Statement"


def identity(material: Material) -> Text:
    """Return the section on the flight, its files and the software."""
    return show(
        table(_identification(material), "Identification", name="tab-report-identification"),
        table(_files(material), "Files of the flight", name="tab-report-files", obtained=READ),
    )


def _identification(material: Material) -> pd.DataFrame:
    """Return the calibrated cameras, the date, and the software."""
    flight = material.flight
    simulated = "Simulated: the measurements were computed" if flight.simulated else ""
    rows = [("Flight", flight.name), *([("Measurements", simulated)] if simulated else [])]
    rows += [(f"Camera {name}", text) for name, text in _cameras(material).items()]
    rows += [
        ("Coordinate system", f"{flight.grid.name} ({flight.grid.crs})"),
        ("Heights", _heights(flight.grid.height_system)),
        ("Refraction", _refraction(flight.refraction)),
        ("Stages computed", listed([s for s in STAGES if s in material.provenance.stages])),
        ("Results of", f"{material.date.day} {material.date:%B %Y} (UTC)"),
        ("Software", _software(material)),
        ("Data, SHA-256", code(material.provenance.digest)),
    ]
    return pd.DataFrame(rows, columns=[ITEM, VALUE])


def method_and_data(material: Material) -> Text:
    """Return the section on method and data."""
    name, caption = "tab-report-data", "The blocks, with σ a priori"
    return show(
        _method_text(material), table(_data_table(material), caption, name=name, obtained=COUNTED)
    )


def _method_text(material: Material) -> str:
    """Describe the computation with the numbers of the equations, as Markdown."""
    flight, chosen = material.flight, material.calibration.partition("/")[2]
    values = {
        "heads": any(name.startswith("heads/bundle") for name in material.adjustments),
        "of_heads": Markup(_names(flight.estimate_heads)),
        "transferred": bool(flight.transferred),
        "method": "two_step" if chosen in TWO_STEP else chosen,
        "estimated": Markup(_names(flight.estimate_mounting)),
        "held": _spelled(flight.fix),
        "gnss": _spelled(flight.gnss) if chosen == "single_step" else "",
        "adjusted": bool(material.adjustments),
        "critical": CRITICAL,
        "validated": flight.validation is not None,
    }
    parts = METHOD.read_text("utf-8").split("\n\n")
    return "\n\n".join(filter(None, (say(part, **values).text for part in parts)))


READ = "SHA-256 of every table as it was read; the results folder keeps copies of them"
COUNTED = (
    "counted in the tables of the flight; σ are those of the tables' own columns, or of [apriori] "
    "in flight.toml, and are the weights of the adjustments"
)


def _cameras(material: Material) -> dict[str, str]:
    return {
        name: (
            f"{camera.width_px} × {camera.height_px} pixels of {1000 * camera.pixel_mm:.3g} µm; "
            f"declared focal length {camera.interior.f:g} mm"
        )
        for name, camera in material.flight.cameras.items()
    }


def _heights(heights: str) -> str:
    return "above the ellipsoid" if heights == "ellipsoidal" else f"by {heights}"


def _refraction(refraction: str) -> str:
    return "not corrected" if refraction == "none" else f"{refraction} atmosphere"


def _software(material: Material) -> str:
    """Return the software versions of the stages; several if they differ."""
    by_stage = [dict(entry["versions"]) for entry in material.provenance.stages.values()]  # type: ignore[call-overload] # read from JSON
    texts = {
        ", ".join(f"{name} {version}" for name, version in versions.items())
        for versions in by_stage
    }
    return "; ".join(sorted(texts))


def _files(material: Material) -> pd.DataFrame:
    """Return every table of the flight with its checksum."""
    return pd.DataFrame(
        [(code(name), code(sha256)) for name, sha256 in material.provenance.files.items()],
        columns=["File", "SHA-256"],
    )


# --- method ----------------------------------------------------------------------------------

METHOD = Path(__file__).with_name("method.md")
"""Template of the method text; a flight gets only the paragraphs on its own data."""


def _spelled(names: Iterable[str]) -> Markup:
    return Markup(listed([name.replace("_", " ") for name in names]))


def _names(keys: tuple[str, ...]) -> str:
    return listed([LABELS.get(key, LABELS.get(f"{key}_mm", key)) for key in keys]) or "nothing"


# --- data ------------------------------------------------------------------------------------


def _data_table(material: Material) -> pd.DataFrame:
    """Return the content of every block and its standard deviations, a column per block."""
    columns = {name: _of_block(block) for name, block in material.flight.blocks.items()}
    table = pd.DataFrame(columns)
    table.insert(0, "Quantity", table.index)
    return table.reset_index(drop=True)


def _of_block(block: Block) -> dict[str, str]:
    rays = block.rays[block.rays > 0]
    n_surveyed = len(block.control) + len(block.check)
    block_levels = levels(block)
    return {
        "cameras": ", ".join(camera.name for camera in block.cameras),
        "images": f"{len(block.images)}",
        "exposures": f"{len(block.trajectory)}",
        "strips": f"{len({s for s in block.images.strips if s}) or 'not named'}",
        "flying heights (m)": _joined([level.height_m for level in block_levels], ".0f"),
        "ground pixels (cm)": _joined([100 * level.gsd_m for level in block_levels], ".1f"),
        "measured image points": f"{len(block.image_points):,}",
        "tie points": f"{len(rays) - n_surveyed:,}",
        "images per point, mean": f"{rays.mean():.1f}" if len(rays) else "–",
        "control points": f"{len(block.control)}",
        "check points": f"{len(block.check)}",
        **_apriori(block),
    }


def _apriori(block: Block) -> dict[str, str]:
    surveyed = np.concatenate([block.control.sigma_m, block.check.sigma_m])
    position = block.trajectory.sigma_position
    attitude = np.degrees(block.trajectory.sigma_attitude)
    return {
        "σ image points (px)": _range(block.image_points.sigma_px),
        "σ survey, plan (m)": _range(surveyed[:, :2]),
        "σ survey, height (m)": _range(surveyed[:, 2]),
        "σ GNSS, plan (m)": _range(position[:, :2]),
        "σ GNSS, height (m)": _range(position[:, 2]),
        "σ roll and pitch (°)": _range(attitude[:, :2]),
        "σ heading (°)": _range(attitude[:, 2]),
        **_slow("GNSS", block.trajectory.slow_positions),
        **_slow("attitudes", block.trajectory.slow_attitudes),
    }


def _slow(quantity: str, process: GaussMarkov) -> dict[str, str]:
    """Return the correlation of errors in time; empty for independent errors."""
    if process.share == 0:
        return {}
    return {
        f"{quantity}: correlated share of σ": f"{process.share:g}",
        f"{quantity}: time constant of the correlation (s)": f"{process.time_constant_s:g}",
    }


def _joined(values: list[float], spec: str) -> str:
    return ", ".join(f"{v:{spec}}" for v in values if np.isfinite(v)) or "–"


def _range(values: np.ndarray) -> str:
    """Return the smallest and the largest number as text; a single number if they are equal."""
    if not values.size:
        return "–"
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g}"
