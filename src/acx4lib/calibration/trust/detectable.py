"""The smallest errors that tests find in each group of observations, and what smaller ones do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.reliability import parameter_effects, reliability
from acx4lib.expected import Array, Index


@dataclass(frozen=True, kw_only=True)
class Detectable:
    """One component of one group of observations.

    Attributes
    ----------
    kind : str
        Of the group, as `Group.kind`.
    component : int
        Its column in the group.
    redundancy : ndarray, shape (n,)
        Redundancy numbers of the n observations that take part.
    bias : ndarray, shape (n,)
        Smallest error of each that is found with a probability of 80 %, in the unit of the
        observation, angles in radians; infinite where nothing controls it.
    effect : float
        Largest effect of such an error on a parameter, in its sigmas; NaN without parameters.
    on : str
        That parameter, ``camera/parameter`` with the library's name of it.
    """

    kind: str
    component: int
    redundancy: Array
    bias: Array
    effect: float
    on: str


def detectable(bundle: Bundle) -> tuple[Detectable, ...]:
    """Return every component of every group of observations that takes part in a bundle."""
    return tuple(_components(bundle))


def _components(bundle: Bundle) -> Iterator[Detectable]:
    columns = shared_columns(bundle)
    names = bundle.network.column_names()
    effects = parameter_effects(bundle, columns)
    for group, effect in zip(bundle.solution.groups, effects, strict=True):
        found = reliability(group)
        for d in range(found.redundancy.shape[1]):
            used = np.isfinite(found.redundancy[:, d])
            if used.any():
                by_parameter = np.abs(effect[used, d]).max(axis=0)
                which = int(np.argmax(by_parameter)) if len(columns) else -1
                yield Detectable(
                    kind=group.kind,
                    component=d,
                    redundancy=found.redundancy[used, d],
                    bias=found.detectable[used, d],
                    effect=float(by_parameter[which]) if len(columns) else np.nan,
                    on=names[columns[which]] if len(columns) else "",
                )


def shared_columns(bundle: Bundle) -> Index:
    """Return the columns of interior orientations and mountings, which images share."""
    layout = bundle.network.layout
    columns = np.concatenate([layout.interior.ravel(), layout.mount.ravel()])
    return columns[columns >= 0]
