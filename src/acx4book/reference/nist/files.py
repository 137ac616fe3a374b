"""NIST's Statistical Reference Datasets for nonlinear regression: files and model functions."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.expected import Array

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


def read(path: Path) -> Dataset:
    """Read a file of the collection.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Dataset
    """
    lines = path.read_text(encoding="ascii").splitlines()
    text = "\n".join(lines)
    first, last = (int(number) for number in _LINES.findall(text)[-1])
    data = np.array([line.split() for line in lines[first - 1 : last]])
    rows = [found[1].split() for line in lines if (found := _PARAMETER.match(line))]
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
    found = re.search(pattern, text)
    if found is None:
        msg = f"no {pattern!r} in the file"
        raise ValueError(msg)
    return found[1]


# --- models ----------------------------------------------------------------------------------


def rise(b: Any, x: Any) -> Any:
    """Exponential rise: BoxBOD, Misra1a."""
    return b[0] * (1 - np.exp(-b[1] * x[0]))


def chwirut(b: Any, x: Any) -> Any:
    """Exponential decay over a straight line."""
    return np.exp(-b[0] * x[0]) / (b[1] + b[2] * x[0])


def dan_wood(b: Any, x: Any) -> Any:
    """Power."""
    return b[0] * x[0] ** b[1]


def gauss(b: Any, x: Any) -> Any:
    """Two bells on an exponential decay."""
    return (
        b[0] * np.exp(-b[1] * x[0])
        + b[2] * np.exp(-((x[0] - b[3]) ** 2) / b[4] ** 2)
        + b[5] * np.exp(-((x[0] - b[6]) ** 2) / b[7] ** 2)
    )


def kirby(b: Any, x: Any) -> Any:
    """Ratio of two parabolas."""
    return (b[0] + b[1] * x[0] + b[2] * x[0] ** 2) / (1 + b[3] * x[0] + b[4] * x[0] ** 2)


def lanczos(b: Any, x: Any) -> Any:
    """Three exponential decays."""
    return sum(b[k] * np.exp(-b[k + 1] * x[0]) for k in (0, 2, 4))


def mgh10(b: Any, x: Any) -> Any:
    """Exponential of a hyperbola."""
    return b[0] * np.exp(b[1] / (x[0] + b[2]))


def mgh17(b: Any, x: Any) -> Any:
    """Two exponential decays and a constant."""
    return b[0] + b[1] * np.exp(-x[0] * b[3]) + b[2] * np.exp(-x[0] * b[4])


def misra1b(b: Any, x: Any) -> Any:
    """Monomolecular adsorption, second form."""
    return b[0] * (1 - (1 + b[1] * x[0] / 2) ** -2)


def misra1c(b: Any, x: Any) -> Any:
    """Monomolecular adsorption, third form."""
    return b[0] * (1 - 1 / np.sqrt(1 + 2 * b[1] * x[0]))


def misra1d(b: Any, x: Any) -> Any:
    """Monomolecular adsorption, fourth form."""
    return b[0] * b[1] * x[0] / (1 + b[1] * x[0])


def nelson(b: Any, x: Any) -> Any:
    """Degradation with time and temperature; a model of the logarithm of the response."""
    return b[0] - b[1] * x[0] * np.exp(-b[2] * x[1])


def rat42(b: Any, x: Any) -> Any:
    """Logistic growth."""
    return b[0] / (1 + np.exp(b[1] - b[2] * x[0]))


def rat43(b: Any, x: Any) -> Any:
    """Richards' growth."""
    return b[0] / (1 + np.exp(b[1] - b[2] * x[0])) ** (1 / b[3])


def roszman(b: Any, x: Any) -> Any:
    """Quantum defects."""
    return b[0] - b[1] * x[0] - np.arctan(b[2] / (x[0] - b[3])) / np.pi


MODELS: Mapping[str, Model] = {
    "BoxBOD": rise,
    "Chwirut1": chwirut,
    "Chwirut2": chwirut,
    "DanWood": dan_wood,
    "Gauss1": gauss,
    "Gauss2": gauss,
    "Gauss3": gauss,
    "Kirby2": kirby,
    "Lanczos1": lanczos,
    "Lanczos3": lanczos,
    "MGH10": mgh10,
    "MGH17": mgh17,
    "Misra1a": rise,
    "Misra1b": misra1b,
    "Misra1c": misra1c,
    "Misra1d": misra1d,
    "Nelson": nelson,
    "Rat42": rat42,
    "Rat43": rat43,
    "Roszman1": roszman,
}
"""The twenty data sets and their models."""

RESPONSES: Mapping[str, Callable[[Array], Array]] = {"Nelson": np.log}
"""Function of the response that is fitted, if it is not the response itself."""
