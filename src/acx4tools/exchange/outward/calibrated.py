"""Read the calibration to export, and its cameras, from a results folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acx4lib import expected
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index
from acx4lib.flight.reader import Flight
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, opk_jacobian, rotation_from_opk, skew
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.results import folder
from acx4lib.results.provenance import check_kept, read_run
from acx4lib.results.read_back import read_calibration, read_relative_orientation, refused

CAMERA = ("single_step", "two_step_gnss", "two_step")
HEADS = ("rig", "rig_calibration", "refined", "relative_orientation")
"""Methods that calibrate one mounted camera, and those that calibrate heads; the best first."""

STAGE = {"refined": "synthetic", "relative_orientation": "heads"}
"""Stages of the methods that are not of the stage mounting."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibrated:
    """A calibration to export.

    Attributes
    ----------
    flight : Flight
        As the results keep it.
    method : str
        One of `CAMERA` or `HEADS`.
    calibration : Calibration
        In `cov`, a posteriori. Without mounting, mountings are as flight.toml declares them, and
        only the heads' rotations relative to each other are estimated.
    others : tuple of str
        Methods that the results have besides.
    digest : str
        SHA-256 of the tables of the flight.
    """

    flight: Flight
    method: str
    calibration: Calibration
    others: tuple[str, ...] = ()
    digest: str = ""

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The calibrated cameras; of heads the first one is the reference."""
        return self.calibration.cameras

    @property
    def title(self) -> str:
        """Names of the cameras, and the method."""
        return f"{', '.join(camera.name for camera in self.cameras)} by {self.method}"

    @property
    def origin(self) -> str:
        """Sentence on the flight of the calibration."""
        return f"calibrated on the flight {self.flight.name!r}; SHA-256 of its tables {self.digest}"

    @property
    def mounted(self) -> bool:
        """Whether boresight and lever arm are estimated."""
        return self.method not in STAGE


def read(results: str | Path, *, method: str = "", heads: bool = False) -> Calibrated:
    """Read a calibration from the results of a run.

    Parameters
    ----------
    results : path
    method : str
        One of `CAMERA` or `HEADS`; by default the best that the results have.
    heads : bool
        Whether only calibrations of heads can be used.

    Raises
    ------
    FlightError
        Where the folder has no such results, they were changed after the run, or the method did
        not end with a calibration.
    ValueError
        For an unknown method.
    """
    if method:
        expected.one_of("method", method, (*CAMERA, *HEADS))
    run = read_run(results)
    for stage in ("heads", "synthetic", "mounting"):
        check_kept(run, stage)
    stored, flight = run.found, run.flight
    ended = [name for name in (*CAMERA, *HEADS) if _ended(stored, name)]
    usable = [name for name in ended if not heads or name in HEADS]
    chosen = method or next(iter(usable), "")
    if chosen not in usable:
        raise FlightError([_missing(stored, chosen, ended, heads=heads)])
    with refused(stored):
        calibration = _calibration(stored, chosen, flight)
    return Calibrated(
        flight=flight,
        method=chosen,
        calibration=calibration,
        others=tuple(name for name in usable if name != chosen),
        digest=run.provenance.digest,
    )


def _key(method: str) -> str:
    return f"{STAGE.get(method, 'mounting')}/{method}"


def _ended(stored: folder.Results, method: str) -> bool:
    """Tell whether a method ended with a calibration."""
    entry = stored.summary.get(_key(method), {})
    named = folder.has(stored, _key(method)) and folder.cameras(stored, _key(method))
    return bool(named) and bool(entry.get("converged", True)) and not entry.get("stopped")


def _missing(stored: folder.Results, method: str, ended: Sequence[str], *, heads: bool) -> str:
    entry = stored.summary.get(_key(method), {}) if method else {}
    messages = [*folder.messages(entry, "stopped"), *folder.messages(entry, "left_out")]
    wanted = method or ("heads" if heads else "any method")
    if heads and method in CAMERA:
        reason = f"it is of one camera; of heads are {', '.join(HEADS)}"
    else:
        reason = messages[0] if messages else f"it has {', '.join(ended) or 'none'}"
    return f"{stored.folder}: no calibration of {wanted} that can be exported; {reason}"


def _calibration(stored: folder.Results, method: str, flight: Flight) -> Calibration:
    names = folder.cameras(stored, _key(method))
    if method in STAGE:
        related = read_relative_orientation(stored, _key(method), flight.cameras)
        return _of_relative_orientation(related, flight.synthetic_camera)
    cameras = [flight.cameras[name] for name in names]
    calibration = read_calibration(stored, _key(method), cameras)
    return replace(calibration, cov=calibration.cov * calibration.sigma0_sq, sigma0_sq=1.0)


def _of_relative_orientation(
    related: RelativeOrientation, synthetic: Camera | None = None
) -> Calibration:
    """Return heads with their estimated rotations relative to each other as a calibration."""
    R_b_s = np.eye(3) if synthetic is None else synthetic.T_b_c.R
    n = len(related.heads)
    rotations = R_b_s @ rotation_from_opk(related.opk)
    cameras = tuple(
        replace(head, T_b_c=Pose(R=R, r=head.T_b_c.r))
        for head, R in zip(related.heads, rotations, strict=True)
    )
    kept = np.flatnonzero(_estimated(related))
    columns = np.full(15 * n, -1)
    columns[kept] = np.arange(len(kept))
    mount = columns[: 6 * n].reshape(n, 6).copy()
    mount[:, :3] = -1
    return Calibration(
        cameras=cameras,
        layout=Layout(
            interior=columns[6 * n :].reshape(n, 9),
            mount=mount,
            pose=np.zeros((0, 6), dtype=np.intp),
        ),
        cov=_about_axes(related)[np.ix_(kept, kept)],
        sigma0_sq=1.0,
        open_columns=np.zeros(len(kept), dtype=bool),
    )


def _estimated(related: RelativeOrientation) -> np.ndarray:
    """Tell which joint quantities are rotations or estimated interior parameters."""
    n = len(related.heads)
    known: np.ndarray = np.diag(related.cov_joint) > 0
    known[: 6 * n] = np.tile([False] * 3 + [True] * 3, n)
    return known


def _about_axes(related: RelativeOrientation) -> Array:
    """Return the joint covariance with rotations about the heads' own axes."""
    J = np.eye(len(related.cov_joint))
    for k, opk in enumerate(related.opk):
        angles = slice(6 * k + 3, 6 * k + 6)
        J[angles, angles] = np.linalg.inv(opk_jacobian(opk))
    return propagate(J, related.cov_joint)


