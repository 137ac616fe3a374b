"""The least-squares core alone, tested on certified regressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from acx4book.reference import data as reference
from acx4book.reference.nist import files
from acx4book.reference.nist.files import Dataset
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.adjustment import Solution
from acx4lib.least_squares.problem import Equations

State = NDArray[Any]
"""Parameters, as floats or as decimal numbers."""

EXACT = ("Lanczos1",)
"""Its residuals, 1e-13 of a response with 14 digits, are as small as the rounding errors of
double precision. Therefore its parameters and residuals are decimal numbers of 30 digits."""

STEP = 1e-30
"""Imaginary step of the derivatives; it can be so small because no digits cancel."""

CONVERGED = "converged"


@dataclass(frozen=True, kw_only=True, eq=False)
class Regression:
    """A curve through data, as a problem for `adjustment.solve`: no points, one group.

    Attributes
    ----------
    dataset : Dataset
    number : callable
        It converts a text to a number: ``float`` or ``Decimal``.
    n_points : int
        Zero.
    """

    dataset: Dataset
    number: Callable[[str], Any]
    n_points: int = 0

    @property
    def n_columns(self) -> int:
        """Number of parameters."""
        return len(self.dataset.parameters)

    @property
    def free_points(self) -> Mask:
        """Empty, as there are no points."""
        return np.zeros(0, dtype=bool)

    def column_names(self) -> list[str]:
        """Return b1, b2 and so on."""
        return [f"b{k + 1}" for k in range(self.n_columns)]

    def start(self, row: int) -> State:
        """Return the first (0) or second (1) approximate values of the file."""
        return self._numbers(self.dataset.starts[row])

    def moved(self, state: State, dx: Array, dp: Array) -> State:  # noqa: ARG002 (no points)
        """Return the parameters after a step."""
        return np.asarray(state + self._numbers(dx))

    def residuals(self, state: State) -> Sequence[tuple[Array, Array]]:
        """Return curve minus response; all have the same weight."""
        v = self._v(state)
        return [(v, np.ones_like(v))]

    def equations(self, state: State) -> Sequence[Equations]:
        """Return the equations linearised at parameters, by complex steps."""
        b, x = state.astype(float), self.dataset.predictors.astype(float).T
        columns: Index = np.arange(len(b))
        shifted = b + 1j * STEP * np.eye(len(b))
        model = files.MODELS[self.dataset.name]
        with np.errstate(all="ignore"):  # bad parameters may overflow; their cost is infinite
            A = np.stack([model(row, x).imag / STEP for row in shifted], axis=-1)
        v = self._v(state)
        return [
            Equations(
                kind="response",
                v=v,
                sigma=np.ones_like(v),
                A=A[:, None, :],
                columns=columns[None],
                unit=np.zeros(len(v), dtype=np.intp),
            )
        ]

    def _numbers(self, values: NDArray[Any]) -> State:
        # str of a float has exactly its significant digits
        flat = [self.number(str(value)) for value in values.ravel()]
        return np.array(flat).reshape(values.shape)

    def _v(self, state: State) -> Array:
        data = self.dataset
        response = files.RESPONSES.get(data.name, np.asarray)
        with localcontext(prec=30), np.errstate(all="ignore"):
            curve = files.MODELS[data.name](state, self._numbers(data.predictors).T)
            v = curve - response(self._numbers(data.response))
        return np.asarray(v, dtype=float)[:, None]


def results() -> pd.DataFrame:
    """Return all certified values and ours, from both starts.

    Returns
    -------
    DataFrame
        dataset, level, start, iterations, quantity (parameters, their sigma, the residual
        standard deviation), printed, ours, digits that agree (at most 11), and outcome: converged,
        or the reason why there is no result.
    """
    tables = [
        _compared(files.read(reference.path(f"nist-strd/{name}.dat")), start)
        for name in files.MODELS
        for start in (1, 2)
    ]
    return pd.concat(tables, ignore_index=True)


def _compared(data: Dataset, start: int) -> pd.DataFrame:
    problem = Regression(dataset=data, number=Decimal if data.name in EXACT else float)
    names = problem.column_names()
    outcome, iterations = CONVERGED, 0
    ours = np.full(2 * len(names) + 1, np.nan)
    try:
        state, solution = adjustment.solve(
            problem, problem.start(start - 1), max_iterations=10_000, tolerance=1e-9
        )
    except AdjustmentError as error:
        outcome = str(error)
    else:
        iterations = solution.iterations
        ours = _values(state, solution)
        if solution.undetermined.any():
            open_names = [n for n, o in zip(names, solution.undetermined, strict=True) if o]
            outcome = f"not determined there: {', '.join(open_names)}"
    printed = (*data.parameters, *data.sigma, data.sigma0)
    certified = np.array(printed, dtype=float)
    relative = np.maximum(np.abs(ours / certified - 1), 1e-11)
    return pd.DataFrame(
        {
            "dataset": data.name,
            "level": data.level,
            "start": start,
            "iterations": iterations,
            "quantity": [*names, *(f"sigma of {name}" for name in names), "sigma0"],
            "printed": printed,
            "ours": ours,
            "digits": -np.log10(relative),
            "outcome": outcome,
        }
    )


def _values(state: State, solution: Solution) -> Array:
    """Return parameters, their a posteriori sigma, and sigma0."""
    sigma = np.sqrt(np.diag(solution.cov) * solution.sigma0_sq)
    return np.concatenate([state.astype(float), sigma, [np.sqrt(solution.sigma0_sq)]])


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return for every data set the smallest number of digits that agree, from both starts.

    Parameters
    ----------
    table : DataFrame
        As `results` returns it.

    Returns
    -------
    DataFrame
        data set, level, and for each start the iterations and the smallest number of digits that
        agree, or the outcome if there is no result.
    """
    rows = []
    for (dataset, level), own in table.groupby(["dataset", "level"], sort=False):
        row = {"data set": dataset, "level": str(level).lower()}
        for start, values in own.groupby("start"):
            outcome = str(values["outcome"].iloc[0])
            row[f"iterations {start}"] = int(values["iterations"].iloc[0])
            least = f"{values['digits'].min():.1f}"
            row[f"digits {start}"] = least if outcome == CONVERGED else outcome
        rows.append(row)
    return pd.DataFrame(rows)
