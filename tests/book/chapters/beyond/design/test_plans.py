import numpy as np
import pytest

from acx4book.chapters.beyond.design import plans
from acx4lib.planning.exposures import flying_time_s
from acx4sim.designs import acx4_ideal_plan


def test_the_papers_block_is_the_simulators(plan):
    block, simulated = plan.blocks["calibration"], acx4_ideal_plan().blocks["calibration"]
    assert [s.n_exposures for s in block.strips.values()] == [s.n for s in simulated.strips]
    heights = [s.flying_height_m for s in block.strips.values()]
    assert heights == [s.height_m for s in simulated.strips]
    assert {*heights} == {plans.LOW_M, plans.HIGH_M}
    assert plan.setup.gnss == ("shift",)


def test_strips_of_a_pair_are_opposite_through_one_middle(plan):
    there, back = plans.pair(plan, 1000.0, 30.0).values()
    assert (back.course_deg - there.course_deg) % 360 == 180
    assert there.course_deg == plans.COURSE_DEG + 30
    assert there.n_exposures == back.n_exposures == plans.N_IMAGES
    assert flying_time_s((there,)) == pytest.approx(6 * there.base_m / 70)


def test_an_image_has_four_fifths_of_the_next(plan):
    one = plans.strip(plan, 1000.0, 0.0)
    camera = plan.cameras("calibration")[0]
    narrow = 1e-3 * 5.6 * min(camera.width_px, camera.height_px)
    assert one.base_m == pytest.approx(0.2 * narrow * 1000 / camera.interior.f, rel=1e-3)


def test_groups_keep_all_of_their_strips(plan):
    both = plans.several([plans.pair(plan, 1000.0)] * 2)
    assert len(both) == 4
    flown = plans.flown(plan, both, control=3).blocks["calibration"]
    assert flown.points.number == (3,)
    assert np.all([*flown.strips] == [*both])
