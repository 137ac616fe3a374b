"""The ground, validation and statistics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4book.paper import printed
from acx4lib.bundle import rejections, reliability
from acx4lib.geometry import geodesy
from acx4lib.georeferencing import accuracy, direct, validation
from acx4lib.least_squares import covariance
from acx4lib.least_squares import statistics as least_squares_statistics
from support import blocks
from support.wrong_calls.material import BLOCK, FOUND, FRAME, Wrong, calibrated, fit, said


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
        Wrong(
            lambda: replace(FRAME, origin=np.zeros(3)), r"origin: expected shape \(2,\), got \(3,\)"
        ),
        Wrong(lambda: FRAME.from_grid(enh[0]), r"enh: expected shape \(n, 3\), got \(3,\)"),
        Wrong(
            lambda: FRAME.from_grid(np.repeat(enh, 4, axis=0).T),
            r"enh: expected shape \(n, 3\), got \(3, 4\)",
        ),
        Wrong(lambda: FRAME.from_grid(enh[:, :2]), r"enh: expected shape \(n, 3\), got \(1, 2\)"),
        Wrong(lambda: FRAME.to_grid(np.zeros(3)), r"x_m: expected shape \(n, 3\), got \(3,\)"),
        Wrong(lambda: FRAME.grid_axes(np.zeros(3)), r"x_m: expected shape \(n, 3\), got \(3,\)"),
        Wrong(
            lambda: FRAME.pose_from_grid(np.repeat(enh, 2, axis=0), np.zeros((1, 3))),
            r"opk: expected shape \(2, 3\), got \(1, 3\)",
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
        Wrong(lambda: direct.georeference(None, said()), "block: expected a Block, got None"),
        Wrong(
            lambda: validation.validate(None, said(), method="single_step"),
            "block: expected a Block, got None",
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
            r"cov: expected shape \(2, 3, 3\), got \(2, 3\)",
        ),
    ]


def statistics() -> list[Wrong]:
    return [
        Wrong(
            lambda: accuracy.from_differences(np.zeros((3, 40))),
            r"differences: expected shape \(n, 3\), got \(3, 40\)",
        ),
        Wrong(
            lambda: accuracy.from_differences(np.full((4, 3), np.nan)),
            "differences: expected finite numbers, got nan in row 0",
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
            lambda: accuracy.mean_test(FOUND, probability=90),
            r"probability: expected a probability between 0 and 1, got 90 \(per cent\?\)",
        ),
        Wrong(
            lambda: accuracy.mean_test(FOUND, probability=1.0),
            "probability: expected a probability between 0 and 1, got 1.0",
        ),
        Wrong(
            lambda: accuracy.bias_test(np.zeros(3), np.ones(3)),
            r"mean_cov: expected shape \(3, 3\), got \(3,\)",
        ),
        Wrong(
            lambda: accuracy.mean_test(np.zeros((4, 3))),
            "accuracy: expected an Accuracy, got an array",
        ),
        Wrong(
            lambda: accuracy.precision_test(FOUND, (1, 1, 1), probability=90),
            "probability: expected a probability between 0 and 1, got 90",
        ),
        Wrong(
            lambda: accuracy.precision_test(FOUND, (0.0, 1, 1)),
            "sigma_0: expected positive numbers, got 0.0",
        ),
        Wrong(
            lambda: accuracy.precision_test(FOUND, 0.1), "sigma_0: expected three numbers, got 0.1"
        ),
        Wrong(
            lambda: accuracy.rms_interval(1.0, 30, probability=95),
            "probability: expected a probability between 0 and 1, got 95",
        ),
        Wrong(
            lambda: accuracy.rms_interval(-1.0, 30),
            "rms: expected zero or a positive number, got -1.0",
        ),
        Wrong(
            lambda: accuracy.rms_interval(1.0, -2.5),
            "n: expected zero or a positive number, got -2.5",
        ),
        Wrong(
            lambda: rejections.noncentrality(power=80),
            "power: expected a probability between 0 and 1, got 80",
        ),
        Wrong(
            lambda: rejections.noncentrality(critical=-3.9),
            "critical: expected a positive number, got -3.9",
        ),
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
            lambda: least_squares_statistics.critical_tau(-3.9, 10.0),
            "critical: expected a positive number, got -3.9",
        ),
        Wrong(
            lambda: covariance.sigmas(np.ones(4)), r"cov: expected shape \(..., n, n\), got \(4,\)"
        ),
        Wrong(
            lambda: covariance.correlation(np.ones((2, 3))),
            r"cov: expected shape \(..., n, n\), got \(2, 3\)",
        ),
        Wrong(
            lambda: covariance.correlation(np.array([[1.0, 0.5], [0.0, 1.0]])),
            "cov: expected a symmetric matrix",
        ),
        Wrong(
            lambda: covariance.propagate(np.ones((2, 4)), np.eye(3)),
            r"J: expected shape \(..., k, 3\), got \(2, 4\)",
        ),
        Wrong(
            lambda: covariance.propagate(np.ones((2, 3)), np.ones(3)),
            r"cov: expected shape \(..., n, n\), got \(3,\)",
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
