"""The plain normal equations of a network, and both forms of the reduced system."""

import pytest

from acx4lib.bundle.compiled import packing
from acx4lib.least_squares.normal_equations import PlainNormals


@pytest.fixture(scope="session")
def plain():
    """Return what computes the plain normal equations, which the compiled ones must equal."""

    def plain(net, state, damping=0.0):
        return PlainNormals(
            n_columns=net.n_columns,
            free_points=net.free_points,
            equations=net.equations(state),
            damping=damping,
        )

    return plain


@pytest.fixture(params=["dense", "banded"])
def form(request, monkeypatch):
    """Make the reduced system of any block dense, or any banded."""
    if request.param == "banded":
        monkeypatch.setattr(packing, "DENSE_COLUMNS", 0)
        monkeypatch.setattr(packing, "DENSE_SHARE", 2.0)
    return request.param
