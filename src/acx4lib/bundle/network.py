"""The equations of a bundle block: one model for every use (sections 2.1 and 2.2).

Every image depends on a *pose* through a *mounting*: ``T_m_c = T_m_b @ T_b_c``, eq. (14). The
uses differ only in which of the two is free, held or observed; `adjust` sets them up.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from acx4lib import shown
from acx4lib.block import Block, ImagePoints, SurveyedPoints
from acx4lib.bundle.compiled.chain_rule import Hanging
from acx4lib.bundle.compiled.normals import NetworkNormals, by_points
from acx4lib.bundle.compiled.packing import Packed, in_mm, pack, weights
from acx4lib.bundle.compiled.rays import Scene
from acx4lib.bundle.observations import PoseObservations, besides_rays
from acx4lib.bundle.unknowns import Layout, State, moved, named
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.collinearity import (
    Measurement,
    as_seen,
    image_derivatives,
    image_residuals,
    mounted_jacobian,
)
from acx4lib.geometry.frames import Pose
from acx4lib.least_squares.normal_equations import Equations, Normals


@dataclass(frozen=True, kw_only=True, eq=False)
class Network:
    """A block ready for adjustment: its observations and unknowns, as a `normal_equations.Problem`.

    Attributes
    ----------
    block : Block
    pose_names : tuple of str
        Image or exposure names.
    pose_idx : ndarray, shape (n_images,)
        The pose on which each image depends.
    layout : Layout
    image_points : ImagePoints
        The measurements used, sorted by point.
    rows : ndarray, shape (n,)
        Rows of these measurements in the block.
    control : SurveyedPoints
        The control points used; an infinite sigma excludes a component.
    observed : PoseObservations
    start : State
    refraction : str
        ``"none"`` or ``"standard"``.
    distortion_at : str
        ``"adjusted"``, or ``"measured"`` as many programs have it: `collinearity.image_residuals`.
    left_out : dict of str to int
        Number of tie points not used, by the reason.
    """

    block: Block
    pose_names: tuple[str, ...]
    pose_idx: Index
    layout: Layout
    image_points: ImagePoints
    rows: Index
    control: SurveyedPoints
    observed: PoseObservations
    start: State
    refraction: str = "none"
    distortion_at: str = "adjusted"
    left_out: dict[str, int] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Describe the network in one line."""
        parts = {
            "pose": len(self.pose_names),
            "unknown": self.n_columns + 3 * int(self.free_points.sum()),
            "image point": len(self.image_points),
            "control point": len(self.control),
        }
        counts = (shown.count(n, noun) for noun, n in parts.items())
        return shown.line(f"Network of {self.block.name!r}", *counts)

    @property
    def n_columns(self) -> int:
        """Number of unknowns that are not points."""
        return self.layout.n_columns

    @property
    def n_points(self) -> int:
        """Number of points of the block, used or not."""
        return len(self.block.points)

    @cached_property
    def free_points(self) -> Mask:
        """Points that are unknowns: measured, and not given without error, shape (n_points,)."""
        free = np.zeros(self.n_points, dtype=bool)
        free[self.image_points.point_idx] = True
        free[self.control.point_idx] = True
        free[self.control.point_idx[self.held_control]] = False
        free.flags.writeable = False
        return free

    @property
    def exposure_idx(self) -> Index:
        """The exposure of every pose, which is an exposure's or an image's."""
        rows = np.arange(len(self.pose_names))
        rows[self.pose_idx] = self.block.images.exposure_idx
        return rows

    @property
    def first_poses(self) -> Index:
        """The first pose of every exposure that has a pose."""
        return np.unique(self.exposure_idx, return_index=True)[1]

    @property
    def held_control(self) -> Mask:
        """Which control points are given free of error."""
        return np.all(self.control.sigma_m == 0, axis=1)

    @property
    def observed_points(self) -> Index:
        """Points that are observed besides their rays, sorted."""
        return np.unique(self.control.point_idx[~self.held_control])

    def column_names(self) -> list[str]:
        """Return a name for every column, such as ``camera/parameter`` or ``pose/parameter``."""
        return named(
            self.layout,
            cameras=[camera.name for camera in self.block.cameras],
            strips=[f"strip {name}" for name in self.observed.strips.names],
            poses=self.pose_names,
        )

    def moved(self, state: State, dx: Array, dp: Array) -> State:
        """Return the state after a step; rotations are about the turned axes."""
        return moved(self.layout, state, dx, dp)

    def residuals(self, state: State) -> list[tuple[Array, Array]]:
        """Return v and sigma of image points and what is observed `besides_rays`."""
        others = [(e.v, e.sigma) for e in self.besides_rays(state)]
        return [(image_residuals(*_seen(self, state)), _image_sigma(self)), *others]

    def equations(self, state: State) -> list[Equations]:
        """Linearise image points and what is observed `besides_rays`."""
        return [_image_equations(self, state), *self.besides_rays(state)]

    def besides_rays(self, state: State) -> list[Equations]:
        """Linearise the observations that are no image points: `observations.besides_rays`."""
        control = self.control[~self.held_control]
        return list(besides_rays(self.block, control, self.observed, state, self.layout))

    def normals(
        self, state: State, damping: float = 0.0, before: Normals | None = None
    ) -> NetworkNormals:
        """Return the normal equations at a state; they reuse memory of those before."""
        packed, layout = self.packed, self.layout
        camera = self.block.images.camera_idx[packed.image]
        pose = self.pose_idx[packed.image]
        T_m_c = camera_poses(self, state)[packed.image]
        by_pose, by_mount = mounted_jacobian(state.T_m_b[pose], state.T_b_c[camera])
        R_c_m = np.swapaxes(T_m_c.R, -1, -2)
        for J in (by_pose, by_mount):  # turned to the camera's axes
            J[:, :3] = R_c_m @ J[:, :3]
        place = np.argsort(packed.pose)  # of each pose in that order
        others = self.besides_rays(state)
        V, h = by_points(self.observed_points, others)
        return NetworkNormals(
            packed=packed,
            scene=Scene(
                R_m_c=np.ascontiguousarray(T_m_c.R),
                r_m_c=np.ascontiguousarray(T_m_c.r),
                camera=camera,
                interior=np.array([interior.to_array() for interior in state.interiors]),
                x_m=state.x_m.take(packed.rays.point, axis=0),
                V=V,
                h=h,
                refraction=self.refraction == "standard",
                adjusted=self.distortion_at == "adjusted",
                damping=damping,
            ),
            hanging=Hanging(
                by_pose=by_pose,
                by_mount=by_mount,
                pose=place[pose],
                camera=camera,
                n_poses=len(place),
                n_cameras=len(self.block.cameras),
            ),
            n_columns=self.n_columns,
            border=np.hstack([layout.interior, layout.mount]),
            pose_columns=layout.pose[packed.pose],
            sigma_px=self.image_points.sigma_px,
            n_points=self.n_points,
            others=others,
            room=before.give_up_band() if isinstance(before, NetworkNormals) else None,
        )

    @cached_property
    def packed(self) -> Packed:
        """The measurements in the order in which compiled code processes them."""
        return pack(
            in_mm(self.block, self.image_points),
            free_points=self.free_points,
            also=self.observed_points,
            pose_of_image=self.pose_idx,
            positions=self.observed.T_m_b.r,
            linked=self.observed.linked,
        )

    def beginning_at(self, start: State) -> Network:
        """Return the network with other start values."""
        return self._of_same_rays(replace(self, start=start))

    def with_layout(self, columns: Layout) -> Network:
        """Return the network with other columns, of the same poses and points."""
        return self._of_same_rays(replace(self, layout=columns))

    def _of_same_rays(self, other: Network) -> Network:
        """Give another network what is known of the rays, which takes long to find."""
        if "packed" in vars(self):
            vars(other)["packed"] = self.packed
        return other

    def with_sigma(
        self,
        *,
        image_points: ImagePoints,
        control: SurveyedPoints,
        observed: PoseObservations,
    ) -> Network:
        """Return the network with other standard deviations of its observations."""
        out = replace(
            self,
            image_points=image_points,
            control=control,
            observed=observed,
        )
        if not observed.linked.size:  # the order in which rays are processed stays
            vars(out)["packed"] = self.packed.weighted(weights(self.block, image_points))
        return out


