"""Chunks of Metashape become flights; the scene and the program's own points prove it."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4files.exchange.programs import metashape as reading
from acx4files.flight.settings import camera_of
from acx4lib.errors import FlightError
from acx4lib.geometry.frames import log
from acx4lib.geometry.geodesy import GridSystem, LocalFrame, mean_origin
from support.helpers import needs
from support.projects import metashape, scene

SAMPLE = "formats/metashape/markers_micasenses_rededge.xml"


LOCAL = 'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]'


def rms(sentences, begin):
    """Return the rms that a proof says, px."""
    said = next(one for one in sentences if one.startswith(begin))
    return float(re.search(r"to ([\d.e-]+) px rms", said)[1])


def poses(table, frame):
    """Return body poses of a trajectory of either form."""
    column = {name: np.array(values) for name, values in table.items() if name != "exposure"}
    height = column["height_m"]
    if "lat_deg" in table:
        lonlath = np.stack([column["lon_deg"], column["lat_deg"], height], axis=1)
        rph = [column[f"{name}_deg"] for name in ("roll", "pitch", "heading")]
        return frame.pose_from_geographic(lonlath, np.radians(rph).T)
    enh = np.stack([column["east_m"], column["north_m"], height], axis=1)
    opk = [column[f"{name}_deg"] for name in ("omega", "phi", "kappa")]
    return frame.pose_from_grid(enh, np.radians(opk).T)


def test_a_chunk_becomes_a_flight(tmp_path):
    brought = reading.read(metashape.write(tmp_path / "c.xml"))
    assert brought.settings["crs"] == scene.CRS
    assert brought.settings["apriori"] == {"image_point_px": 0.25}
    assert set(brought.tables) == {
        "heads/images.csv",
        "heads/image_points.csv",
        "heads/trajectory.csv",
        "control_points.csv",
    }
    images = brought.tables["heads/images.csv"]
    assert images["image"][:2] == ["one.jpg", "slave 0"]
    assert images["exposure"][:3] == ["one.jpg", "one.jpg", "two.jpg"]
    control = brought.tables["control_points.csv"]
    assert control["role"] == ["control"] * 8 + ["check"]
    assert_allclose(control["east_m"], scene.scene().points_enh[:, 0])
    assert_allclose(control["sigma_north_m"], 0.02)


def test_only_what_was_measured_is_brought(tmp_path):
    brought = reading.read(metashape.write(tmp_path / "c.xml"))
    points = brought.tables["heads/image_points.csv"]
    assert len(points["point"]) == 8 * 8  # one of nine markers has computed locations only
    assert "P4" not in points["point"]
    assert any(
        one.startswith('8 marker locations without pinned="true"') for one in brought.left_out
    )
    block = scene.scene()
    u, v = scene.seen(block.R_e_c[0], block.r_e[0], block.points_e)[0]
    assert_allclose([points["col_px"][0], points["row_px"][0]], [u - 0.5, v - 0.5], atol=1e-4)


def test_surveyed_points_are_where_the_imported_cameras_see_them(tmp_path):
    """Through the chunk, the slave's rotation and the refitted lens."""
    found = reading.read(metashape.write(tmp_path / "c.xml")).found
    assert rms(found, "the surveyed markers") < 0.02
    assert rms(found, "the measured locations") < 0.02


def test_measured_and_adjusted_trajectories_are_one(tmp_path):
    """The writer made the adjusted poses from the angles, by formulas of its own."""
    path = metashape.write(tmp_path / "c.xml")
    frame = mean_origin(GridSystem(crs=scene.CRS), scene.scene().lonlath[:, :2])
    initial, adjusted = (
        poses(reading.read(path, orientations=which).tables["heads/trajectory.csv"], frame)
        for which in ("initial", "adjusted")
    )
    assert_allclose(adjusted.r, initial.r, atol=1e-4)
    assert np.abs(log(np.swapaxes(adjusted.R, -1, -2) @ initial.R)).max() < 1e-8


