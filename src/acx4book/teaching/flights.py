"""Flights of students: seeds from name, sheet and the lecturer's secret key."""

from __future__ import annotations

import hmac
import tempfile
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from acx4files.flight.problems import lines_of, quoted
from acx4files.flight.reader import Flight, read
from acx4files.flight.table_files import read_bytes
from acx4files.flight.tables import name_fault
from acx4files.results.whole_files import naming
from acx4lib.block import Block
from acx4lib.errors import FlightError
from acx4sim.designs import single_head_plan
from acx4sim.files import SimulatedFlight, simulate_plan, write_files
from acx4sim.optics import Camera
from acx4sim.plan import Options, Plan, Strip, layout

SHORTEST_KEY = 32
"""Bytes. A short key could be found by trying: simulate, and compare with the flight."""

LONGEST_FOLDER = 50
"""Characters of a name that go into the name of a folder."""

MAKE_A_KEY = "python3 -c 'import secrets; print(secrets.token_hex(32))' > FILE"


def read_key(path: Path) -> bytes:
    """Return the lecturer's key; white space around it does not count.

    Raises
    ------
    FlightError
        Where the file cannot be read, or the key is too short.
    """
    data, problems = read_bytes(path, str(path), needed_by="every flight's seed")
    if problems:
        raise FlightError([f"{lines_of(problems)[0]}; make a key by {MAKE_A_KEY}"])
    key = data.strip()
    if len(key) < SHORTEST_KEY:
        says = f"holds a key of {len(key)} bytes, which could be guessed; at least {SHORTEST_KEY}"
        raise FlightError([f"{path}: {says}: make one by {MAKE_A_KEY}"])
    return key


def shown_name(name: str) -> str:
    """Return a name in its normal form: composed letters, single spaces.

    Raises
    ------
    ValueError
        Where it is empty or not valid as a name.
    """
    shown = " ".join(unicodedata.normalize("NFC", name).split())
    fault = name_fault(shown) if shown else ("is empty", "must be a name")
    if fault:
        msg = f"the student's name {fault[0]}; {fault[1]}"
        raise ValueError(msg)
    return shown


def same_name(name: str) -> str:
    """Return a key of a name, the same for all spellings: case and spaces do not count."""
    return unicodedata.normalize("NFC", shown_name(name).casefold())


def seed(key: bytes, *, sheet: str, student: str, purpose: str) -> int:
    """Return a seed of 256 bits: HMAC-SHA256 of purpose, sheet and name.

    Parameters
    ----------
    key : bytes
    sheet, student : str
    purpose : str
        Seeds of different purposes are unrelated.
    """
    message = "\0".join((purpose, sheet, same_name(student))).encode()
    return int.from_bytes(hmac.digest(key, message, "sha256"), "big")


def folder_name(sheet: str, student: str) -> str:
    """Return a name for the folder of a student's flight: letters, digits, hyphens."""
    kept = "".join(c if c.isalnum() else "-" for c in same_name(student))
    parts = [part for part in kept.split("-") if part]
    return "-".join([sheet, *parts])[: len(sheet) + 1 + LONGEST_FOLDER].rstrip("-")


def title(sheet: str, student: str) -> str:
    """Return the name of a student's flight, which is also in its results."""
    return f"{sheet}: {student}"


def of_title(name: str) -> tuple[str, str]:
    """Return sheet and student from the name of a flight; ValueError for any other name."""
    sheet, separator, student = name.partition(": ")
    if not separator or not sheet.startswith("lab-"):
        msg = f"{quoted(name)} is no flight of a lab sheet"
        raise ValueError(msg)
    return sheet, student


# --- Small flights for lab sheets: one camera over a village, its parameters drawn anew


LOW = Strip(n=5, height_m=300.0, base_m=60.0)
HIGH = Strip(n=5, height_m=500.0, base_m=100.0)

