"""Certified regressions of NIST: the problems, our least squares on them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from acx4book.reference import data as reference
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.adjustment import Solution
from acx4lib.least_squares.normal_equations import Equations

# --- NIST's Statistical Reference Datasets for nonlinear regression: files and model functions


Model = Callable[[Any, Any], Any]
"""Response for parameters b and predictors x; numbers may be real, complex or exact decimals."""

_LINES = re.compile(r"\(lines +(\d+) to +(\d+)\)")
_PARAMETER = re.compile(r"^ *b\d+ *= *(.+)$")


@dataclass(frozen=True, kw_only=True, eq=False)
class Dataset:
    """One data set with its certified results.

    Attributes
    ----------
    name, level : str
        `level` is the level of difficulty: Lower, Average or Higher.
    starts : ndarray, shape (2, n_parameters)
    parameters, sigma : tuple of str
        Certified values and standard deviations, as printed.
    sigma0 : str
        Certified residual standard deviation, as printed.
    response : ndarray, shape (n,)
        Texts: the exact decimal numbers of the file.
    predictors : ndarray, shape (n, n_predictors)
        Texts, too.
    """

    name: str
    level: str
    starts: Array
    parameters: tuple[str, ...]
    sigma: tuple[str, ...]
    sigma0: str
    response: np.ndarray
    predictors: np.ndarray


def _read(path: Path) -> Dataset:
    """Read a file of the collection."""
    lines = path.read_text(encoding="ascii").splitlines()
    text = "\n".join(lines)
    first, last = (int(number) for number in _LINES.findall(text)[-1])
    data = np.array([line.split() for line in lines[first - 1 : last]])
    rows = [match[1].split() for line in lines if (match := _PARAMETER.match(line))]
    return Dataset(
        name=path.stem,
        level=_after(text, r"(\w+) Level of Difficulty"),
        starts=np.array([row[:2] for row in rows], dtype=float).T,
        parameters=tuple(row[2] for row in rows),
        sigma=tuple(row[3] for row in rows),
        sigma0=_after(text, r"Residual Standard Deviation: +(\S+)"),
        response=data[:, 0],
        predictors=data[:, 1:],
    )


def _after(text: str, pattern: str) -> str:
    match = re.search(pattern, text)
    if match is None:
        msg = f"no {pattern!r} in the file"
        raise ValueError(msg)
    return match[1]


# --- models ----------------------------------------------------------------------------------


def _rise(b: Any, x: Any) -> Any:
    """Exponential rise: BoxBOD, Misra1a."""
    return b[0] * (1 - np.exp(-b[1] * x[0]))


def _chwirut(b: Any, x: Any) -> Any:
    """Exponential decay over a straight line."""
    return np.exp(-b[0] * x[0]) / (b[1] + b[2] * x[0])


def _dan_wood(b: Any, x: Any) -> Any:
    """Power."""
    return b[0] * x[0] ** b[1]


def _gauss(b: Any, x: Any) -> Any:
    """Two bells on an exponential decay."""
    return (
        b[0] * np.exp(-b[1] * x[0])
        + b[2] * np.exp(-((x[0] - b[3]) ** 2) / b[4] ** 2)
        + b[5] * np.exp(-((x[0] - b[6]) ** 2) / b[7] ** 2)
    )


def _kirby(b: Any, x: Any) -> Any:
    """Ratio of two parabolas."""
    return (b[0] + b[1] * x[0] + b[2] * x[0] ** 2) / (1 + b[3] * x[0] + b[4] * x[0] ** 2)


def _lanczos(b: Any, x: Any) -> Any:
    """Three exponential decays."""
    return sum(b[k] * np.exp(-b[k + 1] * x[0]) for k in (0, 2, 4))


def _mgh10(b: Any, x: Any) -> Any:
    """Exponential of a hyperbola."""
    return b[0] * np.exp(b[1] / (x[0] + b[2]))


def _mgh17(b: Any, x: Any) -> Any:
    """Two exponential decays and a constant."""
    return b[0] + b[1] * np.exp(-x[0] * b[3]) + b[2] * np.exp(-x[0] * b[4])


def _misra1b(b: Any, x: Any) -> Any:
    """Monomolecular adsorption, second form."""
    return b[0] * (1 - (1 + b[1] * x[0] / 2) ** -2)


def _misra1c(b: Any, x: Any) -> Any:
    """Monomolecular adsorption, third form."""
    return b[0] * (1 - 1 / np.sqrt(1 + 2 * b[1] * x[0]))


def _misra1d(b: Any, x: Any) -> Any:
    """Monomolecular adsorption, fourth form."""
    return b[0] * b[1] * x[0] / (1 + b[1] * x[0])


def _nelson(b: Any, x: Any) -> Any:
    """Degradation with time and temperature; a model of the logarithm of the response."""
    return b[0] - b[1] * x[0] * np.exp(-b[2] * x[1])


def _rat42(b: Any, x: Any) -> Any:
    """Logistic growth."""
    return b[0] / (1 + np.exp(b[1] - b[2] * x[0]))


def _rat43(b: Any, x: Any) -> Any:
    """Richards' growth."""
    return b[0] / (1 + np.exp(b[1] - b[2] * x[0])) ** (1 / b[3])


