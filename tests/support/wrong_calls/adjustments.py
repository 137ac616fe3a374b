"""Adjustments and what they leave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4lib import conventions
from acx4lib.bundle import adjust, gross_errors, observations, unknowns, uses, variance_components
from acx4lib.bundle.free_network import adjust_free, datum_defect
from acx4lib.calibration import estimates, heads, mounting, rig, weights
from acx4lib.errors import AdjustmentError
from acx4lib.flight import block
from acx4lib.geometry import camera
from acx4lib.least_squares import adjustment
from acx4lib.results.rows import exterior_orientations
from support.wrong_calls.material import (
    BLOCK,
    CAMERA,
    FREE,
    IMAGES,
    POINTS,
    POSES,
    RIG,
    SYNTHETIC,
    TRAJECTORY,
    Wrong,
    calibrated,
    fit,
    flown,
    said,
)

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
        Wrong(
            lambda: mounting.calibrate(BLOCK, free="f"),
            "free: expected a sequence of names, got the text 'f'",
        ),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=("focal",)),
            "free: expected names of f, xp, yp, k1, k2, k3, p1, p2, b1, b2, got 'focal'",
        ),
        Wrong(lambda: mounting.single_step(BLOCK, free=(CAMERA,)), "free: expected names of f, "),
        Wrong(
            lambda: mounting.single_step(BLOCK, free=None),
            "free: expected a sequence of names, got None",
        ),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=FREE, fix=["lever"]),
            "fix: expected names of lever_arm, boresight, got 'lever'",
        ),
        Wrong(
            lambda: mounting.single_step(BLOCK, free=FREE, fix="lever_arm"),
            "fix: expected a sequence of names, got the text 'lever_arm'",
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
            "gnss: expected a sequence of names, got the text 'shift'",
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
            lambda: uses.mounted_orientation(BLOCK, free=FREE, free_mount=("lever_arm",)),
            "free_mount: expected names of lever_x, .*, got 'lever_arm'",
        ),
        Wrong(lambda: mounting.calibrate(None, free=FREE), "block: expected a Block, got None"),
        Wrong(
            lambda: mounting.calibrate(flown(), free=FREE),
            "block: expected a Block, got a SimulatedFlight",
        ),
        Wrong(lambda: mounting.two_step(None, free=FREE), "block: expected a Block, got None"),
        Wrong(
            lambda: conventions.best_reading(flown(), "calibration"),
            "flight: expected a Flight, got a SimulatedFlight",
        ),
        Wrong(lambda: uses.free_orientation(None, free=FREE), "block: expected a Block, got None"),
        Wrong(
            lambda: mounting.two_step(BLOCK, free=FREE, after=fit()),
            "after: expected a Mounting, got a Bundle",
        ),
        Wrong(
            lambda: heads.calibrate_heads(None, ["CAM"], free=FREE),
            "block: expected a Block, got None",
        ),
        Wrong(lambda: rig.calibrate(None, free=FREE), "block: expected a Block, got None"),
        Wrong(
            lambda: rig.calibrate(RIG, free="f"),
            "free: expected a sequence of names, got the text 'f'",
        ),
        Wrong(
            lambda: rig.relative_orientation(calibrated()["single_step"], "SYN"),
            "synthetic: expected a Camera, got 'SYN'",
        ),
        Wrong(
            lambda: heads.calibrate_heads(RIG, "CAM", free=FREE),
            "heads: expected a sequence of names, got the text 'CAM'",
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
            lambda: uses.free_orientation(
                block.select_images(BLOCK, IMAGES.exposure_idx < 6),
                free=FREE,
                positions=with_positions,
            ),
            "positions: expected 6 poses, got 12",
        ),
        Wrong(
            lambda: uses.free_orientation(BLOCK, free=FREE, positions=POSES),
            "positions: expected a PoseObservations, got a Pose",
        ),
        Wrong(
            lambda: replace(with_positions, sigma_position=np.zeros((12, 3))),
            "sigma_position: expected positive numbers, got 0.0 in row 0",
        ),
        Wrong(
            lambda: replace(with_positions, sigma_attitude=np.ones(12)),
            r"sigma_attitude: expected shape \(12, 3\), got \(12,\)",
        ),
        Wrong(
            lambda: mounting.single_step(fit().network, free=FREE),
            "block: expected a Block, got a Network",
        ),
        Wrong(lambda: adjust.adjust(BLOCK), "network: expected a Network, got a Block"),
        Wrong(lambda: datum_defect(BLOCK), "network: expected a Network, got a Block"),
        Wrong(lambda: adjust_free(None), "network: expected a Network, got None"),
        Wrong(
            lambda: uses.with_held_poses(BLOCK, ["A1"], None),
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
                BLOCK, lambda b: uses.mounted_orientation(b, free=FREE), critical=-3.9
            ),
            "critical: expected a positive number, got -3.9",
        ),
        Wrong(
            lambda: gross_errors.adjust_rejecting(
                BLOCK, lambda b: uses.mounted_orientation(b, free=FREE), critical=np.nan
            ),
            "critical: expected a positive number, got nan",
        ),
        Wrong(
            lambda: gross_errors.adjust_rejecting(
                BLOCK, lambda b: uses.mounted_orientation(b, free=FREE), sigma0="guess"
            ),
            "sigma0: expected one of known, estimated, got 'guess'",
        ),
        Wrong(
            lambda: gross_errors.adjust_rejecting(BLOCK, fit().network),
            "set_up: expected a function of a block, got a Network",
        ),
        Wrong(
            lambda: adjustment.solve(fit().network, fit().state, max_iterations=0),
            "max_iterations: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: adjustment.solve(fit().network, fit().state, tolerance=-1.0),
            "tolerance: expected a positive number, got -1.0",
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
            lambda: weights.weighted(BLOCK, weights="equal", free=FREE),
            "weights: expected one of given, estimated, got 'equal'",
        ),
        Wrong(
            lambda: weights.weighted(None, weights="given", free=FREE),
            "block: expected a Block, got None",
        ),
        Wrong(
            lambda: weights.scaled(BLOCK, {"image_points": 2.0}),
            "factors: expected names of image points, .*, got 'image_points'",
        ),
        Wrong(
            lambda: weights.scaled(BLOCK, {"GNSS": 0.0}),
            "GNSS: expected a positive number, got 0.0",
        ),
        Wrong(
            lambda: variance_components.components(fit(), applied={"gnss": 2.0}),
            "applied: expected names of image points, .*, got 'gnss'",
        ),
        Wrong(
            lambda: variance_components.sigma_tests(BLOCK),
            "bundle: expected a Bundle, got a Block",
        ),
        Wrong(
            lambda: unknowns.layout(-1, 3, free=()),
            "n_cameras: expected a whole number of 0 or more, got -1",
        ),
        Wrong(
            lambda: estimates.given(CAMERA),
            "cameras: expected a sequence of Camera, got a Camera",
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
        Wrong(
            lambda: replace(said(), sigma0_sq=-1.0),
            "sigma0_sq: expected zero or a positive number, got -1.0",
        ),
    ]
