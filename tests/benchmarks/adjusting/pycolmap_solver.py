"""Adjust a problem file without lens with pycolmap: ``python pycolmap_solver.py PROBLEM HOW``.

HOW is ``default``, ``tuned`` or ``covariance``: tuned, then covariances of all poses and points.
What is timed begins with the same arrays as ours: a Reconstruction is made from them, too.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from acx4lib.bundle.network import Network
from acx4lib.geometry.camera import colrow_from_xy
from benchmarks.adjusting import bench_blocks
from benchmarks.adjusting.bench_blocks import PINHOLE
from benchmarks.harness import clocked, memory_mb, report

FLIP = np.diag([1.0, -1.0, -1.0])
"""Our cameras look along -z, with y up; those of pycolmap along +z, with y down."""

COST_TOLERANCE = 1e-10
"""Relative change of cost at which tuned pycolmap stops, as Ceres does beside it."""


DENSE = 100
"""Largest number of images for which a dense Schur complement is faster."""


def reconstruction(network: Network) -> pycolmap.Reconstruction:
    """Return the start of a network as pycolmap has it; images and points count from 1."""
    made = pycolmap.Reconstruction()
    made.add_camera_with_trivial_rig(_camera(network))
    points, start = network.image_points, network.start
    order = np.argsort(points.image_idx, kind="stable")
    ends = np.searchsorted(points.image_idx[order], np.arange(len(network.pose_names) + 1))
    place = np.empty(len(order), dtype=np.intp)  # of a measurement within its image
    place[order] = np.arange(len(order)) - ends[points.image_idx[order]]
    for i, name in enumerate(network.pose_names):
        R = FLIP @ start.T_m_b.R[i].T
        pose = pycolmap.Rigid3d(np.column_stack([R, -R @ start.T_m_b.r[i]]))
        keypoints = points.colrow[order[ends[i] : ends[i + 1]]]
        image = pycolmap.Image(name=name, keypoints=keypoints, camera_id=1, image_id=i + 1)
        made.add_image_with_trivial_frame(image, pose)
    by_point = np.argsort(points.point_idx, kind="stable")
    ends = np.searchsorted(points.point_idx[by_point], np.arange(network.n_points + 1))
    image_ids, places = (points.image_idx[by_point] + 1).tolist(), place[by_point].tolist()
    for p, x in enumerate(start.x_m):
        rays = range(ends[p], ends[p + 1])
        if rays:
            track = [pycolmap.TrackElement(image_ids[q], places[q]) for q in rays]
            made.add_point3D(x, pycolmap.Track(track))
    return made


def _camera(network: Network) -> pycolmap.Camera:
    camera, interior = network.block.cameras[0], network.start.interiors[0]
    col, row = colrow_from_xy(camera, np.array([[interior.xp, interior.yp]]))[0]
    return pycolmap.Camera(
        camera_id=1,
        model="SIMPLE_PINHOLE",
        width=camera.width_px,
        height=camera.height_px,
        params=[interior.f / camera.pixel_mm, col, row],
    )


def priors(network: Network, made: pycolmap.Reconstruction) -> list[pycolmap.PosePrior]:
    """Return the observed positions; residuals in the image count in pixels, not in sigma."""
    observed, sigma_px = network.observed, network.image_points.sigma_px[0]
    out = []
    for i, r in enumerate(observed.T_m_b.r):
        along = observed.R_g_m[i] / observed.sigma_position[i][:, None]
        prior = pycolmap.PosePrior(
            pose_prior_id=i + 1,
            corr_data_id=made.images[i + 1].data_id,
            position=r,
            position_covariance=np.linalg.inv(along.T @ along) / sigma_px**2,
            coordinate_system=pycolmap.PosePriorCoordinateSystem.CARTESIAN,
        )
        out.append(prior)
    return out


def options(how: str, *, n_images: int) -> pycolmap.BundleAdjustmentOptions:
    """Return the options of a way to solve.

    Tuned are what was faster in trials: a trust region that lets it begin with whole steps, one
    thread, and the better linear solver.
    """
    chosen = pycolmap.BundleAdjustmentOptions()
    chosen.refine_principal_point = True
    chosen.print_summary = False
    if how != "default":
        solver = chosen.ceres.solver_options
        solver.function_tolerance, solver.gradient_tolerance = COST_TOLERANCE, 0.0
        kinds, dense = type(solver.linear_solver_type), n_images <= DENSE
        solver.linear_solver_type = kinds.DENSE_SCHUR if dense else kinds.SPARSE_SCHUR
        solver.dense_linear_algebra_library_type = "LAPACK"
        solver.initial_trust_region_radius = 1e16
        solver.num_threads = 1
        chosen.ceres.auto_select_solver_type = False
    return chosen


def solve(network: Network, how: str) -> tuple[pycolmap.Reconstruction, Any]:
    """Return the adjusted reconstruction and what Ceres says of it."""
    made, config = reconstruction(network), pycolmap.BundleAdjustmentConfig()
    for image_id in made.images:
        config.add_image(image_id)
    adjuster = pycolmap.create_pose_prior_ceres_bundle_adjuster(
        options(how, n_images=len(made.images)),
        pycolmap.PosePriorBundleAdjustmentOptions(),
        config,
        priors(network, made),
        made,
    )
    summary = adjuster.solve()
    if how == "covariance":
        found = pycolmap.estimate_ba_covariance(pycolmap.BACovarianceOptions(), made, adjuster)
        if found is None:
            sys.exit("pycolmap has no covariances")
        for image_id in made.images:
            found.get_cam_cov_from_world(image_id)
        for point_id in made.points3D:
            found.get_point_cov(point_id)
    return made, summary


def main(path: Path, how: str) -> None:
    """Read, adjust, report."""
    baseline_mb = memory_mb("VmRSS")
    network = bench_blocks.read_problem(path, free=PINHOLE, free_mount=())
    (made, summary), seconds = clocked(lambda: solve(network, how))
    peak_mb = memory_mb("VmHWM")
    ceres = summary.ceres_summary
    sigma_px = network.image_points.sigma_px[0]
    report(
        {
            **seconds,
            "peak_mb": peak_mb,
            "growth_mb": peak_mb - baseline_mb,
            "start_cost": 2 * ceres.initial_cost / sigma_px**2,
            "cost": 2 * ceres.final_cost / sigma_px**2,
            "steps": ceres.num_successful_steps,
            "converged": summary.is_solution_usable(),
            "position": [made.images[i].projection_center().tolist() for i in sorted(made.images)],
        }
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
