"""Every planted mistake in every size and form of flight, and clean flights: what check says.

PYTHONPATH=tests python -m benchmarks.planted_mistakes --clean 200
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from itertools import cycle, islice, product
from pathlib import Path

from acx4files.conventions import best_reading
from acx4files.flight.reader import read
from acx4lib.errors import FlightError
from support.flights import planted

VARIANTS = list(product(planted.DESIGNS, planted.SIZES, planted.FORMS))


def main() -> None:
    """Print what is not named rightly, and how much is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clean", type=int, default=200, help="clean flights")
    n_clean = parser.parse_args().clean
    tried = [(case, case_is_right(*case)) for case in cases()]
    for size in planted.SIZES:
        right = [is_right for (_, own, _, _), is_right in tried if own == size]
        tell(f"{size}: {sum(right)} of {len(right)} named rightly, or rightly silent")
    flights = enumerate(islice(cycle(VARIANTS), n_clean), 1)
    raised = [
        said(planted.clean(design, form, size, seed=seed), None)
        for seed, (design, size, form) in flights
    ]
    tell(
        f"{sum(map(bool, raised))} of {n_clean} clean flights got a sentence", *filter(None, raised)
    )


def cases() -> Iterator[tuple[str, str, str, str]]:
    """Yield design, size, form and mistake."""
    for design, size, form in VARIANTS:
        for name, mistake in planted.MISTAKES.items():
            if form in mistake.forms:
                yield design, size, form, name


def case_is_right(design: str, size: str, form: str, name: str) -> bool:
    """Tell whether a mistake is named rightly, and print what is said if not."""
    mistake = planted.MISTAKES[name]
    message = said(planted.clean(design, form, size), mistake)
    is_right = planted.is_right(mistake, form, message)
    if not is_right:
        tell(f"{design}, {size}, {form}: {name}: {message or 'nothing'}")
    return is_right


def tell(*lines: str) -> None:
    """Print lines at once."""
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    sys.stdout.flush()


def said(flight: planted.SimulatedFlight, mistake: planted.Mistake | None) -> str:
    """Return what `acx4 check` says of the calibration block."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            found = best_reading(
                read(planted.write(flight, Path(folder) / "flight", mistake)), "calibration"
            )
        except FlightError as error:
            return str(error)
    return found.sentence if found else ""


if __name__ == "__main__":
    main()
