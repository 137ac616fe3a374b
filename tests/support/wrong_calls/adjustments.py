"""Measurements and the parts of blocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4files import conventions
from acx4files.results.rows import exterior_orientations
from acx4lib import block
from acx4lib.bundle import (
    adjust,
    gross_errors,
    observations,
    rejections,
    unknowns,
    variance_components,
)
from acx4lib.bundle.free_network import adjust_free, datum_defect
from acx4lib.calibration import estimates, heads, mounting, rig
from acx4lib.errors import AdjustmentError
from acx4lib.geometry import camera
from acx4lib.geometry.frames import Pose
from acx4lib.georeferencing import direct
from acx4lib.least_squares import adjustment
from acx4lib.tie_points import refinement
from acx4lib.tie_points import ties as tie_points
from support.pictures import taken
from support.wrong_calls.material import (
    BLOCK,
    CAMERA,
    CONTROL,
    FREE,
    IMAGES,
    POINTS,
    POSES,
    RIG,
    SYNTHETIC,
    TRAJECTORY,
    Wrong,
    a_block,
    calibrated,
    count,
    finite,
    fit,
    flown,
    georeferenced,
    names,
    not_negative,
    positive,
    said,
    shape,
    spoilt,
    ties,
)


def image_points(**wrong):
    return lambda: replace(POINTS, **wrong)


def with_points(**wrong):
    return lambda: replace(BLOCK, image_points=replace(POINTS, **wrong))


def images(**wrong):
    return lambda: replace(BLOCK, images=replace(IMAGES, **wrong))


def control(**wrong):
    return lambda: replace(BLOCK, control=replace(CONTROL, **wrong))


def trajectory(**wrong):
    return lambda: replace(BLOCK, trajectory=replace(TRAJECTORY, **wrong))


def adjusting(make):
    return lambda: mounting.single_step(make(), free=FREE)


def rays(**wrong):
    right = {
        "image_idx": np.array([0, 1, 2, 3]),
        "group": np.array([0, 0, 1, 1]),
        "colrow": np.zeros((4, 2)),
        "sigma_px": np.ones(4),
    }
    return direct.Rays(**{**right, **wrong})


def measured() -> list[Wrong]:
    n, m = len(IMAGES), len(BLOCK.points)
    return [
        Wrong(
            image_points(sigma_px=0.5),
            rf"sigma_px: expected an array of shape \({len(POINTS)},\), got 0.5",
        ),
        Wrong(
            image_points(sigma_px=np.array([0.5])),
            rf"sigma_px: expected shape \({len(POINTS)},\), got \(1,\)",
        ),
        Wrong(
            image_points(sigma_px=spoilt(POINTS.sigma_px, 0.0)),
            "sigma_px: expected positive numbers, got 0.0 in row 3",
        ),
        Wrong(
            image_points(sigma_px=-POINTS.sigma_px),
            "sigma_px: expected positive numbers, got -0.5 in row 0",
        ),
        Wrong(
            image_points(sigma_px=spoilt(POINTS.sigma_px, np.nan)),
            "sigma_px: expected positive numbers, got nan in row 3",
        ),
        Wrong(image_points(sigma_px=np.ones((len(POINTS), 2))), r"sigma_px: expected shape"),
        Wrong(image_points(colrow=spoilt(POINTS.colrow, np.nan)), finite("colrow", "nan in row 3")),
        Wrong(image_points(colrow=spoilt(POINTS.colrow, np.inf)), finite("colrow", "inf in row 3")),
        Wrong(
            image_points(colrow=POINTS.colrow.T),
            r"colrow: expected shape \(\d+, 2\), got \(2, \d+\)",
        ),
        Wrong(
            image_points(colrow=np.zeros((len(POINTS), 3))),
            r"colrow: expected shape \(\d+, 2\), got \(\d+, 3\)",
        ),
        Wrong(
            image_points(colrow=POINTS.colrow.tolist()),
            r"colrow: expected an array of shape \(\d+, 2\), got a list",
        ),
        Wrong(
            image_points(colrow=POINTS.colrow.astype(str)),
            "colrow: expected numbers, got an array of <U",
        ),
        Wrong(
            image_points(image_idx=POINTS.image_idx.astype(float)),
            "image_idx: expected whole numbers, got an array of float64",
        ),
        Wrong(
            image_points(point_idx=POINTS.point_idx > 3),
            "point_idx: expected whole numbers, got an array of bool",
        ),
        Wrong(
            image_points(point_idx=np.array(BLOCK.points)[POINTS.point_idx]),
            "point_idx: expected whole numbers, got an array of <U",
        ),
        Wrong(image_points(image_idx=POINTS.image_idx[:-1]), "point_idx: expected shape"),
        Wrong(
            with_points(image_idx=POINTS.image_idx + 1),
            rf"image_points.image_idx: expected whole numbers from 0 to {n - 1}, got {n} in row",
        ),
        Wrong(
            with_points(point_idx=POINTS.point_idx + 1),
            rf"image_points.point_idx: expected whole numbers from 0 to {m - 1}, got {m} in row",
        ),
        Wrong(
            with_points(point_idx=spoilt(POINTS.point_idx, -1)),
            "image_points.point_idx: expected whole numbers from 0 to .*, got -1 in row 3",
        ),
        Wrong(
            adjusting(control(x_m=spoilt(CONTROL.x_m, np.nan))),
            finite("control.x_m", "nan in row 3"),
        ),
        Wrong(control(x_m=CONTROL.x_m.T), shape("x_m", "(9, 3)", "(3, 9)")),
        Wrong(control(sigma_m=0.01), r"sigma_m: expected an array of shape \(9, 3\), got 0.01"),
        Wrong(control(sigma_m=np.full(9, 0.01)), shape("sigma_m", "(9, 3)", "(9,)")),
        Wrong(
            control(sigma_m=-CONTROL.sigma_m),
            "sigma_m: expected zero or positive numbers, got -0.01 in row 0",
        ),
        Wrong(
            control(point_idx=CONTROL.point_idx + m),
            "control.point_idx: expected whole numbers from 0 to",
        ),
        Wrong(
            control(point_idx=spoilt(CONTROL.point_idx, 2)),
            "control.point_idx: expected different points, got 2 twice",
        ),
        Wrong(
            lambda: replace(BLOCK, check=BLOCK.control),
            "control and check: expected different points, got point 'P0' in both",
        ),
        Wrong(control(R_g_m=np.eye(3)), shape("R_g_m", "(9, 3, 3)", "(3, 3)")),
        Wrong(lambda: rays(group=np.array([0, 1, 0, 1])), "group: expected ascending numbers"),
        Wrong(
            lambda: rays(sigma_px=np.zeros(4)),
            "sigma_px: expected positive numbers, got 0.0 in row 0",
        ),
        Wrong(
            lambda: direct.intersect_rays(
                BLOCK, georeferenced(), rays(image_idx=np.array([0, 1, 2, 99]))
            ),
            r"selected.image_idx: expected whole numbers from 0 to 11, got 99 in row 3",
        ),
        Wrong(
            lambda: direct.intersect_rays(BLOCK, georeferenced(), rays(), weights=np.ones(4)),
            shape("weights", "(4, 2, 2)", "(4,)"),
        ),
        Wrong(
            lambda: direct.intersect_rays(BLOCK, georeferenced(), rays(), refraction="air"),
            "refraction",
        ),
        Wrong(lambda: replace(ties(), head_b=ties().head_a), "head_b"),
        Wrong(
            lambda: replace(ties(), sigma_px=np.zeros(len(ties()))),
            "sigma_px: expected positive numbers",
        ),
        Wrong(lambda: replace(ties(), colrow_a=ties().colrow_a.T), "colrow_a: expected shape"),
        Wrong(
            lambda: tie_points.overlaps(ties(), taken.printed_heads(("CAM1", "CAM2"))),
            "ties.head_a: expected whole numbers from 0 to 1, got 2 in row 63",
        ),
        Wrong(
            lambda: refinement.refine_by_rotations(taken.printed_heads(("CAM1", "CAM2")), ties()),
            "ties.head_a: expected whole numbers from 0 to 1, got 2 in row 63",
        ),
        Wrong(
            lambda: rejections.without(
                BLOCK,
                [rejections.Rejection(kind="image_point", row=10**6, component=-1, statistic=9.0)],
            ),
            r"rejected: image_point rows: expected whole numbers from 0 to \d+, got 1000000",
        ),
        Wrong(
            lambda: rejections.Rejection(kind="image", row=0, component=-1, statistic=9.0),
            "kind: expected one of image_point, control_point, gnss, attitude, distance, "
            "got 'image'",
        ),
    ]


def blocks_and_parts() -> list[Wrong]:
    n = len(IMAGES)
    return [
        Wrong(images(names=IMAGES.names[1:]), "strips: expected 11 names, got 12"),
        Wrong(images(names="I" * n), names("names", "the text 'IIII")),
        Wrong(images(strips=IMAGES.strips[1:]), "strips: expected 12 names, got 11"),
        Wrong(images(strips="A"), names("strips", "the text 'A'")),
        Wrong(
            images(camera_idx=IMAGES.camera_idx + 1),
            "images.camera_idx: expected whole numbers from 0 to 0, got 1 in row 0",
        ),
        Wrong(
            images(exposure_idx=IMAGES.exposure_idx + 1),
            "images.exposure_idx: expected whole numbers from 0 to 11, got 12 in row 11",
        ),
        Wrong(
            images(exposure_idx=IMAGES.exposure_idx / 2),
            "exposure_idx: expected whole numbers, got an array of float64",
        ),
        Wrong(
            trajectory(exposures=TRAJECTORY.exposures[1:]),
            shape("T_m_b.R", "(11, 3, 3)", "(12, 3, 3)"),
        ),
        Wrong(trajectory(exposures="012345678901"), names("exposures", "the text")),
        Wrong(
            trajectory(sigma_position=np.full(12, 0.02)),
            shape("sigma_position", "(12, 3)", "(12,)"),
        ),
        Wrong(
            trajectory(sigma_position=np.full((12, 3), -0.02)),
            "sigma_position: expected zero or positive numbers, got -0.02 in row 0",
        ),
        Wrong(
            lambda: mounting.single_step(trajectory(sigma_position=np.zeros((12, 3)))(), free=FREE),
            "sigma_position: expected positive numbers, got 0.0 in row 0",
        ),
        Wrong(
            trajectory(sigma_attitude=np.full((12, 3), np.nan)),
            "sigma_attitude: expected zero or positive numbers, got nan in row 0",
        ),
        Wrong(trajectory(time_s=np.arange(11.0)), shape("time_s", "(12,)", "(11,)")),
        Wrong(
            adjusting(trajectory(T_m_b=Pose(R=POSES.R, r=spoilt(POSES.r, np.nan)))),
            finite("T_m_b.r", "nan in row 3"),
        ),
        Wrong(
            trajectory(T_m_b=Pose(R=2 * POSES.R, r=POSES.r)),
            "T_m_b.R: expected rotation matrices, got one that does not turn, or mirrors, in row 0",
        ),
        Wrong(
            trajectory(R_g_m=-TRAJECTORY.R_g_m),
            "R_g_m: expected rotation matrices, got one that does not turn, or mirrors, in row 0",
        ),
        Wrong(
            lambda: replace(BLOCK, trajectory=POSES),
            "trajectory: expected a Trajectory, got a Pose",
        ),
        Wrong(
            lambda: replace(BLOCK, cameras=()), "cameras: expected one Camera at least, got none"
        ),
        Wrong(
            lambda: replace(BLOCK, cameras=CAMERA),
            "cameras: expected a sequence of Camera, got a Camera",
        ),
        Wrong(
            lambda: replace(BLOCK, cameras=("CAM",)),
            "cameras: expected a sequence of Camera, got one with 'CAM'",
        ),
        Wrong(
            lambda: replace(RIG, cameras=(CAMERA, CAMERA)),
            "cameras: expected different names, got 'CAM' twice",
        ),
        Wrong(lambda: replace(BLOCK, points="P0"), names("points", "the text 'P0'")),
        Wrong(
            lambda: replace(BLOCK, points=("P0", *BLOCK.points[:-1])),
            "points: expected different names, got 'P0' twice",
        ),
        Wrong(
            images(names=(IMAGES.names[1], *IMAGES.names[1:])),
            "images.names: expected different names, got '1_CAM' twice",
        ),
        Wrong(
            lambda: block.select_cameras(BLOCK, ["TAIL"]),
            "block 'calibration' has no camera 'TAIL', only CAM",
        ),
        Wrong(lambda: block.select_cameras(BLOCK, "CAM"), names("names", "the text 'CAM'")),
        Wrong(
            lambda: block.select_cameras(RIG, ["CAM", "CAM"]),
            "names: expected different names, got 'CAM' twice",
        ),
        Wrong(lambda: block.select_cameras(BLOCK, [0]), "has no camera 0, only CAM"),
        Wrong(
            lambda: block.select_images(BLOCK, np.array([0, 5])),
            "keep: expected a mask of 12 True or False, got an array of int64",
        ),
        Wrong(
            lambda: block.select_images(BLOCK, [0, 5]),
            "keep: expected a mask of 12 True or False, got a list",
        ),
        Wrong(
            lambda: block.select_images(BLOCK, np.ones(5, bool)),
            r"keep: expected a mask of 12 True or False, got 5",
        ),
        Wrong(
            lambda: block.select_images(BLOCK, np.ones(50, bool)),
            r"keep: expected a mask of 12 True or False, got 50",
        ),
        Wrong(lambda: block.select_images(None, np.ones(5, bool)), a_block("block", None)),
        Wrong(
            lambda: camera.mountings(CAMERA), "cameras: expected a sequence of Camera, got a Camera"
        ),
        Wrong(lambda: camera.mountings([]), "cameras: expected one Camera at least, got none"),
    ]


# --- adjustments and what they leave -----------------------------------------------------------


NO_HEADS = heads.Heads(bundles={}, failures={})


def adjusted() -> list[Wrong]:
    lonely = replace(BLOCK, image_points=POINTS[:0])
    metres = replace(BLOCK, cameras=(CAMERA.with_interior(camera.Interior(f=0.05)),))
    with_positions = observations.PoseObservations(
        T_m_b=POSES,
        R_g_m=TRAJECTORY.R_g_m,
        sigma_position=TRAJECTORY.sigma_position,
        sigma_attitude=np.full((12, 3), np.inf),
    )
    return [
        Wrong(lambda: mounting.calibrate(BLOCK, free="f"), names("free", "the text 'f'")),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=("focal",)),
            "free: expected names of f, xp, yp, k1, k2, k3, p1, p2, b1, b2, got 'focal'",
        ),
        Wrong(lambda: mounting.single_step(BLOCK, free=(CAMERA,)), "free: expected names of f, "),
        Wrong(lambda: mounting.single_step(BLOCK, free=None), names("free", None)),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=FREE, fix=["lever"]),
            "fix: expected names of lever_arm, boresight, got 'lever'",
        ),
        Wrong(
            lambda: mounting.single_step(BLOCK, free=FREE, fix="lever_arm"),
            names("fix", "the text 'lever_arm'"),
        ),
        Wrong(
            lambda: mounting.two_step(BLOCK, free=FREE, fix=["lever"]),
            "fix: expected names of lever_arm, boresight, got 'lever'",
        ),
        Wrong(
            lambda: mounting.two_step_gnss(BLOCK, free=FREE, fix=["lever"]),
            "fix: expected names of lever_arm, boresight, got 'lever'",
        ),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=FREE, gnss="shift"),
            names("gnss", "the text 'shift'"),
        ),
        Wrong(
            lambda: mounting.single_step(BLOCK, free=FREE, gnss=["offset"]),
            "gnss: expected names of shift, drift, delay, attitude_delay, deviation, got 'offset'",
        ),
        Wrong(
            lambda: mounting.single_step(BLOCK, free=FREE, refraction="ICAO"),
            "refraction: expected one of none, standard, got 'ICAO'",
        ),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=FREE, refraction=True),
            "refraction: expected one of none, standard, got True",
        ),
        Wrong(
            lambda: heads.calibrate_heads(RIG, ["CAM"], free=FREE, refraction="air"),
            "refraction: expected one of none, standard, got 'air'",
        ),
        Wrong(
            lambda: adjust.mounted_orientation(BLOCK, free=FREE, free_mount=("lever_arm",)),
            "free_mount: expected names of lever_x, .*, got 'lever_arm'",
        ),
        Wrong(lambda: mounting.calibrate(None, free=FREE), a_block("block", None)),
        Wrong(
            lambda: mounting.calibrate(flown(), free=FREE), a_block("block", "a SimulatedFlight")
        ),
        Wrong(lambda: mounting.two_step(None, free=FREE), a_block("block", None)),
        Wrong(
            lambda: conventions.best_reading(flown(), "calibration"),
            "flight: expected a Flight, got a SimulatedFlight",
        ),
        Wrong(lambda: adjust.free_orientation(None, free=FREE), a_block("block", None)),
        Wrong(
            lambda: mounting.two_step(BLOCK, free=FREE, after=fit()),
            "after: expected a Mounting, got a Bundle",
        ),
        Wrong(lambda: heads.calibrate_heads(None, ["CAM"], free=FREE), a_block("block", None)),
        Wrong(lambda: rig.calibrate(None, free=FREE), a_block("block", None)),
        Wrong(lambda: rig.calibrate(RIG, free="f"), names("free", "the text 'f'")),
        Wrong(
            lambda: rig.relative_orientation(calibrated()["single_step"], "SYN"),
            "synthetic: expected a Camera, got 'SYN'",
        ),
        Wrong(
            lambda: heads.calibrate_heads(RIG, "CAM", free=FREE), names("heads", "the text 'CAM'")
        ),
        Wrong(
            lambda: heads.calibrate_heads(RIG, ["TAIL"], free=FREE),
            "has no camera 'TAIL', only CAM, SIDE",
        ),
        Wrong(
            lambda: heads.relative_orientation(NO_HEADS, SYNTHETIC),
            "heads: expected one head at least, got none",
        ),
        Wrong(
            lambda: heads.relative_orientation({"CAM": fit()}, SYNTHETIC),
            "heads: expected a Heads, got a dict",
        ),
        Wrong(
            lambda: heads.relative_orientation(NO_HEADS, "SYN"),
            "synthetic: expected a Camera, got 'SYN'",
        ),
        Wrong(
            lambda: mounting.single_step(metres, free=FREE),
            r"CAM: expected a focal length in mm, got f=0.05 \(metres\?\)",
        ),
        Wrong(
            lambda: adjust.free_orientation(
                block.select_images(BLOCK, IMAGES.exposure_idx < 6),
                free=FREE,
                positions=with_positions,
            ),
            "positions: expected 6 poses, got 12",
        ),
        Wrong(
            lambda: adjust.free_orientation(BLOCK, free=FREE, positions=POSES),
            "positions: expected a PoseObservations, got a Pose",
        ),
        Wrong(
            lambda: replace(with_positions, sigma_position=np.zeros((12, 3))),
            "sigma_position: expected positive numbers, got 0.0 in row 0",
        ),
        Wrong(
            lambda: replace(with_positions, sigma_attitude=np.ones(12)),
            shape("sigma_attitude", "(12, 3)", "(12,)"),
        ),
        Wrong(
            lambda: mounting.single_step(fit().network, free=FREE), a_block("block", "a Network")
        ),
        Wrong(lambda: adjust.adjust(BLOCK), "network: expected a Network, got a Block"),
        Wrong(lambda: datum_defect(BLOCK), "network: expected a Network, got a Block"),
        Wrong(lambda: adjust_free(None), "network: expected a Network, got None"),
        Wrong(
            lambda: adjust.with_held_poses(BLOCK, ["A1"], None),
            "network: expected a Network, got a Block",
        ),
        Wrong(lambda: exterior_orientations(BLOCK), "bundle: expected a Bundle, got a Block"),
        Wrong(
            lambda: mounting.single_step(lonely, free=FREE),
            "72 observations cannot determine 82 unknowns",
            AdjustmentError,
        ),
        Wrong(
            lambda: mounting.two_step(block.select_images(BLOCK, np.zeros(12, bool)), free=FREE),
            "block 'calibration' has no images",
            AdjustmentError,
        ),
        Wrong(
            lambda: mounting.single_step(block.select_images(BLOCK, np.zeros(12, bool)), free=FREE),
            "block 'calibration' has no images",
            AdjustmentError,
        ),
        Wrong(
            lambda: gross_errors.adjust_rejecting(
                BLOCK, lambda b: adjust.mounted_orientation(b, free=FREE), critical=-3.9
            ),
            positive("critical", -3.9),
        ),
        Wrong(
            lambda: gross_errors.adjust_rejecting(
                BLOCK, lambda b: adjust.mounted_orientation(b, free=FREE), critical=np.nan
            ),
            positive("critical", "nan"),
        ),
        Wrong(
            lambda: gross_errors.adjust_rejecting(
                BLOCK, lambda b: adjust.mounted_orientation(b, free=FREE), sigma0="guess"
            ),
            "sigma0: expected one of known, estimated, got 'guess'",
        ),
        Wrong(
            lambda: gross_errors.adjust_rejecting(BLOCK, fit().network),
            "set_up: expected a function of a block, got a Network",
        ),
        Wrong(
            lambda: adjustment.solve(fit().network, fit().state, max_iterations=0),
            count("max_iterations", 0),
        ),
        Wrong(
            lambda: adjustment.solve(fit().network, fit().state, tolerance=-1.0),
            positive("tolerance", -1.0),
        ),
        Wrong(
            lambda: fit().solution.group("image_points"),
            "kind: expected one of image_point, control_point, gnss, attitude, distance, "
            "got 'image_points'",
        ),
        Wrong(
            lambda: calibrated()["three_step"],
            "method: expected one of two_step, two_step_gnss, single_step, got 'three_step'",
        ),
        Wrong(
            lambda: mounting.weighted(BLOCK, weights="equal", free=FREE),
            "weights: expected one of given, estimated, got 'equal'",
        ),
        Wrong(lambda: mounting.weighted(None, weights="given", free=FREE), a_block("block", None)),
        Wrong(
            lambda: mounting.scaled(BLOCK, {"image_points": 2.0}),
            "factors: expected names of image points, .*, got 'image_points'",
        ),
        Wrong(lambda: mounting.scaled(BLOCK, {"GNSS": 0.0}), positive("GNSS", 0.0)),
        Wrong(
            lambda: variance_components.components(fit(), applied={"gnss": 2.0}),
            "applied: expected names of image points, .*, got 'gnss'",
        ),
        Wrong(
            lambda: variance_components.sigma_tests(BLOCK), "bundle: expected a Bundle, got a Block"
        ),
        Wrong(
            lambda: unknowns.layout(-1, 3, free=()),
            "n_cameras: expected a whole number of 0 or more, got -1",
        ),
        Wrong(
            lambda: estimates.given(CAMERA), "cameras: expected a sequence of Camera, got a Camera"
        ),
        Wrong(
            lambda: estimates.parameters(calibrated()["single_step"]),
            "calibration: expected a Calibration, got a Mounting",
        ),
        Wrong(
            lambda: replace(said(), cov=np.eye(3)),
            r"cov: expected shape \(\d+, \d+\), got \(3, 3\)",
        ),
        Wrong(
            lambda: replace(said(), cov=np.triu(np.ones_like(said().cov))),
            "cov: expected a symmetric matrix",
        ),
        Wrong(lambda: replace(said(), sigma0_sq=-1.0), not_negative("sigma0_sq", -1.0)),
    ]
