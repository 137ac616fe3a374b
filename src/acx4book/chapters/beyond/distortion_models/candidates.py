"""A network adjusted with a distortion model of any family.

Corrections that are linear in their coefficients are corrections of the measurements. So a network
with corrected measurements is a network as any other, and the coefficients are further columns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from acx4book.chapters.beyond.distortion_models.families import (
    CENTRAL,
    Model,
    by_coefficient,
)
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network
from acx4lib.bundle.unknowns import State
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block, ImagePoints
from acx4lib.geometry.camera import INTERIOR, Camera
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.problem import Equations
from acx4lib.least_squares.statistical.distributions import chi2_sf

Unknowns = tuple[State, Array]
"""The unknowns of a network, and coefficients, mm, shape (k,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A network of one camera whose measurements a model corrects, as a `problem.Problem`.

    Attributes
    ----------
    network : Network
    model : Model
    """

    network: Network
    model: Model

    @property
    def n_columns(self) -> int:
        """Number of unknowns that are not points."""
        return self.network.n_columns + self.model.n_terms

    @property
    def n_points(self) -> int:
        """Number of points of the block."""
        return self.network.n_points

    @property
    def free_points(self) -> Mask:
        """Which points are unknowns."""
        return self.network.free_points

    @cached_property
    def by_coefficient(self) -> Array:
        """What coefficients of one mm shift the measurements, px, shape (n, 2, k)."""
        camera, points = self.network.block.cameras[0], self.network.image_points
        return by_coefficient(self.model, camera, points.colrow)

    def corrected(self, coefficients: Array) -> Network:
        """Return the network with measurements corrected by coefficients, mm."""
        points = self.network.image_points
        colrow = points.colrow - self.by_coefficient @ coefficients
        return replace(self.network, image_points=replace(points, colrow=colrow))

    def equations(self, state: Unknowns) -> list[Equations]:
        """Linearise the observations of the network, image points also by the coefficients."""
        own, coefficients = state
        image, *others = self.corrected(coefficients).equations(own)
        n_units = len(image.columns)
        new = self.network.n_columns + np.arange(self.model.n_terms)
        by_all = replace(
            image,
            A=np.concatenate([image.A, self.by_coefficient], axis=2),
            columns=np.hstack([image.columns, np.tile(new, (n_units, 1))]),
        )
        return [by_all, *others]

    def moved(self, state: Unknowns, dx: Array, dp: Array) -> Unknowns:
        """Return the unknowns after a step."""
        n = self.network.n_columns
        return self.network.moved(state[0], dx[:n], dp), state[1] + dx[n:]

    def column_names(self) -> list[str]:
        """Return a name for every column."""
        return [*self.network.column_names(), *(f"term {i + 1}" for i in range(self.model.n_terms))]


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted:
    """A block adjusted with a model.

    Attributes
    ----------
    model : Model
    bundle : Bundle
        Of the corrected measurements. Its covariance has the coefficients as its last columns.
    coefficients : ndarray, shape (k,)
        mm.
    """

    model: Model
    bundle: Bundle
    coefficients: Array

    @property
    def camera(self) -> Camera:
        """The camera with its estimates, for corrected measurements."""
        return self.bundle.cameras[0]

    @property
    def distortion_columns(self) -> list[int]:
        """Columns of all parameters of distortion: interior ones first, coefficients last."""
        layout, n = self.bundle.network.layout, self.bundle.network.n_columns
        places = [INTERIOR.index(name) for name in self.model.free if name not in CENTRAL]
        return [*layout.interior[0, places].tolist(), *range(n, n + self.model.n_terms)]

    @property
    def camera_columns(self) -> list[int]:
        """Columns of all that is estimated of the camera: interior, mounting, coefficients."""
        layout, n = self.bundle.network.layout, self.bundle.network.n_columns
        own = np.concatenate([layout.interior[0], layout.mount[0]])
        return [*own[own >= 0].tolist(), *range(n, n + self.model.n_terms)]

    @property
    def estimates(self) -> Array:
        """All parameters of distortion in the order of `distortion_columns`."""
        interior = self.camera.interior
        own = [getattr(interior, name) for name in self.model.free if name not in CENTRAL]
        return np.append(own, self.coefficients)

    def significance(self, columns: list[int], values: Array) -> tuple[float, float]:
        """Return chi-square of parameters against zero, over their number, and its probability."""
        cov = self.covariance(columns)
        scale = np.sqrt(np.diagonal(cov))
        z = values / scale
        chi_square = float(z @ np.linalg.solve(cov / scale[:, None] / scale, z))
        return chi_square / len(z), chi2_sf(chi_square, len(z))

    def covariance(self, columns: list[int]) -> Array:
        """Return the a priori covariance of some columns."""
        at = np.array(columns)
        return self.bundle.solution.inverse.at(at[:, None], at)

    def correct(self, points: ImagePoints) -> ImagePoints:
        """Return measurements corrected by the coefficients."""
        camera = self.bundle.network.block.cameras[0]
        shift = by_coefficient(self.model, camera, points.colrow) @ self.coefficients
        return replace(points, colrow=points.colrow - shift)

    def in_block(self, block: Block) -> Block:
        """Return a block of the same camera with it, and with corrected measurements."""
        return replace(block, cameras=(self.camera,), image_points=self.correct(block.image_points))


def single_step(block: Block, model: Model) -> Fitted:
    """Adjust a block of one camera in a single step, eq. (14), with a distortion model."""
    return fit(mounted_orientation(block, free=model.free), model)


def fit(network: Network, model: Model) -> Fitted:
    """Adjust a network of one camera with a distortion model.

    Parameters
    ----------
    network : Network
        Its free interior parameters are those of the model.
    model : Model

    Raises
    ------
    AdjustmentError
        Where it does not converge, or observations are fewer than unknowns.
    """
    candidate = Candidate(network=network, model=model)
    start = network.start, np.zeros(model.n_terms)
    (state, coefficients), solution = adjustment.solve(candidate, start)
    corrected = candidate.corrected(coefficients)
    bundle = Bundle(network=corrected, state=state, solution=solution)
    return Fitted(model=model, bundle=bundle, coefficients=coefficients)
