"""The outcome of a computation, or the reason of its failure, as a value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ParamSpec, TypeVar

import numpy as np

from acx4lib import shown
from acx4lib.errors import AdjustmentError, unsolvable

if TYPE_CHECKING:
    import pandas as pd

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, eq=False)
class Failed:
    """A computation without an outcome; false in a condition.

    Attributes
    ----------
    method : str
        Name of the function that failed.
    reason : str
    error : Exception
        The exception: an AdjustmentError, or numpy's LinAlgError.
    """

    method: str
    reason: str
    error: Exception

    def __bool__(self) -> bool:
        """Return False: there is no outcome."""
        return False

    def __repr__(self) -> str:
        """Describe the failure and its reason in one line."""
        return shown.line(f"Failed {self.method}", " ".join(self.reason.split()))

    def table(self) -> pd.DataFrame:
        """Return a table of parameters without any."""
        return shown.parameter_table(())

    def quality(self) -> pd.DataFrame:
        """Return a table of adjustments without any."""
        return shown.row_table("method", {})


def attempt(function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T | Failed:
    """Return the value of a function, or a Failed where its data determine no outcome.

    Parameters
    ----------
    function : callable
    *args, **kwargs
        Its arguments.
    """
    name = getattr(function, "__name__", type(function).__name__)
    try:
        return function(*args, **kwargs)
    except AdjustmentError as error:
        return Failed(method=name, reason=str(error), error=error)
    except np.linalg.LinAlgError as error:
        return Failed(method=name, reason=str(unsolvable(str(error))), error=error)
