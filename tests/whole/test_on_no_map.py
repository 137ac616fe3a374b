"""Flights of `crs = "local"`: of a test field, of another program, of nothing but pictures."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.report import page
from acx4files.flight.reader import from_tables, read
from acx4files.flight.summary import summary
from acx4files.stages import mounting, order
from acx4lib.calibration.mounting import single_step
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.geometry.frames import opk_from_rotation
from acx4lib.model import Model
from support import blocks
from support.flights.written import write_flight

FREE = ("f", "xp", "yp", "k1")
SETTINGS = {
    "name": "field",
    "crs": "local",
    "stages": {"mounting": {"estimate": ["f_mm", "xp_mm", "yp_mm", "k1"]}},
}
XYZ, OPK = ("east_m", "north_m", "height_m"), ("omega_deg", "phi_deg", "kappa_deg")


def camera_table(camera):
    opk = np.degrees(opk_from_rotation(camera.T_b_c.R[None])[0])
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "pixel_um": 1000 * camera.pixel_mm,
        "focal_mm": 49.7,
        **dict(zip(("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg"), opk, strict=True)),
    }


def parts(block, *, sigma=()):
    """Return settings, tables and surveyed points of a flight on no map.

    Its trajectory states some of its sigma.
    """
    names, points = np.array(block.images.names), np.array(block.points)
    T, known = block.trajectory.T_m_b, block.trajectory
    trajectory = {
        "exposure": list(known.exposures),
        **dict(zip(XYZ, T.r.T, strict=True)),
        **dict(zip(OPK, np.degrees(T.opk).T, strict=True)),
    }
    if "positions" in sigma:
        columns = ("sigma_east_m", "sigma_north_m", "sigma_height_m")
        trajectory |= dict(zip(columns, known.sigma_position.T, strict=True))
    if "attitudes" in sigma:
        columns = ("sigma_roll_deg", "sigma_pitch_deg", "sigma_heading_deg")
        trajectory |= dict(zip(columns, np.degrees(known.sigma_attitude).T, strict=True))
    tables = {
        "images": {
            "image": names,
            "camera": ["CAM"] * len(names),
            "exposure": np.array(known.exposures)[block.images.exposure_idx],
        },
        "image_points": {
            "image": names[block.image_points.image_idx],
            "point": points[block.image_points.point_idx],
            "col_px": block.image_points.colrow[:, 0],
            "row_px": block.image_points.colrow[:, 1],
            "sigma_px": block.image_points.sigma_px,
        },
        "trajectory": trajectory,
    }
    surveyed = {"point": points[block.control.point_idx]}
    surveyed |= dict(zip(XYZ, block.control.x_m.T, strict=True))
    settings = {**SETTINGS, "cameras": {"CAM": camera_table(block.cameras[0])}}
    return settings, tables, surveyed


def flown(block, *, sigma=(), control=False):
    """Return a block as a flight on no map."""
    settings, tables, surveyed = parts(block, sigma=sigma)
    return from_tables(settings, control_points=surveyed if control else None, calibration=tables)


@pytest.fixture(scope="module")
def block():
    return blocks.noisy(blocks.standard(check=None), np.random.default_rng(3))


def test_a_trajectory_with_sigma_calibrates_as_it_does_in_arrays(block):
    """The coordinates are the mapping frame's own: nothing is turned, shifted or scaled."""
    flight = flown(block, sigma=("positions", "attitudes"), control=True)
    fit = mounting.calibrate(flight)["single_step"]
    assert flight.fix == ()
    same = single_step(flight.calibration, Model(free=FREE))
    truth = blocks.CAMERA
    assert fit.calibration.cameras[0].interior.f == same.calibration.cameras[0].interior.f
    assert_allclose(fit.calibration.cameras[0].interior.f, truth.interior.f, atol=0.02)
    assert_allclose(fit.calibration.cameras[0].T_b_c.r, truth.T_b_c.r, atol=0.25)
    assert_allclose(fit.bundle.T_m_c.r[:, 2].mean(), block.trajectory.T_m_b.r[:, 2].mean(), atol=1)


