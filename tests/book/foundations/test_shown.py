import numpy as np

from acx4book.foundations.shown import matrix


def test_a_vector_stands_upright_and_has_its_unit():
    text = matrix("a", [1.0, -0.0004], digits=2, unit="mm").data
    assert text == r"$$a = \begin{pmatrix} 1.00 \\ 0.00 \end{pmatrix}\ \mathrm{mm}$$"


def test_a_matrix_has_its_rows():
    assert r"\begin{pmatrix} 1 & 0 \\ 0 & 1 \end{pmatrix}" in matrix("E", np.eye(2), digits=0).data
