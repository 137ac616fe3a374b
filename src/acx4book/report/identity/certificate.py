"""The first page: who certifies what, the calibrated values, and what was not examined."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import pandas as pd

from acx4book.report.identity.describe import ITEM, VALUE
from acx4book.report.material import Material
from acx4book.report.parameters.lens import balanced, lenses
from acx4book.report.parameters.tables import head_table
from acx4book.report.shown import Text, show, table
from acx4book.report.verdict.finding import Finding
from acx4book.report.verdict.verdict import statement
from acx4book.report.words import heading, listed, parameter_title
from acx4book.typesetting.labels import with_unit
from acx4book.typesetting.myst import scientific
from acx4book.typesetting.plain_text import Markup
from acx4lib.flight.setup import Certificate, Device
from acx4lib.geometry.camera import Camera
from acx4lib.results import folder

VALUES = "Calibrated values and standard deviations"
HEADS = "Interior orientation parameters of the heads, with their standard deviations"
ALONE = (
    "a bundle adjustment with self-calibration of every head by itself; standard deviations as "
    "above, with the variance of unit weight of each head; what is not listed is held as "
    "flight.toml gives it"
)


def first_page(material: Material, found: Sequence[Finding]) -> Text:
    """Return the first page of a report: what was calibrated, the values, and whether they hold."""
    stated = table(certificate_table(material), "The calibration", name="tab-report-certificate")
    heads = pd.DataFrame()
    if folder.has(material.found, "heads/bundle"):
        heads = head_table(material, "heads/bundle")
    return show(
        missing_sentence(material) or stated,
        stated if missing_sentence(material) else "",
        statement(found),
        table(value_table(material), VALUES, name="tab-report-values", obtained=origin(material)),
        "" if heads.empty else table(heads, HEADS, name="tab-report-heads", obtained=ALONE),
    )


def certificate_table(material: Material) -> pd.DataFrame:
    """Return what identifies the calibration; what flight.toml does not state is left out."""
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
    """Return the cameras that are certified: those calibrated, or the given ones validated."""
    methods = [material.calibration] if material.calibration else []
    methods += [m for m in ("heads/bundle",) if folder.has(material.found, m)]
    names = [name for m in methods for name in folder.cameras(material.found, m)]
    return list(dict.fromkeys(names)) or list(material.flight.cameras)


def _by_format(cameras: Iterable[Camera]) -> dict[str, list[str]]:
    """Return the names of cameras by the text that says the size of their images."""
    found: dict[str, list[str]] = {}
    for camera in cameras:
        width, height = camera.pixel_mm * np.array([camera.width_px, camera.height_px])
        pixels = f"{camera.width_px} × {camera.height_px} pixels of {1000 * camera.pixel_mm:.3g} µm"
        found.setdefault(f"{pixels}, {width:.2f} × {height:.2f} mm", []).append(camera.name)
    return found


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


def missing_sentence(material: Material) -> str:
    """Return a sentence on a flight that states nothing for its certificate."""
    if material.flight.certificate != Certificate():
        return ""
    return (
        "The table [certificate] of flight.toml states no serial numbers, laboratory or operator: "
        "this report identifies the camera by its format alone."
    )


def value_table(material: Material) -> pd.DataFrame:
    """Return the calibrated values, with those of the heads beside each other where there are any.

    One row per parameter of the calibration's camera, and its balanced focal length.
    """
    method = material.calibration
    names = folder.cameras(material.found, method) if method else ()
    if len(names) != 1:
        return head_table(material, method) if names else pd.DataFrame()
    found = folder.parameters(material.found, method, names[0])
    rows = [
        _row(parameter_title(str(name)), row["value"], row["sigma"], str(row["unit"]))
        for name, row in found.iterrows()
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


def origin(material: Material) -> str:
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