WHOLE = (
    LOW,
    replace(LOW, turn_deg=180.0),
    replace(HIGH, turn_deg=90.0),
    replace(HIGH, turn_deg=270.0),
)
"""Two opposite strips at each of two heights; the strips of the second height cross."""

PROOF = tuple(
    Strip(n=6, height_m=400.0, base_m=110.0, turn_deg=180.0 * (k % 2), left_m=200.0 * (1 - k))
    for k in range(3)
)
"""The independent block: three strips."""

ABOUT = {
    "boresight_deg": ((0.15, 0.25), (0.35, 0.5), (0.1, 0.3)),
    "lever_m": ((0.15, 0.25), (0.40, 0.50), (0.70, 0.90)),
}
"""Ranges of the drawn parameters, of either sign; they differ, so that swapped axes show."""

APPROXIMATE = {"focal_mm": 50.0, "mount_kappa_deg": 90.0}
"""Camera in flight.toml for sheets that calibrate it."""


def drawn_camera(seed: int) -> Camera:
    """Return the camera of one student: every parameter is drawn."""
    rng = np.random.default_rng([seed, *b"camera"])

    def either(low: float, high: float) -> float:
        return float(rng.choice([-1.0, 1.0]) * rng.uniform(low, high))

    angles, lever = (tuple(either(*size) for size in ABOUT[name]) for name in ABOUT)
    camera = single_head_plan().cameras["CAM"]
    drawn = {
        "f_mm": 50.0 + either(0.08, 0.2),
        "xp_mm": either(0.03, 0.06),
        "yp_mm": either(0.03, 0.06),
        "p1": either(2e-6, 4e-6),
        "p2": either(2e-6, 4e-6),
        "k1": float(rng.choice([-1.0, 1.0])) * camera.k1 * rng.uniform(0.8, 1.2),
    }
    inner: dict[str, Any] = {name: float(f"{value:.9g}") for name, value in drawn.items()}
    omega, phi, kappa = (round(angle, 7) for angle in angles)
    x, y, z = (round(value, 7) for value in lever)
    return replace(
        camera, **inner, boresight_deg=(omega, phi, round(90.0 + kappa, 7)), lever_m=(x, y, z)
    )


def certificate(camera: Camera) -> dict[str, float]:
    """Return all parameters of a known camera with their names in flight.toml."""
    named = {name: getattr(camera, name) for name in ("xp_mm", "yp_mm")}
    named |= {name: getattr(camera, name) for name in ("k1", "k2", "k3", "p1", "p2")}
    axes = ("omega", "phi", "kappa")
    named |= {f"mount_{a}_deg": v for a, v in zip(axes, camera.boresight_deg, strict=True)}
    named |= {f"lever_{a}_m": v for a, v in zip("xyz", camera.lever_m, strict=True)}
    return {"focal_mm": camera.f_mm, **named}


def fly(
    seed: int,
    title: str,
    camera: Camera,
    strips: Sequence[Strip],
    *,
    known: Mapping[str, float] = APPROXIMATE,
    proof: Sequence[Strip] = (),
    options: Options = Options(),  # noqa: B008 frozen
) -> SimulatedFlight:
    """Simulate a small flight.

    Parameters
    ----------
    seed : int
        Seed of trajectory and errors.
    title : str
        Name of the flight.
    camera : Camera
        The true one.
    strips : sequence of Strip
        Of the calibration block.
    known : mapping of str to float
        The camera in flight.toml.
    proof : sequence of Strip
        Of the validation block; there is none without strips.
    options : Options
    """
    return simulate_plan(_plan(title, camera, strips, known, proof), seed, options)


