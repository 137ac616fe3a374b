"""Nielsen's rule, by the figures of his report."""

import pytest

from acx4lib.least_squares.damping import FIRST, Damping, gain


def test_damping_begins_where_a_full_step_fails_and_grows_faster_and_faster():
    damping, values = Damping(), []
    for _ in range(4):
        damping = damping.after_failure()
        values.append(damping.value / FIRST)
    assert values == pytest.approx([1.0, 2.0, 8.0, 64.0])  # factors 2, 4, 8


@pytest.mark.parametrize(("kept", "factor"), [(1.0, 1 / 3), (0.5, 1.0), (0.0, 2.0), (0.75, 0.875)])
def test_after_a_success_it_follows_the_gain(kept, factor):
    after = Damping(value=0.1, growth=16.0).after_success(kept, near=False)
    assert after.value == pytest.approx(0.1 * factor)
    assert after.growth == 2.0


def test_near_the_minimum_steps_are_full_and_damping_is_remembered():
    after = Damping(value=0.3).after_success(1.0, near=True)
    assert after.value == 0.0
    assert after.after_failure().value == pytest.approx(0.1)


def test_a_full_step_must_keep_a_quarter_of_its_promise():
    assert not Damping().helps(0.2)
    assert Damping().helps(0.3)
    assert Damping(value=0.1).helps(0.01)
    assert not Damping(value=0.1).helps(gain(1.0, 0.0))  # nothing was promised
