"""What is said of a flight in sentences."""

from dataclasses import replace

from acx4book.chapters.flight import sentences


def test_notes_are_a_list(flight):
    assert sentences.notes(replace(flight, notes=("one", "two"))) == "- one\n- two"
    assert "Nothing" in sentences.notes(replace(flight, notes=()))


def test_directions_are_said(flight):
    assert "in one direction only" in sentences.directions(flight)


def test_a_flight_without_surveyed_points_has_no_height_above_ground(without_ground):
    said = sentences.directions(without_ground)
    assert said.startswith("*heads*: height above ground not known, flown in ")


def test_the_answer_names_each_block_and_what_it_is_for(flight):
    heads = flight.heads
    said = sentences.answer(flight)
    assert said.startswith(f"One block, which holds {len(heads.image_points)} measured image ")
    assert "31 images of each head over 56 control points, from 2597 and 1596 m" in said


def test_a_block_of_one_direction_is_said_to_hide_the_lever_arm_in_the_principal_point(flight):
    """The block of the heads is flown at two heights, one way."""
    said = sentences.answer(replace(flight, blocks={"calibration": flight.heads}))
    assert "at two heights, flown in one direction only over 56 control points" in said
    assert "principal point and the lever arm in plan can hardly be told apart" in said