def test_what_is_written_has_the_truth_to_rounding(tmp_path):
    """Bodies of the trajectory and the mounting of the settings make the truth's cameras."""
    brought = reading.read(metashape.write(tmp_path / "c.xml"))
    block = scene.scene()
    frame = mean_origin(GridSystem(crs=scene.CRS), block.lonlath[:, :2])
    T_m_b = poses(brought.tables["heads/trajectory.csv"], frame)
    tables = brought.settings["cameras"]
    R_b_c = [camera_of(name, tables[name]).T_b_c.R for name in ("head 0", "head 1")]
    flip = np.diag([1.0, -1.0, -1.0])
    R_e_m = (block.R_e_c[0] @ flip) @ (T_m_b.R[0] @ R_b_c[0]).T
    for truth, body in zip(block.R_e_c, T_m_b.R, strict=True):
        assert_allclose(R_e_m @ body @ R_b_c[0], truth @ flip, atol=1e-7)
        assert_allclose(R_e_m @ body @ R_b_c[1], truth @ scene.SLAVE @ flip, atol=1e-7)


def test_a_geographic_chunk_is_brought_into_its_zone(tmp_path):
    wgs = (
        'GEOGCS["WGS 84",DATUM["World Geodetic System 1984",SPHEROID["WGS 84",6378137,'
        '298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433],'
        'AUTHORITY["EPSG","4326"]]'
    )
    text = metashape.chunk(wkt=wgs).replace("<markers><marker id", "<nothing><marker id", 1)
    path = tmp_path / "c.xml"
    path.write_text(f"<document>{text.replace('</markers>', '</nothing>', 1)}</document>")
    path.write_text(re.sub(r"<frames>.*</frames>", "", path.read_text(), flags=re.DOTALL))
    brought = reading.read(path)
    assert brought.settings["crs"] == "EPSG:32722"
    assert "control_points.csv" not in brought.tables
    assert_allclose(
        brought.tables["heads/trajectory.csv"]["lat_deg"], scene.scene().lonlath[:, 1], atol=1e-9
    )


@needs("formats/metashape")
def test_a_rig_of_five_heads_meets_what_metashape_computed():
    """Locations that Metashape computed itself prove sign, order and the slaves' rotation."""
    brought = reading.read(data.path(SAMPLE), orientations="adjusted")
    assert brought.source == "Metashape 1.7.2.12070"
    assert rms(brought.found, "the locations that Metashape computed") < 0.05
    assert rms(brought.found, "the measured locations") < 0.2
    assert len(brought.tables["heads/image_points.csv"]["point"]) == 41
    assert len(brought.tables["heads/trajectory.csv"]["exposure"]) == 173
    assert '166 marker locations without pinned="true"' in brought.left_out[0]
    assert brought.settings["crs"] == "EPSG:25830"


@needs("formats/metashape")
def test_without_the_program_s_own_orientations_no_trajectory_is_made_up():
    brought = reading.read(data.path(SAMPLE))
    assert "heads/trajectory.csv" not in brought.tables
    off = "173 measured positions, with their angles, that are switched off"
    assert any(one.startswith(off) for one in brought.left_out)


def test_a_project_in_archives_is_the_exported_file(tmp_path):
    exported = reading.read(metashape.write(tmp_path / "c.xml"))
    packed = reading.read(metashape.write_project(tmp_path))
    assert packed.tables == exported.tables
    assert packed.settings == exported.settings
    assert next(iter(packed.sha256)) == "p.psx"


def test_two_chunks_in_one_document(tmp_path):
    path = tmp_path / "c.xml"
    both = metashape.chunk() + metashape.chunk().replace("Chunk 1", "Chunk 2")
    path.write_text(f"<document>{both}</document>")
    assert any("other chunks: Chunk 2" in one for one in reading.read(path).left_out)


@pytest.mark.parametrize("path", ["../../secret.zip", "/etc/passwd", "c:/x.zip"])
def test_no_file_outside_the_project_is_opened(tmp_path, path):
    project = tmp_path / "p.psx"
    project.write_text(f'<document version="1.2.0" path="{path}"/>')
    with pytest.raises(FlightError, match="must lie below the project's folder"):
        reading.read(project)


