from acx4tools.measuring.surveyed.votes import Candidate, elected


def spot(point, view, east, *, radius=0.3, bright=True, correlation=0.9):
    return Candidate(
        point=point,
        view=view,
        at_m=(100.0 * point, 0.0),
        offset_m=(east, 0.0),
        pixel_m=0.2,
        radius_m=radius,
        bright=bright,
        correlation=correlation,
        colrow=(1.0, 2.0),
        sigma_px=0.02,
    )


def test_a_target_is_off_alike_in_all_pictures_and_at_other_points():
    true = [spot(point, view, 0.5) for view in range(3) for point in range(3)]
    false = [spot(0, 0, 3.0, correlation=0.99), spot(0, 1, -2.0), spot(0, 2, 5.0)]
    assert elected([*false, *true]) == true


def test_a_bright_stone_is_in_all_pictures_but_not_beside_every_point():
    stone = [spot(0, view, 2.5, correlation=0.99) for view in range(4)]
    true = [spot(point, view, 0.5) for view in range(2) for point in range(4)]
    assert elected([*stone, *true]) == true


def test_a_spot_of_another_size_or_brightness_gives_no_vote():
    assert elected([spot(0, 0, 0.5), spot(0, 1, 0.5, radius=0.9)]) == []
    assert elected([spot(0, 0, 0.5), spot(0, 1, 0.5, bright=False)]) == []


def test_a_point_in_one_picture_needs_others_beside_it():
    far = [spot(3, 1, 9.0), spot(4, 1, -9.0)]
    assert elected([spot(0, 0, 0.5), spot(1, 1, 0.6), *far]) == []
    assert len(elected([spot(0, 0, 0.5), *(spot(k, 1, 0.6) for k in (1, 2)), *far])) == 3


def test_two_stones_that_agree_are_not_beside_the_others():
    true = [spot(point, view, 0.5) for view in range(2) for point in range(6)]
    stones = [spot(point, view, 7.0) for view in range(2) for point in (6, 7, 8)]
    assert elected([*true, *stones]) == true


def test_nobody_is_elected_without_candidates():
    assert elected([]) == []