# --- Heads of a rig relative to the first of them


R_C_V = np.diag([1.0, -1.0, -1.0])
"""From the axes of computer vision, y down and z ahead, to the library's camera axes, and back."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relative:
    """A head in the axes of the reference head.

    Attributes
    ----------
    T_r_h : Pose
        Head to reference, library's camera axes, m.
    cov : ndarray, shape (6, 6)
        Of the position along the reference's axes, m, and of a rotation about the head's axes,
        radians; zero where nothing is estimated.
    """

    T_r_h: Pose
    cov: Array

    @property
    def T_v_r_h(self) -> Pose:
        """Pose of the head with y down and z ahead in both heads."""
        return Pose(R=R_C_V @ self.T_r_h.R @ R_C_V, r=R_C_V @ self.T_r_h.r)

    @property
    def sigma_opk(self) -> Array:
        """Standard deviations of omega, phi, kappa of `T_v_r_h`, radians, shape (3,)."""
        J = opk_jacobian(self.T_v_r_h.opk) @ R_C_V
        return sigmas(propagate(J, self.cov[3:, 3:]))

    @property
    def sigma_position(self) -> Array:
        """Standard deviations of the position, m, shape (3,); signs of axes do not matter."""
        return sigmas(self.cov[:3, :3])


def to_first(calibration: Calibration) -> tuple[Relative, ...]:
    """Return every camera's pose relative to the first camera; its own is the identity.

    Parameters
    ----------
    calibration : Calibration
        With a posteriori covariance.
    """
    first = calibration.cameras[0].T_b_c
    out = []
    for k, camera in enumerate(calibration.cameras):
        T_r_h = first.inverse @ camera.T_b_c if k else Pose(R=np.eye(3), r=np.zeros(3))
        J = np.zeros((6, calibration.n_columns + 1))  # the last column is of what is held
        if k:
            by_first, by_head = _derivatives(first, T_r_h)
            _add(J, calibration.layout.mount[0], by_first)
            _add(J, calibration.layout.mount[k], by_head)
        out.append(Relative(T_r_h=T_r_h, cov=propagate(J[:, :-1], calibration.cov)))
    return tuple(out)


def _derivatives(first: Pose, T_r_h: Pose) -> tuple[Array, Array]:
    """Return d(relative pose) / d(mounting) of the reference and of the head, (6, 6) each."""
    by_first, by_head = np.zeros((6, 6)), np.eye(6)
    by_first[:3, :3], by_head[:3, :3] = -first.R.T, first.R.T
    by_first[:3, 3:] = skew(T_r_h.r)
    by_first[3:, 3:] = -T_r_h.R.T
    return by_first, by_head


def _add(J: Array, columns: Index, derivative: Array) -> None:
    for j, column in enumerate(columns):
        J[:, column] += derivative[:, j]  # column -1 is the one of what is held
