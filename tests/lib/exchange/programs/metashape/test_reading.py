"""Chunks of Metashape become flights; the scene and the program's own points prove it."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4lib.errors import FlightError
from acx4lib.exchange.programs.metashape import reading
from acx4lib.flight.setup import camera_of
from acx4lib.geometry.frames import log
from acx4lib.geometry.geodesy import GridSystem, mean_origin
from support.projects import metashape, scene
from support.reference_files import needs

SAMPLE = "formats/metashape/markers_micasenses_rededge.xml"


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


def test_the_calibration_is_chosen_and_said(tmp_path):
    path = metashape.write(tmp_path / "c.xml", slaves=False)
    adjusted, initial = (reading.read(path, camera=which) for which in ("adjusted", "initial"))
    focal = [one.settings["cameras"]["head 0"]["focal_mm"] for one in (adjusted, initial)]
    assert_allclose(focal, [1450 * scene.PIXEL_MM, 1440 * scene.PIXEL_MM])
    assert "calibration of head 0: initial" in initial.found
    assert "calibration/images.csv" in adjusted.tables


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


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "<f>1450.0</f>",
            "<fx>1450.0</fx>",
            r"c\.xml:\d+: calibration: has <fx>: PhotoScan before",
        ),
        ("<f>1450.0</f>", "<f>-3</f>", r"c\.xml:\d+: f: '-3'; must be positive"),
        ("<f>1450.0</f>", "<f>nan</f>", r"f: 'nan'; must be a finite number"),
        ('type="frame" class="adjusted"', 'type="rpc" class="adjusted"', "calibration type: 'rpc'"),
        ('sensor_id="1"', 'sensor_id="7"', "camera sensor_id: '7'; must be a sensor's id"),
        ('master_id="2"', 'master_id="77"', "camera master_id: '77'; must be a camera's id"),
        ('label="P3"', 'label="P2"', "marker label: 'P2' is there twice"),
        ('label="P3"', 'label="=P3"', "marker label: '=P3' would be computed as a formula"),
        ("<rotation>", "<rotation>9 ", "rotation: .* must be 9 numbers"),
        ("<scale>4.7</scale>", "<scale>0</scale>", "scale: 0; must be positive"),
        ("PROJCS[", "PROJXX[", "reference: coordinate system is none that PROJ knows"),
        ('class="adjusted"', 'class="adjusted" ', ""),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path, old, new, message):
    path = metashape.write(tmp_path / "c.xml")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1 if "class" not in old else -1))
    if not message:
        assert reading.read(path, orientations="adjusted").found
        return
    with pytest.raises(FlightError, match=message):
        reading.read(path, orientations="adjusted")


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