def test_control_alone_calibrates(block):
    """Without sigma of the trajectory the mounting is held; three points fix place and scale."""
    flight = flown(block, control=True)
    assert set(flight.fix) == {"lever_arm", "boresight"}
    assert not any("leave open" in note for note in flight.notes)
    fit = mounting.calibrate(flight)["single_step"]
    found, truth = fit.calibration.cameras[0].interior, blocks.CAMERA.interior
    sigma = np.sqrt(np.diag(fit.calibration.cov)[:3])
    assert np.all(np.abs(found.to_array() - truth.to_array())[:3] < 4 * sigma)


def test_control_alone_has_a_report(block, acx4, tmp_path):
    settings, tables, surveyed = parts(block)
    camera = settings.pop("cameras")["CAM"]
    estimate = settings.pop("stages")["mounting"]
    lines = [f"{key} = {json.dumps(value)}" for key, value in settings.items()]
    for section, keys in (("cameras.CAM", camera), ("stages.mounting", estimate)):
        lines += [f"[{section}]", *(f"{key} = {json.dumps(value)}" for key, value in keys.items())]
    folder = tmp_path / "flight"
    (folder / "calibration").mkdir(parents=True)
    (folder / "flight.toml").write_text("\n".join(lines))
    pd.DataFrame(surveyed).to_csv(folder / "control_points.csv", index=False)
    for name, table in tables.items():
        pd.DataFrame(table).to_csv(folder / "calibration" / f"{name}.csv", index=False)
    results, report = tmp_path / "results", tmp_path / "report.html"
    status, _, said = acx4("run", folder, "--numbers-only", "--results", results)
    assert status == 1  # f from vertical pictures at one height is too uncertain
    assert "f_mm is not determined" in said
    page.write(results, report)
    assert "mounting/single_step" in report.with_suffix(".json").read_text("utf-8")


def test_without_control_and_sigma_check_and_run_say_what_to_add(block):
    flight = flown(block)
    said = summary(flight)
    assert "local, x, y, z of its own, on no map" in said
    lack = "0 control points and no position with sigma leave open where the block lies"
    assert lack in said
    with pytest.raises(AdjustmentError, match=f"{lack}.* add three control points"):
        mounting.calibrate(flight)


def test_positions_alone_hold_the_boresight(block):
    """The camera's own axes are the body's: no attitude tells them apart."""
    flight = flown(block, sigma=("positions",))
    assert set(flight.fix) == {"lever_arm", "boresight"}
    fit = mounting.calibrate(flight)["single_step"]
    assert fit.bundle.solution.group("gnss").redundancy.sum() > 0.5
    assert not any("leave open" in note for note in flight.notes)


def test_start_values_validate_nothing(block):
    flight = flown(block)
    checked = replace(flight, blocks={**flight.blocks, "validation": flight.calibration})
    assert order.missing(checked, "validation").endswith("no sigma of positions and attitudes")


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('heights = "ellipsoidal"', "heights = 3.0", ":3: heights: 3.0; must be 'ellipsoidal'"),
        (
            'heights = "ellipsoidal"',
            'heights = "ellipsoidal"\nrefraction = "standard"',
            ":4: refraction: 'standard'; must be 'none' or left out, since crs is 'local'",
        ),
    ],
)
def test_a_frame_on_no_map_has_neither_geoid_nor_air(tmp_path, old, new, line):
    write_flight(tmp_path)
    path = tmp_path / "flight.toml"
    text = path.read_text().replace('"EPSG:31982"', '"local"').replace(old, new)
    path.write_text(text)
    with pytest.raises(FlightError) as found:
        read(tmp_path)
    assert any(line in one for one in found.value.problems)


def test_longitudes_and_latitudes_need_a_map(tmp_path):
    write_flight(tmp_path, form="geographic")
    path = tmp_path / "flight.toml"
    path.write_text(path.read_text().replace('"EPSG:31982"', '"local"'))
    with pytest.raises(FlightError, match="must be east_m, north_m, … kappa_deg, since crs"):
        read(tmp_path)
