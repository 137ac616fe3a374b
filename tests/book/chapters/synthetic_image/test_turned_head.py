"""The explorer of a turned head: its seams open as the library's equations open them."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.synthetic_image import turned_head
from acx4lib.synthetic_image.frame import head_from_synthetic, synthetic_from_head
from support.pictures import taken
from support.pictures.tied import refined, tied


@pytest.fixture(scope="module")
def synthetic():
    return taken.synthetic(1)


@pytest.fixture(scope="module")
def shown(orientation, synthetic):
    refinement = refined(orientation, tied(orientation, (0, 1), 40)[0])
    return turned_head.explorer(
        refinement, synthetic, turned_head.seams(orientation, synthetic, 1), 1
    )


TURN = [0.013, -0.021, 0.03]


def test_readings_are_the_rms_of_the_moves_by_the_library(orientation, synthetic, shown):
    opk = orientation.opk.copy()
    opk[1] += np.radians(TURN)
    wrong, moves = replace(orientation, opk=opk), []
    for seam in turned_head.seams(orientation, synthetic, 1):
        colrow = head_from_synthetic(orientation, 1, seam.xy)
        moves.append((synthetic_from_head(wrong, 1, colrow) - seam.xy) / synthetic.pixel_mm)
    moves.append(np.concatenate(moves))
    for row, own in zip(shown.readings(TURN), moves, strict=True):
        left = own - moves[-1].mean(axis=0)
        expected = [np.sqrt((d**2).sum(axis=1).mean()) for d in (own, left)]
        assert [float(text) for text in row] == pytest.approx(expected, abs=0.006)


def test_a_shift_takes_away_a_tilt_nearly_and_a_turn_in_the_plane_not(shown):
    tilted, swung = (
        [float(x) for x in shown.readings(v)[-1]] for v in ([0.02, 0, 0], [0, 0, 0.02])
    )
    assert tilted[1] < 0.2 * tilted[0]
    assert swung[1] > 0.5 * swung[0]


def test_the_places_of_a_seam_lie_in_both_heads(orientation, synthetic):
    for seam in turned_head.seams(orientation, synthetic, 1):
        for head in (1, seam.head):
            camera = orientation.heads[head]
            colrow = head_from_synthetic(orientation, head, seam.xy)
            assert np.all((colrow > -0.5) & (colrow < [camera.width_px, camera.height_px]))


def test_what_moves_up_in_the_frame_moves_up_beside_an_upright_seam(shown):
    frame, seam = ([mark.places([0.02, 0, 0]) - mark.at for mark in p.marks] for p in shown.panels)
    upwards = np.concatenate(frame)[:, 1].mean()
    assert upwards < 0  # in a drawing y counts down
    assert all(moved[:, 1].mean() < 0 for moved in seam)


def test_a_head_that_shares_nothing_has_none(orientation, synthetic):
    opk = orientation.opk.copy()
    opk[1, 0] += 1.0
    aside = replace(orientation, opk=opk)
    refinement = refined(orientation, tied(orientation, (0, 1), 40)[0])
    refinement = replace(refinement, orientations={"before": aside, "rotations": aside})
    assert turned_head.view(refinement, synthetic) is None
    assert turned_head.view(refinement, synthetic, head=4) is None