def _plan(
    title: str,
    camera: Camera,
    strips: Sequence[Strip],
    known: Mapping[str, float],
    proof: Sequence[Strip],
) -> Plan:
    plan = single_head_plan()
    calibration = replace(
        plan.blocks["calibration"],
        strips=tuple(strips),
        tie_points=150,
        tie_area_m=(220.0, 220.0),
    )
    validation = replace(
        plan.blocks["validation"],
        strips=tuple(proof),
        targets=layout(5, 4, (220.0, 260.0), 30.0),
    )
    return replace(
        plan,
        name="lab",
        draws="lab",
        title=title,
        cameras={"CAM": camera},
        approximate={"CAM": dict(known)},
        control=layout(4, 3, (130.0, 115.0), 15.0),
        blocks={"calibration": calibration, **({"validation": validation} if proof else {})},
    )


def flight_of(sheet: Sheet, student: str, key: bytes) -> SimulatedFlight:
    """Return the flight of a student; the same name and key give the same bytes."""
    truth, errors = (
        seed(key, sheet=sheet.name, student=student, purpose=purpose)
        for purpose in ("truth", "errors")
    )
    return sheet.fly(truth, errors, title(sheet.name, shown_name(student)))


def case_of(flight: SimulatedFlight) -> Case:
    """Return a flight as read from its student's files, with its truth."""
    with tempfile.TemporaryDirectory(prefix="acx4-lab-") as temporary:
        folder = Path(temporary) / "flight"
        with naming(folder):
            write_files(flight, folder)
        return Case(read(folder), flight.truth)


# --- What a lab sheet is: a flight, questions, right answers, and what mistakes would give


K = 4.0
"""Largest distance of a right answer from the truth, in standard deviations."""


@dataclass(frozen=True, kw_only=True)
class Question:
    """A question with a number as answer.

    Attributes
    ----------
    name : str
        Name in answers.csv; ends with the unit if there is one.
    unit : str
    asks : str
        The question in words.
    digits : int
        Digits after the decimal point.
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
        Right solution for the flight.
    truth : float
        Simulated value; `value` if the answer follows from the given numbers alone.
    bound : float
        Largest accepted distance from the truth.
    sigma : float, optional
        Standard deviation of `value`.
    """

    value: float
    truth: float
    bound: float
    sigma: float | None = None


def computed(value: float, digits: int, *, share: float = 0.0) -> Right:
    """Return an answer computed from given numbers; its last digit may differ by one.

    The bound counts from the rounded value.

    Parameters
    ----------
    value : float
    digits : int
        After the decimal point.
    share : float
        Accepted relative difference, if this is more.
    """
    bound = max(1.01 * 10.0**-digits, share * abs(value))
    return Right(value=value, truth=round(value, digits), bound=bound)


def estimated(value: float, sigma: float, truth: float) -> Right:
    """Return an answer estimated from observations.

    The bound is `K` sigma from the truth, or the distance of the right solution plus one sigma if
    this is more.
    """
    bound = max(K * sigma, abs(value - truth) + sigma)
    return Right(value=value, truth=truth, bound=bound, sigma=sigma)


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """A common mistake, and its wrong answers on one flight.

    Attributes
    ----------
    says : str
        Sentence on the mistake and its cure.
    gives : mapping of str to float
        Wrong values by question.
    gives_sigma : mapping of str to float
        Wrong standard deviations by question.
    scale : float
        Factor from the right numbers to the wrong ones; their bounds grow by it.
    """

    says: str
    gives: Mapping[str, float] = field(default_factory=dict)
    gives_sigma: Mapping[str, float] = field(default_factory=dict)
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class Case:
    """One student's flight, with its truth."""

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
        ``lab-1`` to ``lab-9``, and the title.
    fly : callable
        Simulates the flight from two seeds, of truth and errors, and its title.
    questions : tuple of Question
    given : callable
        Returns the lines for the student on the flight: which image, which point.
    solve : callable
        Returns the right answers.
    mistakes : callable
        Yields the common mistakes with their answers on this flight.
    hand_out : callable, optional
        Returns the text files, by name, handed out instead of the flight.
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
        """Return a question by its name; None if unknown."""
        return next((question for question in self.questions if question.name == name), None)