def test_local_coordinates_are_those_of_a_flight_on_no_map(tmp_path):
    """Measured angles count from y; the chunk's own orientations have no sigma."""
    path = metashape.write(tmp_path / "c.xml", wkt=LOCAL)
    brought = reading.read(path)
    assert (brought.settings["crs"], brought.settings["heights"]) == ("local", "ellipsoidal")
    measured = brought.tables["heads/trajectory.csv"]
    T = LocalFrame().pose_from_grid(
        np.stack([measured[name] for name in ("east_m", "north_m", "height_m")], axis=1),
        np.radians(np.stack([measured[name] for name in ("omega_deg", "phi_deg", "kappa_deg")], 1)),
    )
    yaw, pitch, _ = np.radians(scene.YPR[0])
    ahead = [np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)]
    assert_allclose(T.R[0][:, 0], ahead, atol=1e-9)
    assert_allclose(T.r[:, :2], scene.scene().lonlath[:, :2], atol=1e-5)
    adjusted = reading.read(path, orientations="adjusted").tables["heads/trajectory.csv"]
    assert not any(name.startswith("sigma") for name in adjusted)
    assert_allclose(adjusted["east_m"], scene.scene().r_e[:, 0], atol=1e-4)


def test_local_coordinates_may_be_those_of_a_crs(tmp_path):
    """With --crs local coordinates are the map's; what Metashape calls north is that of the map."""
    path = metashape.write(tmp_path / "c.xml", wkt=LOCAL)
    grid = GridSystem(crs=scene.CRS, heights="ellipsoidal")

    def on_map(found):
        lonlat = np.array([[float(found[1]), float(found[2])]])
        east, north = grid.grid_from_lonlat(lonlat)[0]
        return f'<reference x="{east:.6f}" y="{north:.6f}"'

    path.write_text(re.sub(r'<reference x="(-49.*?)" y="(-25.*?)"', on_map, path.read_text()))
    known = reading.read(metashape.write(tmp_path / "known.xml"))
    brought = reading.read(path, crs=scene.CRS)
    assert any("are local: they are taken for those of" in one for one in brought.assumed)
    assert brought.tables["control_points.csv"] == known.tables["control_points.csv"]
    ours, theirs = (one.tables["heads/trajectory.csv"] for one in (brought, known))
    assert_allclose(ours["lat_deg"], theirs["lat_deg"], atol=1e-9)
    lonlat = np.column_stack([theirs["lon_deg"], theirs["lat_deg"]])
    gamma = np.degrees(grid.convergence(lonlat))
    turned = np.subtract(ours["heading_deg"], theirs["heading_deg"])
    assert_allclose(turned, gamma, atol=1e-8)


def with_references(path, old, new):
    """Change the attributes of the cameras' references."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("given", "sigma"),
    [
        ('sxy="0.02" sz="0.03"', (0.02, 0.02, 0.03)),
        ('sx="0.01" sy="0.02" sz="0.03"', (0.01, 0.02, 0.03)),
        ('sxyz="0.05" sz="0.09"', (0.05, 0.05, 0.09)),
        ('sxy="0.02"', (0.02, 0.02, 10.0)),
    ],
)
def test_each_camera_s_own_accuracy_counts_in_every_spelling(tmp_path, given, sigma):
    path = metashape.write(tmp_path / "c.xml")
    setting = '<settings><property name="accuracy_cameras" value="10"/>'
    with_references(path, "<settings>", setting)
    with_references(path, 'sxyz="0.05"', given)
    table = reading.read(path).tables["heads/trajectory.csv"]
    found = [table[f"sigma_{name}"] for name in ("east_m", "north_m", "height_m")]
    assert_allclose(found, np.tile(sigma, (len(table["exposure"]), 1)).T)


def test_angles_that_are_switched_off_are_not_used(tmp_path):
    path = metashape.write(tmp_path / "c.xml")
    path.write_text(path.read_text().replace('sxyz="0.05"', 'rotation_enabled="false"', 1))
    path.write_text(path.read_text().replace('sxyz="0.05"', ""))
    known = len(reading.read(metashape.write(tmp_path / "all.xml")).tables["heads/trajectory.csv"])
    brought = reading.read(path)
    table = brought.tables["heads/trajectory.csv"]
    assert "one.jpg" not in table["exposure"]
    assert len(table["exposure"]) == 3
    assert len(table) == known - 3
    said = 'measured attitudes that are switched off (rotation_enabled="false"): they are not used'
    assert f"1 {said}" in brought.left_out
