"""Real aerial photographs: tie points measured here, with the published marks of control.

Three of the five photographs of `dbat-sxb` are measured from an orientation that is off by metres
and tenths of a degree. Their adjusted orientation must be the one that five photographs had, with
tie points by another program.
"""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from acx4book.reference import data, dbat_files, dbat_statements
from acx4files.exchange import flight_folder
from acx4files.measuring.measure import measure_flight
from acx4lib.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.bundle import adjust
from acx4lib.bundle.gross_errors import adjust_rejecting
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.model import Model
from support.helpers import needs

PHOTOGRAPHS = (1, 2, 3)
"""Of the five, those whose files are here: 8936, 8937, 8938."""

CRS = "+proj=tmerc +lat_0=48.58 +lon_0=7.75 +x_0=1000000 +y_0=112400 +ellps=GRS80 +units=m"
"""Any projection near the place: the reference uses its coordinates as if they were Cartesian."""

SETTINGS = {
    "name": "Strasbourg",
    "crs": CRS,
    "heights": "ellipsoidal",
    "apriori": {
        "image_point_px": 0.5,
        "gnss_horizontal_m": 3.0,
        "gnss_vertical_m": 3.0,
        "roll_pitch_deg": 0.3,
        "heading_deg": 0.3,
    },
}
POSITION, ANGLES = ["east_m", "north_m", "height_m"], ["omega_deg", "phi_deg", "kappa_deg"]


def names_of(project):
    stems = [name.removesuffix(".jpg") for name in project.bundle.network.block.images.names]
    return [stems[i] for i in PHOTOGRAPHS]


def flight(folder, project, rng):
    """Write the three photographs with their marks, the control, and a rough trajectory."""
    block, names = project.bundle.network.block, names_of(project)
    (folder / "calibration" / "images").mkdir(parents=True)
    for name in names:
        shutil.copy(data.path(f"sxb-photos/{name}.jpg"), folder / "calibration" / "images")
    lens = block.cameras[0]
    camera = {"width_px": lens.width_px, "height_px": lens.height_px, "pixel_um": 6.0}
    camera |= {f"{key}_mm": getattr(lens.interior, key) for key in ("xp", "yp")}
    camera["focal_mm"] = lens.interior.f
    text = flight_folder.written({**SETTINGS, "cameras": {"RMK": camera}})
    (folder / "flight.toml").write_text(text)
    rough = dbat_statements.exterior(project)[0][list(PHOTOGRAPHS)]
    rough = rough + rng.normal(size=(3, 6)) * ([2.0] * 3 + [0.2] * 3)
    trajectory = pd.DataFrame(rough.round(2), columns=POSITION + ANGLES)
    trajectory.insert(0, "exposure", names)
    images = {"image": names, "camera": "RMK", "exposure": names, "strip": "1"}
    images = pd.DataFrame(images).assign(file=[f"images/{name}.jpg" for name in names])
    given = project
    control = pd.DataFrame(given.x, columns=POSITION).assign(
        point=given.point,
        role=np.where(project.is_check, "check", "control"),
        **dict(zip([f"sigma_{axis}" for axis in POSITION], given.sigma.T, strict=True)),
    )
    control.to_csv(folder / "control_points.csv", index=False)
    marks(project).to_csv(folder / "calibration" / "image_points.csv", index=False)
    images.to_csv(folder / "calibration" / "images.csv", index=False)
    trajectory.to_csv(folder / "calibration" / "trajectory.csv", index=False)


def marks(project):
    """Return the published measurements of surveyed points in the three photographs."""
    block, names = project.bundle.network.block, names_of(project)
    points = block.image_points
    known = np.isin(points.point_idx, np.r_[block.control.point_idx, block.check.point_idx])
    keep = known & np.isin(points.image_idx, PHOTOGRAPHS)
    return pd.DataFrame(
        {
            "image": [names[PHOTOGRAPHS.index(i)] for i in points.image_idx[keep]],
            "point": [block.points[i] for i in points.point_idx[keep]],
            "col_px": points.colrow[keep, 0],
            "row_px": points.colrow[keep, 1],
            "sigma_px": points.sigma_px[keep],
        }
    )


def network(project, rows):
    """Return the block of some measurements, in the Cartesian coordinates of the reference."""
    names = names_of(project)
    points = tuple(dict.fromkeys(rows["point"]))
    place = {name: i for i, name in enumerate(points)}
    given = project
    seen = np.array(
        [
            str(point) in place and not c
            for point, c in zip(given.point, project.is_check, strict=True)
        ]
    )
    rough = dbat_statements.exterior(project)[0][list(PHOTOGRAPHS)]
    T_m_c = Pose(R=rotation_from_opk(np.radians(rough[:, 3:])), r=rough[:, :3] - project.origin)
    return Block(
        cameras=project.bundle.network.block.cameras,
        images=Images(names=tuple(names)),
        points=points,
        image_points=ImagePoints(
            image_idx=np.array([names.index(name) for name in rows["image"]]),
            point_idx=np.array([place[name] for name in rows["point"]]),
            colrow=rows[["col_px", "row_px"]].to_numpy(),
            sigma_px=rows["sigma_px"].to_numpy(),
        ),
        control=SurveyedPoints(
            point_idx=np.array([place[str(point)] for point in given.point[seen]]),
            x_m=given.x[seen] - project.origin,
            sigma_m=given.sigma[seen],
        ),
        trajectory=Trajectory(exposures=tuple(names), T_m_b=T_m_c),
        smallest_angle=0.0,
    )


@pytest.mark.repeats
@needs("sxb-photos")
@needs("dbat-sxb")
def test_tie_points_of_real_photographs_give_the_published_orientation(tmp_path, rng):
    project = dbat_files.sxb()
    flight(tmp_path / "flight", project, rng)
    measure_flight(tmp_path / "flight", tmp_path / "measured")
    table = tmp_path / "measured" / "calibration" / "image_points.csv"
    rows = pd.read_csv(table, dtype={"image": str, "point": str})
    published = marks(project)[["image", "point"]].to_numpy().tolist()
    tie = ~rows["point"].isin([str(point) for point in project.point])
    assert tie.sum() > 200
    given = np.array([pair in published for pair in rows[["image", "point"]].to_numpy().tolist()])
    block = network(project, rows[tie | given])
    found = adjust_rejecting(block, lambda block: adjust.free_orientation(block, Model()))
    assert len(found.rejected) < 0.05 * len(block.image_points)
    values, cov = dbat_statements.exterior(replace(project, bundle=found))
    wanted, cov_wanted = (part[list(PHOTOGRAPHS)] for part in dbat_statements.exterior(project))
    sigma = np.sqrt(np.diagonal(cov + cov_wanted, axis1=1, axis2=2))
    assert np.abs((values - wanted) / sigma).max() < 3
