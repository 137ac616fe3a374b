"""What a lab sheet is: a flight, questions, right answers, and what mistakes would give."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4sim.files.flights import SimulatedFlight

K = 4.0
"""Number of standard deviations that a right answer may lie from the truth."""


@dataclass(frozen=True, kw_only=True)
class Question:
    """A number that is handed in.

    Attributes
    ----------
    name : str
        In answers.csv; ends with the unit where it has one.
    unit : str
    asks : str
        The question in words.
    digits : int
        Digits after the decimal point that are asked for.
    with_sigma : bool
        Whether its standard deviation is asked for, too.
    """

    name: str
    unit: str
    asks: str
    digits: int
    with_sigma: bool = False


@dataclass(frozen=True, kw_only=True)
class Right:
    """The right answer to a question.

    Attributes
    ----------
    value : float
        What the flight gives where it is solved rightly.
    truth : float
        What was simulated; `value` where the answer follows from the given numbers alone.
    bound : float
        Largest distance from the truth that is accepted.
    sigma : float, optional
        Standard deviation of `value`.
    """

    value: float
    truth: float
    bound: float
    sigma: float | None = None


def computed(value: float, digits: int, *, share: float = 0.0) -> Right:
    """Return an answer that follows from given numbers: the last digit may differ by one.

    It is counted from the rounded value.

    Parameters
    ----------
    value : float
    digits : int
        After the decimal point.
    share : float
        Part of the value that it may differ by, where this is more.
    """
    bound = max(1.01 * 10.0**-digits, share * abs(value))
    return Right(value=value, truth=round(value, digits), bound=bound)


def estimated(value: float, sigma: float, truth: float) -> Right:
    """Return an answer that was estimated from observations.

    It may lie `K` sigma from the truth. Where the flight's own errors bring the best solution
    farther away, that and one sigma more.
    """
    bound = max(K * sigma, abs(value - truth) + sigma)
    return Right(value=value, truth=truth, bound=bound, sigma=sigma)


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """A common mistake, and the wrong answers to which it leads on one flight.

    Attributes
    ----------
    says : str
        What was done, and what cures it.
    gives : mapping of str to float
        Wrong values by question.
    gives_sigma : mapping of str to float
        Wrong standard deviations by question.
    scale : float
        How much larger the numbers are than the right ones: so much larger are their digits.
    """

    says: str
    gives: Mapping[str, float] = field(default_factory=dict)
    gives_sigma: Mapping[str, float] = field(default_factory=dict)
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class Case:
    """One student's flight, with its truth.

    Attributes
    ----------
    flight : Flight
    truth : mapping
    """

    flight: Flight
    truth: Mapping[str, Any]

    @cached_property
    def block(self) -> Block:
        """The calibration block."""
        return self.flight.block("calibration")

    @cached_property
    def true_camera(self) -> Mapping[str, float]:
        """True parameters of the camera, named as in parameters.csv."""
        camera: Mapping[str, float] = self.truth["cameras"]["CAM"]
        return camera


Rights = Mapping[str, Right]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """A lab sheet.

    Attributes
    ----------
    name, title : str
        ``lab-1`` to ``lab-9``, and what it is on.
    fly : callable
        Makes the flight of two seeds, that of the truth and that of the errors.
    questions : tuple of Question
    given : callable
        Returns what a student is told of the own flight: which image, which point.
    solve : callable
        Returns the right answers.
    mistakes : callable
        Yields what the common mistakes would give on this flight.
    hand_out : callable, optional
        Returns text files, by their names, that a student gets in the place of the flight.
    """

    name: str
    title: str
    fly: Callable[[int, int, str], SimulatedFlight]
    questions: tuple[Question, ...]
    given: Callable[[Case], Sequence[str]]
    solve: Callable[[Case], Rights]
    mistakes: Callable[[Case, Rights], Iterable[Mistake]]
    hand_out: Callable[[Case], Mapping[str, str]] | None = None

    def question(self, name: str) -> Question | None:
        """Return the question of a name; None for an unknown one."""
        return next((one for one in self.questions if one.name == name), None)