def _roszman(b: Any, x: Any) -> Any:
    """Quantum defects."""
    return b[0] - b[1] * x[0] - np.arctan(b[2] / (x[0] - b[3])) / np.pi


MODELS: Mapping[str, Model] = {
    "BoxBOD": _rise,
    "Chwirut1": _chwirut,
    "Chwirut2": _chwirut,
    "DanWood": _dan_wood,
    "Gauss1": _gauss,
    "Gauss2": _gauss,
    "Gauss3": _gauss,
    "Kirby2": _kirby,
    "Lanczos1": _lanczos,
    "Lanczos3": _lanczos,
    "MGH10": _mgh10,
    "MGH17": _mgh17,
    "Misra1a": _rise,
    "Misra1b": _misra1b,
    "Misra1c": _misra1c,
    "Misra1d": _misra1d,
    "Nelson": _nelson,
    "Rat42": _rat42,
    "Rat43": _rat43,
    "Roszman1": _roszman,
}
"""The data sets that are run, and their models."""

NOT_RUN = ("Bennett5", "ENSO", "Eckerle4", "Hahn1", "Lanczos2", "MGH09", "Thurber")
"""The others of NIST's 27 nonlinear regressions; their files are not among the reference data."""

RESPONSES: Mapping[str, Callable[[Array], Array]] = {"Nelson": np.log}
"""Function of the response to fit, where it is not the response itself."""


# --- The least-squares core alone, tested on certified regressions


State = NDArray[Any]
"""Parameters, as floats or as decimal numbers."""

EXACT = ("Lanczos1",)
"""Its residuals, 1e-13 of a response with 14 digits, are as small as the rounding errors of
double precision. Therefore its parameters and residuals are decimal numbers of 30 digits."""

STEP = 1e-30
"""Imaginary step of the derivatives; it can be so small because no digits cancel."""

CONVERGED = "converged"

