"""Cameras, poses, rotations and single rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4book.paper import printed
from acx4lib.bundle import rejections, reliability
from acx4lib.geometry import camera, collinearity, frames, geodesy, intersection
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.georeferencing import accuracy, direct, validation
from acx4lib.least_squares import covariance
from acx4lib.least_squares import statistics as least_squares_statistics
from support import blocks
from support.wrong_calls.material import (
    BLOCK,
    CAMERA,
    FOUND,
    FRAME,
    Wrong,
    a_block,
    calibrated,
    count,
    finite,
    fit,
    not_negative,
    positive,
    probability,
    said,
    shape,
)


def head(**wrong):
    right = {
        "name": "CAM",
        "width_px": 4000,
        "height_px": 3000,
        "pixel_mm": 0.006,
        "interior": camera.Interior(f=50.0),
    }
    return lambda: camera.Camera(**{**right, **wrong})


def cameras_and_poses() -> list[Wrong]:
    mirror = np.diag([1.0, 1.0, -1.0])
    colrow = np.zeros((5, 2))
    five = Pose(R=np.tile(np.eye(3), (5, 1, 1)), r=np.zeros((5, 3)))
    return [
        Wrong(lambda: camera.Interior(f=0.0), "focal length must be positive, got f=0.0 mm"),
        Wrong(lambda: camera.Interior(f=np.inf), "f: expected a finite number, got inf"),
        Wrong(lambda: camera.Interior(f="50"), "f: expected a finite number, got '50'"),
        Wrong(lambda: camera.Interior(f=50.0, k1=np.nan), "k1: expected a finite number, got nan"),
        Wrong(lambda: camera.Interior.from_array(np.ones(5)), shape("values", "(10,)", "(5,)")),
        Wrong(head(width_px=0), count("width_px", 0)),
        Wrong(head(height_px=-3000), count("height_px", -3000)),
        Wrong(head(width_px=4000.5), count("width_px", 4000.5)),
        Wrong(head(pixel_mm=0.0), positive("pixel_mm", 0.0)),
        Wrong(
            head(pixel_mm=6.0),
            r"pixel_mm: expected mm, got 6.0, which makes a sensor of 24.0 m \(micrometres\?\)",
        ),
        Wrong(head(interior=50.0), "interior: expected an Interior, got 50.0"),
        Wrong(
            head(T_b_c=Pose(R=np.ones((3, 3)), r=np.zeros(3))),
            "T_b_c.R: expected a rotation matrix",
        ),
        Wrong(head(T_b_c=Pose(R=mirror, r=np.zeros(3))), "T_b_c.R: expected a rotation matrix"),
        Wrong(
            head(T_b_c=Pose(R=np.eye(3), r=np.full(3, np.nan))), "T_b_c.r: expected finite numbers"
        ),
        Wrong(head(T_b_c=five), shape("T_b_c.R", "(3, 3)", "(5, 3, 3)")),
        Wrong(head(name=7), "name: expected text, got 7"),
        Wrong(lambda: Pose(R=np.zeros(3), r=np.zeros(3)), shape("R", "(..., 3, 3)", "(3,)")),
        Wrong(lambda: Pose(R=np.eye(3), r=np.zeros(2)), shape("r", "(..., 3)", "(2,)")),
        Wrong(
            lambda: Pose(R=np.eye(3).tolist(), r=[0, 0, 0]),
            r"R: expected an array of shape \(..., 3, 3\), got a list",
        ),
        Wrong(
            lambda: Pose(R=five.R, r=np.zeros((4, 3))),
            r"R and r: expected as many of either, got \(5,\) and \(4,\)",
        ),
        Wrong(lambda: rotation_from_opk(np.zeros((4, 2))), shape("opk", "(..., 3)", "(4, 2)")),
        Wrong(lambda: frames.opk_jacobian(np.zeros((3, 4))), shape("opk", "(..., 3)", "(3, 4)")),
        Wrong(lambda: frames.opk_from_rotation(np.ones((3, 3))), "R: expected rotation matrices"),
        Wrong(lambda: frames.opk_from_rotation(np.ones(3)), shape("R", "(..., 3, 3)", "(3,)")),
        Wrong(lambda: frames.log(np.zeros(3)), shape("R", "(..., 3, 3)", "(3,)")),
        Wrong(lambda: frames.mean_rotation(2 * np.eye(3)[None]), "R: expected rotation matrices"),
        Wrong(lambda: frames.exp(np.zeros((3, 4))), shape("delta", "(..., 3)", "(3, 4)")),
        Wrong(lambda: frames.turn(3, 0.1), "axis: expected one of 0, 1, 2, got 3"),
        Wrong(lambda: frames.turn(-1, 0.1), "axis: expected one of 0, 1, 2, got -1"),
        Wrong(
            lambda: frames.mean_rotation(np.zeros((0, 3, 3))),
            "R: expected one rotation matrix at least, got none",
        ),
        Wrong(lambda: frames.mean_rotation(np.eye(3)), shape("R", "(n, 3, 3)", "(3, 3)")),
        Wrong(lambda: frames.skew(np.zeros(2)), shape("a", "(..., 3)", "(2,)")),
        Wrong(
            lambda: camera.xy_from_colrow(CAMERA, np.zeros((5, 3))),
            shape("colrow", "(..., 2)", "(5, 3)"),
        ),
        Wrong(lambda: camera.xy_from_colrow("CAM", colrow), "camera: expected a Camera, got 'CAM'"),
        Wrong(
            lambda: camera.colrow_from_xy(CAMERA, np.zeros((5, 3))),
            shape("xy", "(..., 2)", "(5, 3)"),
        ),
        Wrong(
            lambda: camera.distortion(CAMERA, colrow),
            "interior: expected an Interior, got a Camera",
        ),
        Wrong(
            lambda: camera.distort(CAMERA.interior, np.zeros(2)), shape("ideal", "(n, 2)", "(2,)")
        ),
        Wrong(lambda: camera.distort(CAMERA.interior, colrow, steps=0), count("steps", 0)),
        Wrong(
            lambda: collinearity.project(CAMERA, five, np.zeros(3)), shape("x_m", "(n, 3)", "(3,)")
        ),
        Wrong(
            lambda: collinearity.project(CAMERA, five, np.zeros((3, 5))),
            shape("x_m", "(n, 3)", "(3, 5)"),
        ),
        Wrong(
            lambda: collinearity.project(CAMERA, five, np.zeros((4, 3))),
            shape("T_m_c.R", "(4, 3, 3)", "(5, 3, 3)"),
        ),
        Wrong(
            lambda: collinearity.rays(CAMERA, five, np.zeros((5, 3))),
            shape("colrow", "(n, 2)", "(5, 3)"),
        ),
        Wrong(
            lambda: collinearity.as_seen(np.zeros((1, 3)), np.zeros((1, 3)), refraction="yes"),
            "refraction: expected one of none, standard, got 'yes'",
        ),
        Wrong(
            lambda: intersection.intersect(
                np.zeros((2, 3)), np.full((2, 3), 2.0), np.zeros(2, int), 1
            ),
            "directions: expected unit vectors, got one of length 3.46 in row 0",
        ),
        Wrong(
            lambda: intersection.intersect(
                np.zeros((2, 3)), np.tile([0.0, 0.0, 1.0], (2, 1)), np.array([0, 7]), 1
            ),
            "point_idx: expected whole numbers from 0 to 0, got 7 in row 1",
        ),
        Wrong(
            lambda: intersection.intersect(
                np.zeros(3), np.tile([0.0, 0.0, 1.0], (2, 1)), np.zeros(2, int), 1
            ),
            shape("origins", "(2, 3)", "(3,)"),
        ),
        Wrong(
            lambda: intersection.resect(CAMERA, np.zeros((4, 2)), np.zeros((5, 3))),
            shape("x_m", "(4, 3)", "(5, 3)"),
        ),
        Wrong(
            lambda: intersection.resect(CAMERA, np.full((4, 2), np.nan), np.zeros((4, 3))),
            finite("colrow", "nan in row 0"),
        ),
        Wrong(
            lambda: intersection.resect(CAMERA, np.zeros((2, 2)), np.zeros((2, 3))),
            "a resection needs three points or more, got 2",
        ),
    ]


# --- the ground, validation and statistics -----------------------------------------------------


def ground() -> list[Wrong]:
    enh = np.array([[670_000.0, 7_188_000.0, 900.0]])
    far = replace(blocks.CAMERA, name="TAIL")
    return [
        Wrong(lambda: geodesy.GridSystem(crs="EPSG:1"), "'EPSG:1' is no CRS"),
        Wrong(lambda: geodesy.GridSystem(crs=31982), "crs: expected text, got 31982"),
        Wrong(
            lambda: geodesy.GridSystem(crs="EPSG:31982", heights="geoid"),
            "heights 'geoid' is neither",
        ),
        Wrong(
            lambda: replace(FRAME, origin=enh[0, :2]),
            "origin: expected longitude and latitude in degrees, got 670000.0, 7188000.0",
        ),
        Wrong(
            lambda: replace(FRAME, origin=np.array([-25.4, -149.3])),
            "origin: expected longitude and latitude in degrees, got -25.4, -149.3",
        ),
        Wrong(lambda: replace(FRAME, origin=np.zeros(3)), shape("origin", "(2,)", "(3,)")),
        Wrong(lambda: FRAME.from_grid(enh[0]), shape("enh", "(n, 3)", "(3,)")),
        Wrong(
            lambda: FRAME.from_grid(np.repeat(enh, 4, axis=0).T), shape("enh", "(n, 3)", "(3, 4)")
        ),
        Wrong(lambda: FRAME.from_grid(enh[:, :2]), shape("enh", "(n, 3)", "(1, 2)")),
        Wrong(lambda: FRAME.to_grid(np.zeros(3)), shape("x_m", "(n, 3)", "(3,)")),
        Wrong(lambda: FRAME.grid_axes(np.zeros(3)), shape("x_m", "(n, 3)", "(3,)")),
        Wrong(
            lambda: FRAME.pose_from_grid(np.repeat(enh, 2, axis=0), np.zeros((1, 3))),
            shape("opk", "(2, 3)", "(1, 3)"),
        ),
        Wrong(
            lambda: geodesy.mean_origin(FRAME.grid, np.zeros((0, 2))),
            "lonlat: expected one position at least, got none",
        ),
        Wrong(
            lambda: direct.georeference(replace(BLOCK, cameras=(far,)), said()),
            "the calibration has no camera TAIL",
        ),
        Wrong(
            lambda: direct.georeference(BLOCK, calibrated()["single_step"]),
            "calibration: expected a Calibration, got a Mounting",
        ),
        Wrong(lambda: direct.georeference(None, said()), a_block("block", None)),
        Wrong(
            lambda: validation.validate(None, said(), method="single_step"), a_block("block", None)
        ),
        Wrong(
            lambda: validation.validate(BLOCK, calibrated(), method="single_step"),
            "calibration: expected a Calibration, got a Mountings",
        ),
        Wrong(
            lambda: validation.validate(BLOCK, said(), method="mounting/single_step"),
            "method: expected a name without '/', got 'mounting/single_step'",
        ),
        Wrong(
            lambda: validation.validate(BLOCK, said(), method=None),
            "method: expected text, got None",
        ),
        Wrong(
            lambda: validation.validate(BLOCK, said(), method="single_step", refraction="air"),
            "refraction: expected one of none, standard, got 'air'",
        ),
        Wrong(
            lambda: validation.compare(
                BLOCK, np.zeros((2, 3)), np.zeros((2, 3, 3)), np.array([0, 5])
            ),
            "check_idx: expected whole numbers from 0 to 1, got 5 in row 1",
        ),
        Wrong(
            lambda: validation.compare(BLOCK, np.zeros((2, 3)), np.zeros((2, 3)), np.array([0, 1])),
            shape("cov", "(2, 3, 3)", "(2, 3)"),
        ),
    ]


def statistics() -> list[Wrong]:
    return [
        Wrong(
            lambda: accuracy.from_differences(np.zeros((3, 40))),
            shape("differences", "(n, 3)", "(3, 40)"),
        ),
        Wrong(
            lambda: accuracy.from_differences(np.full((4, 3), np.nan)),
            finite("differences", "nan in row 0"),
        ),
        Wrong(
            lambda: accuracy.from_summary(30, mean=(0.0, 0.0), std=(1, 1, 1), rms=(1, 1, 1)),
            "mean: expected three numbers, got 2",
        ),
        Wrong(
            lambda: accuracy.from_summary(30, mean=0.0, std=(1, 1, 1), rms=(1, 1, 1)),
            "mean: expected three numbers, got 0.0",
        ),
        Wrong(
            lambda: accuracy.from_summary(30, mean=(0, 0, 0), std=(1, 1, 1), rms=(1, -1, 1)),
            "rms: expected zero or positive numbers, got -1",
        ),
        Wrong(
            lambda: accuracy.from_summary(-1, mean=(0, 0, 0), std=(1, 1, 1), rms=(1, 1, 1)),
            "number of check points must not be negative, got n=-1",
        ),
        Wrong(
            lambda: accuracy.bias_test(np.zeros(3), np.ones(3)), shape("mean_cov", "(3, 3)", "(3,)")
        ),
        Wrong(
            lambda: accuracy.rms_interval(1.0, 30, probability=95), probability("probability", 95)
        ),
        Wrong(lambda: accuracy.rms_interval(-1.0, 30), not_negative("rms", -1.0)),
        Wrong(lambda: accuracy.rms_interval(1.0, -2.5), not_negative("n", -2.5)),
        Wrong(lambda: rejections.noncentrality(power=80), probability("power", 80)),
        Wrong(lambda: rejections.noncentrality(critical=-3.9), positive("critical", -3.9)),
        Wrong(
            lambda: reliability.reliability(fit().solution),
            "group: expected a Group, got a Solution",
        ),
        Wrong(
            lambda: reliability.parameter_effects(fit(), np.array([10**6])),
            "columns: expected whole numbers from 0 to .*, got 1000000 in row 0",
        ),
        Wrong(
            lambda: reliability.parameter_effects(fit(), np.array(["f"])),
            "columns: expected whole numbers, got an array of <U1",
        ),
        Wrong(
            lambda: least_squares_statistics.critical_tau(-3.9, 10.0), positive("critical", -3.9)
        ),
        Wrong(lambda: covariance.sigmas(np.ones(4)), shape("cov", "(..., n, n)", "(4,)")),
        Wrong(
            lambda: covariance.correlation(np.ones((2, 3))), shape("cov", "(..., n, n)", "(2, 3)")
        ),
        Wrong(
            lambda: covariance.correlation(np.array([[1.0, 0.5], [0.0, 1.0]])),
            "cov: expected a symmetric matrix",
        ),
        Wrong(
            lambda: covariance.propagate(np.ones((2, 4)), np.eye(3)),
            shape("J", "(..., k, 3)", "(2, 4)"),
        ),
        Wrong(
            lambda: covariance.propagate(np.ones((2, 3)), np.ones(3)),
            shape("cov", "(..., n, n)", "(3,)"),
        ),
        Wrong(lambda: accuracy.pec_pcd(FOUND, 1234), "PEC-PCD has no scale 1:1234"),
        Wrong(
            lambda: accuracy.asprs_2023(FOUND, survey_sigma=0.01),
            "survey_sigma: expected three numbers, got 0.01",
        ),
        Wrong(
            lambda: accuracy.asprs_2014(FOUND, survey_sigma=(0.01, -0.01, 0.01)),
            "survey_sigma: expected zero or positive numbers, got -0.01",
        ),
        Wrong(
            lambda: accuracy.classes(np.zeros((30, 3))),
            "accuracy: expected an Accuracy, got an array",
        ),
        Wrong(lambda: printed.table(9), "9"),
        Wrong(
            lambda: printed.value(1, "xp", "CAM3"),
            "Table 1 has no parameter 'xp' in a column 'CAM3'",
        ),
    ]
