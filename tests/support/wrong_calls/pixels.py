"""Heads, their images and tie points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4files.images import exposure, tiff
from acx4lib import block
from acx4lib.errors import AdjustmentError
from acx4lib.synthetic_image import frame, head_map, rendering, response, transferred_points
from acx4lib.tie_points import least_squares_matching, matching, refinement, search
from acx4lib.tie_points import ties as tie_points
from support.pictures import taken
from support.wrong_calls.material import (
    BLOCK,
    GREY,
    HEADS,
    PICTURE,
    POINTS,
    SYNTHETIC,
    Wrong,
    a_block,
    count,
    finite,
    not_negative,
    shape,
    spoilt,
    ties,
)


def pixels() -> list[Wrong]:
    small = frame.reduced_heads(HEADS, 64)
    synthetic = frame.reduced_camera(SYNTHETIC, 64)
    at, near = np.array([[20, 20]]), np.array([[20.0, 20.0]])
    pictures = [np.zeros((h.height_px, h.width_px, 3), np.uint8) for h in small.heads]
    rng = np.random.default_rng(1)
    match, correlate = least_squares_matching.match, least_squares_matching.correlate
    return [
        Wrong(
            lambda: frame.head_from_synthetic(HEADS, 4, np.zeros((1, 2))),
            "k: expected a whole number from 0 to 3, got 4",
        ),
        Wrong(
            lambda: frame.synthetic_from_head(HEADS, -1, np.zeros((1, 2))),
            "k: expected a whole number from 0 to 3, got -1",
        ),
        Wrong(
            lambda: transferred_points.transfer(HEADS, HEADS, SYNTHETIC),
            a_block("block", "a RelativeOrientation"),
        ),
        Wrong(
            lambda: transferred_points.transfer(BLOCK, HEADS, SYNTHETIC),
            f"block 'calibration': no orientation of {BLOCK.cameras[0].name}",
        ),
        Wrong(
            lambda: block.synthetic_images(BLOCK, "SYN"), "synthetic: expected a Camera, got 'SYN'"
        ),
        Wrong(
            lambda: frame.footprint(HEADS, "CAM1"),
            "k: expected a whole number from 0 to 3, got 'CAM1'",
        ),
        Wrong(
            lambda: frame.head_from_synthetic(HEADS, 0, np.zeros(2)), shape("xy", "(n, 2)", "(2,)")
        ),
        Wrong(lambda: frame.footprint(HEADS, 0, per_side=0), count("per_side", 0)),
        Wrong(lambda: frame.coverage(HEADS, SYNTHETIC, spacing_px=0), count("spacing_px", 0)),
        Wrong(
            lambda: refinement.frame_differences(HEADS, HEADS, SYNTHETIC, spacing_px=0),
            count("spacing_px", 0),
        ),
        Wrong(
            lambda: refinement.frame_differences(
                HEADS, taken.printed_heads(("CAM1", "CAM2")), SYNTHETIC
            ),
            "other: expected 4 heads, as of orientation, got 2",
        ),
        Wrong(lambda: frame.reduced_camera(SYNTHETIC, 1.5), "k: expected a whole number"),
        Wrong(lambda: frame.reduced_camera(SYNTHETIC, 0), count("k", 0)),
        Wrong(lambda: replace(HEADS, heads=()), "heads: expected one Camera at least, got none"),
        Wrong(lambda: replace(HEADS, opk=HEADS.opk[1:]), shape("opk", "(4, 3)", "(3, 3)")),
        Wrong(
            lambda: replace(HEADS, xyz_mm=spoilt(HEADS.xyz_mm, np.nan)),
            finite("xyz_mm", "nan in row 3"),
        ),
        Wrong(
            lambda: replace(HEADS, cov_joint=np.eye(24)), shape("cov_joint", "(64, 64)", "(24, 24)")
        ),
        Wrong(
            lambda: tie_points.shared_points(BLOCK, HEADS),
            "heads: expected names of CAM, got 'CAM1'",
        ),
        Wrong(
            lambda: refinement.refine_by_rotations(HEADS, ties(), free="all"),
            "free: expected one of rotations, six, got 'all'",
        ),
        Wrong(
            lambda: refinement.refine_by_rotations(HEADS, ties()[:0]),
            "no two heads share a good tie point",
            AdjustmentError,
        ),
        Wrong(
            lambda: tie_points.refine_by_mean_differences(HEADS, POINTS),
            "ties: expected a TiePoints, got an ImagePoints",
        ),
        Wrong(lambda: rendering.render_plan(small, synthetic, step_px=0), count("step_px", 0)),
        Wrong(lambda: rendering.render_plan(small, synthetic, feather_px=-1.0), "feather_px"),
        Wrong(
            lambda: rendering.render_plan(small, synthetic, interpolation="lanczos"),
            "interpolation",
        ),
        Wrong(lambda: head_map.head_map(small, 0, synthetic, step_px=0), count("step_px", 0)),
        Wrong(
            lambda: rendering.render(rendering.render_plan(small, synthetic), pictures[:2]),
            "2 images for 4 heads",
        ),
        Wrong(
            lambda: rendering.render_rows(rendering.render_plan(small, synthetic), pictures, 9, 3),
            "start: expected a whole number from 0 to 3, got 9",
        ),
        Wrong(
            lambda: rendering.render_rows(
                rendering.render_plan(small, synthetic), pictures, 0, 2.5
            ),
            "stop: expected a whole number from 0 to 253, got 2.5",
        ),
        Wrong(
            lambda: rendering.render(rendering.render_plan(small, synthetic), pictures, threads=0),
            count("threads", 0),
        ),
        Wrong(
            lambda: rendering.resample(pictures[0], small, 0, synthetic, (9, 3, 0, 9)),
            "height and width of window: expected positive numbers, got -6 in row 0",
        ),
        Wrong(
            lambda: exposure.RenderOptions(blend="multiband"),
            "blend 'multiband': must be one of feather, seam",
        ),
        Wrong(lambda: exposure.RenderOptions(feather_px=-5.0), not_negative("feather_px", -5.0)),
        Wrong(lambda: exposure.RenderOptions(feather_px=np.nan), not_negative("feather_px", "nan")),
        Wrong(
            lambda: tiff.Format(height=0, width=9, bands=3, dtype="uint8", pixel_mm=0.006),
            count("height", 0),
        ),
        Wrong(lambda: matching.TieOptions(window_px=20), "window_px must be odd"),
        Wrong(lambda: matching.TieOptions(search_px=-1), count("search_px", -1)),
        Wrong(lambda: matching.TieOptions(cells=0), count("cells", 0)),
        Wrong(
            lambda: matching.TieOptions(least_correlation=np.nan),
            "least_correlation: expected a number from -1 to 1, got nan",
        ),
        Wrong(
            lambda: search.find_ties(pictures[:2], small, synthetic),
            "4 heads need as many images, got 2",
        ),
        Wrong(lambda: search.find_ties(pictures, HEADS, SYNTHETIC), "px with bands is needed"),
        Wrong(
            lambda: response.estimate_response(pictures[:2], small, synthetic, rng=rng),
            "images: expected 4 images, one for each head, got 2",
        ),
        Wrong(
            lambda: response.estimate_response([PICTURE] * 4, small, synthetic, rng=rng),
            shape("image of CAM1", "(105, 140, bands)", "(60, 80, 3)"),
        ),
        Wrong(
            lambda: response.estimate_response(pictures, small, synthetic, rng=1),
            "rng: expected a Generator, got 1",
        ),
        Wrong(
            lambda: response.overlap_samples(pictures, small, synthetic, rng=rng, n_points=0),
            count("n_points", 0),
        ),
        Wrong(lambda: response.fit_response([], n_heads=0, n_bands=3), count("n_heads", 0)),
        Wrong(
            lambda: response.Response(coefficients=np.zeros((4, 3))),
            shape("coefficients", "(n_heads, n_bands, 3)", "(4, 3)"),
        ),
        Wrong(
            lambda: least_squares_matching.spline_coefficients(PICTURE),
            shape("image", "(rows, cols)", "(60, 80, 3)"),
        ),
        Wrong(
            lambda: correlate(PICTURE, PICTURE, at, near, half=5, search=3),
            shape("a", "(rows, cols)", "(60, 80, 3)"),
        ),
        Wrong(lambda: correlate(GREY, GREY, at, near, half=-1, search=3), count("half", -1)),
        Wrong(
            lambda: correlate(GREY, GREY, at, near, half=5, search=-3),
            "search: expected a whole number of 0 or more, got -3",
        ),
        Wrong(
            lambda: correlate(GREY, GREY, at, np.zeros((2, 2)), half=5, search=3),
            shape("near", "(1, 2)", "(2, 2)"),
        ),
        Wrong(
            lambda: correlate(GREY, GREY, at + 0.5, near, half=5, search=3),
            "at: expected whole numbers, got an array of float64",
        ),
        Wrong(lambda: match(GREY, GREY, at[0], near[0], half=5), shape("at", "(n, 2)", "(2,)")),
        Wrong(lambda: match(GREY, GREY, at, near, half=0), count("half", 0)),
        Wrong(lambda: matching.response(PICTURE), shape("grey", "(rows, cols)", "(60, 80, 3)")),
        Wrong(lambda: matching.best_of_cells(GREY, np.ones_like(GREY, bool), 0), count("cell", 0)),
        Wrong(
            lambda: matching.best_of_cells(GREY, np.ones((5, 5), bool), 8),
            shape("allowed", "(60, 80)", "(5, 5)"),
        ),
        Wrong(
            lambda: matching.noise_level(GREY, rng=rng),
            shape("image", "(rows, cols, bands)", "(60, 80)"),
        ),
        Wrong(
            lambda: frame.parallax(SYNTHETIC, np.ones(3), np.ones(3), np.ones((2, 2))),
            shape("relief_m", "(m,)", "(2, 2)"),
        ),
        Wrong(
            lambda: frame.parallax(SYNTHETIC, np.ones(3), np.ones(4), np.ones(2)),
            r"base_m and height_m: expected as many of either, got \(3,\) and \(4,\)",
        ),
    ]
