"""What is exported is read back by the importers: lenses, rigs, orientations, to rounding."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.flight.settings import camera_of
from acx4lib.geometry.camera import correct, xy_from_colrow
from acx4lib.geometry.frames import turn
from acx4tools.exchange.outward.kinds import KINDS
from acx4tools.exchange.programs import colmap, metashape, micmac, opensfm, opf
from acx4tools.exchange.trajectories import orientations
from acx4tools.exchange.trajectories.orientations import Meaning

CRS = "EPSG:31982"


def from_opk(folder):
    meaning = Meaning(crs=CRS)
    options = orientations.TableOptions(of="camera")
    return orientations.read(folder / "orientations.csv", meaning, options)


READERS = {
    "metashape": lambda folder: metashape.read(
        folder / "chunk" / "cameras.xml", orientations="adjusted"
    ),
    "colmap": lambda folder: colmap.read(folder, pixel_um=5.0),
    "opensfm": lambda folder: opensfm.read(folder, orientations="adjusted", crs=CRS, pixel_um=5.0),
    "opf": lambda folder: opf.read(folder / "project.opf", orientations="adjusted"),
    "micmac": lambda folder: micmac.read(folder, pixel_um=5.0),
    "opk": from_opk,
    "rph": from_opk,
}

LENSES = ("metashape", "colmap", "opensfm", "opf", "micmac")
ORIENTED = ("metashape", "opensfm", "opf", "opk")
RIGS = ("colmap", "opf")


@pytest.fixture(scope="module")
def brought(shown, tmp_path_factory):
    """What the readers bring of every export, and the exports."""
    found = {}
    for kind, read in READERS.items():
        at = tmp_path_factory.mktemp(kind)
        made = KINDS[kind].oriented(shown.found, shown.oriented)
        for name, text in made.files.items():
            (at / name).parent.mkdir(parents=True, exist_ok=True)
            (at / name).write_text(text)
        found[kind] = read(at), made
    return found


def cameras(brought):
    tables = brought.settings["cameras"]
    return {name: camera_of(name, table) for name, table in tables.items()}


@pytest.mark.parametrize("kind", LENSES)
def test_lenses_come_back(shown, brought, kind):
    """Twice refitted, so that at most twice is lost what is said."""
    read, made = brought[kind]
    for own, back in zip(shown.found.cameras, cameras(read).values(), strict=True):
        nodes = shown.colrow[shown.first_images()[own.name]]
        rays = [correct(c.interior, xy_from_colrow(c, nodes)) / c.interior.f for c in (own, back)]
        apart = np.linalg.norm(rays[0] - rays[1], axis=1).max() * own.interior.f / own.pixel_mm
        assert apart <= 2.1 * made.lenses[own.name].largest_px + 1e-4


@pytest.mark.parametrize("kind", RIGS)
def test_rotations_of_the_heads_come_back(shown, brought, kind):
    read, _ = brought[kind]
    first, second = (camera.T_b_c.R for camera in cameras(read).values())
    own = [camera.T_b_c.R for camera in shown.found.cameras]
    assert_allclose(first.T @ second, own[0].T @ own[1], atol=2e-9)


def test_roll_pitch_and_heading_are_a_trajectory_of_turned_cameras(shown, brought):
    """As export.md says: mount_kappa_deg = -90, the lever arm zero."""
    read, _ = brought["rph"]
    rows = read.tables["calibration/trajectory.csv"]
    lonlath = np.stack([rows[k] for k in ("lon_deg", "lat_deg", "height_m")], axis=1)
    rph = np.stack([rows[k] for k in ("roll_deg", "pitch_deg", "heading_deg")], axis=1)
    T = shown.oriented.block.frame.pose_from_geographic(
        lonlath.astype(float), np.radians(rph.astype(float))
    )
    assert_allclose(T.R @ turn(2, -np.pi / 2), shown.oriented.T_m_c.R, atol=1e-9)
    assert_allclose(T.r, shown.oriented.T_m_c.r, atol=2e-4)


@pytest.mark.parametrize("kind", ORIENTED)
def test_orientations_come_back(shown, brought, kind):
    """Body times mounting of what was imported is the camera's pose.

    In a grid the base of a rig is not scaled like the map, and its verticals are not parallel:
    0.0002 of 0.6 m, and 0.6 m of the earth's radius.
    """
    metres, radians = (2e-4, 1e-7) if kind == "opf" else (2e-5, 1e-9)
    read, _ = brought[kind]
    folder = next(n.rpartition("/")[0] for n in read.tables if n.endswith("trajectory.csv"))
    rows = read.tables[f"{folder}/trajectory.csv"]
    T_m_b = shown.oriented.block.frame.pose_from_grid(
        np.stack([rows[k] for k in ("east_m", "north_m", "height_m")], axis=1).astype(float),
        np.radians(
            np.stack([rows[k] for k in ("omega_deg", "phi_deg", "kappa_deg")], axis=1).astype(float)
        ),
    )
    where = {name: i for i, name in enumerate(rows["exposure"])}
    images = read.tables.get(f"{folder}/images.csv")
    for k, name in enumerate(shown.oriented.names):
        exposure, T_b_c = name, None
        if images is not None:
            row = list(images["image"]).index(name)
            exposure = images["exposure"][row]
            T_b_c = cameras(read)[images["camera"][row]].T_b_c
        T = T_m_b[where[exposure]]
        T = T if T_b_c is None else T @ T_b_c
        assert_allclose(T.r, shown.oriented.T_m_c.r[k], atol=metres)
        assert_allclose(T.R, shown.oriented.T_m_c.R[k], atol=radians)