BY_NORMALS = ", normal matrix"
"""End of the names of sigma that `adjustment.solve` itself returns."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Regression:
    """A curve through data, as a problem for `adjustment.solve`: no points, one group."""

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
        model = MODELS[self.dataset.name]
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
        response = RESPONSES.get(data.name, np.asarray)
        with localcontext(prec=30), np.errstate(all="ignore"):
            curve = MODELS[data.name](state, self._numbers(data.predictors).T)
            v = curve - response(self._numbers(data.response))
        return np.asarray(v, dtype=float)[:, None]


def results() -> pd.DataFrame:
    """Return all certified values and ours, from both starts.

    Returns
    -------
    DataFrame
        dataset, level, start, iterations, quantity (parameters, their sigma by `_sigma`, the
        residual standard deviation, sigma by the inverse of the normal matrix), printed, ours,
        digits that agree (at most 11), and outcome: converged, or the reason why there is no
        result.
    """
    tables = [
        _compared(_read(reference.path(f"nist-strd/{name}.dat")), start)
        for name in MODELS
        for start in (1, 2)
    ]
    return pd.concat(tables, ignore_index=True)


def _compared(data: Dataset, start: int) -> pd.DataFrame:
    problem = _Regression(dataset=data, number=Decimal if data.name in EXACT else float)
    names = problem.column_names()
    outcome, iterations = CONVERGED, 0
    ours = np.full(3 * len(names) + 1, np.nan)
    try:
        state, solution = adjustment.solve(
            problem, problem.start(start - 1), max_iterations=10_000, tolerance=1e-9
        )
    except AdjustmentError as error:
        outcome = str(error)
    else:
        iterations = solution.iterations
        ours = _values(problem, state, solution)
        if solution.undetermined.any():
            open_names = [n for n, o in zip(names, solution.undetermined, strict=True) if o]
            outcome = f"not determined there: {', '.join(open_names)}"
    printed = (*data.parameters, *data.sigma, data.sigma0, *data.sigma)
    certified = np.array(printed, dtype=float)
    relative = np.maximum(np.abs(ours / certified - 1), 1e-11)
    return pd.DataFrame(
        {
            "dataset": data.name,
            "level": data.level,
            "start": start,
            "iterations": iterations,
            "quantity": [
                *names,
                *(f"sigma of {name}" for name in names),
                "sigma0",
                *(f"sigma of {name}{BY_NORMALS}" for name in names),
            ],
            "printed": printed,
            "ours": ours,
            "digits": -np.log10(relative),
            "outcome": outcome,
        }
    )


def _values(problem: _Regression, state: State, solution: Solution) -> Array:
    """Return parameters, their a posteriori sigma, sigma0, and sigma by the normal matrix."""
    sigma0 = np.sqrt(solution.sigma0_sq)
    by_normals = sigma0 * np.sqrt(np.diag(solution.cov))
    by_qr = sigma0 * _sigma(problem.equations(state)[0].A[:, 0, :])
    return np.concatenate([state.astype(float), by_qr, [sigma0], by_normals])


def _sigma(A: Array) -> Array:
    """Return the a priori sigma of parameters from the QR decomposition of the Jacobian.

    With ``A = Q R``, the inverse of the normal matrix is ``inv(R) inv(R)^T``. The normal matrix
    has the square of the condition number of A, and its inverse half of the digits.
    """
    scale = np.linalg.norm(A, axis=0)
    inverse = np.linalg.inv(np.linalg.qr(A / scale, mode="r"))
    sigma: Array = np.linalg.norm(inverse, axis=1) / scale
    return sigma


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
        agree, or the outcome if there is no result; from the second start, the smallest number of
        digits of sigma by the normal matrix.
    """
    rows = []
    by_normals = table["quantity"].str.endswith(BY_NORMALS)
    for (dataset, level), group in table[~by_normals].groupby(["dataset", "level"], sort=False):
        row = {"data set": dataset, "level": str(level).lower()}
        for start, values in group.groupby("start"):
            outcome = str(values["outcome"].iloc[0])
            row[f"iterations {start}"] = int(values["iterations"].iloc[0])
            least = f"{values['digits'].min():.1f}"
            row[f"digits {start}"] = least if outcome == CONVERGED else outcome
        rows.append(row)
    digits = table[by_normals & (table["start"] == 2)].groupby("dataset")["digits"].min()
    shown = pd.DataFrame(rows)
    return shown.assign(
        **{"σ by normal matrix": shown["data set"].map(digits).map("{:.1f}".format)}
    )