# --- observations ----------------------------------------------------------------------------


def camera_poses(network: Network, state: State) -> Pose:
    """Return the pose T_m_c of every image, eq. (14)."""
    return state.T_m_b[network.pose_idx] @ state.T_b_c[network.block.images.camera_idx]


def _image_sigma(network: Network) -> Array:
    return np.repeat(network.image_points.sigma_px[:, None], 2, axis=1)


def _seen(network: Network, state: State) -> tuple[Measurement, Array]:
    """Return the measurements with their camera poses, and the apparent positions of the points."""
    points = network.image_points
    T_m_c = camera_poses(network, state)[points.image_idx]
    x_m = as_seen(T_m_c.r, state.x_m[points.point_idx], refraction=network.refraction)
    cameras = [
        camera.with_interior(interior)
        for camera, interior in zip(network.block.cameras, state.interiors, strict=True)
    ]
    camera_idx = network.block.images.camera_idx[points.image_idx]
    return Measurement(
        cameras=tuple(cameras),
        camera_idx=camera_idx,
        T_m_c=T_m_c,
        colrow=points.colrow,
        distortion_at=network.distortion_at,
    ), x_m


def _image_equations(network: Network, state: State) -> Equations:
    points, images = network.image_points, network.block.images
    measurement, x_m = _seen(network, state)
    v, by_interior, by_pose, by_point = image_derivatives(measurement, x_m)
    free = np.flatnonzero((network.layout.interior >= 0).any(axis=0))
    A, columns = _pose_parts(network, state, by_pose)
    return Equations(
        kind="image_point",
        v=v,
        sigma=_image_sigma(network),
        A=np.concatenate([by_interior[:, :, free], A], axis=2),
        columns=np.concatenate(
            [network.layout.interior[images.camera_idx][:, free], columns], axis=1
        ),
        unit=points.image_idx,
        B=by_point,
        point=points.point_idx,
    )


def _pose_parts(network: Network, state: State, by_camera: Array) -> tuple[Array, Index]:
    """Return derivatives by body pose and, where free, mounting from those by camera pose."""
    images, points = network.block.images, network.image_points
    T_m_b = state.T_m_b[network.pose_idx]
    by_body, by_mount = mounted_jacobian(T_m_b, state.T_b_c[images.camera_idx])
    pose_columns = network.layout.pose[network.pose_idx]
    if np.all(network.layout.mount < 0):
        return by_camera @ by_body[points.image_idx], pose_columns
    by_mount_and_body = np.concatenate([by_mount, by_body], axis=2)
    columns = np.concatenate([network.layout.mount[images.camera_idx], pose_columns], axis=1)
    return by_camera @ by_mount_and_body[points.image_idx], columns
