"""What a plan determines, as lines of text for the screen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pandas as pd

from acx4lib.calibration.trust import determination
from acx4lib.flight.block import Block
from acx4lib.georeferencing import budget
from acx4lib.planning import tables
from acx4lib.planning.design import Design
from acx4lib.planning.exposures import flying_time_s
from acx4lib.planning.plan import PlannedBlock

SAID = {
    "image_point": "image points",
    "control_point": "control points",
    "gnss": "GNSS positions",
    "attitude": "attitudes",
    "lever_arm": "surveyed lever arm",
    "boresight": "declared boresight",
    "distance": "distances",
}
"""Names of the groups of observations."""


def lines(design: Design) -> Iterator[str]:
    """Yield the lines that `acx4 plan` prints."""
    n = len(design.outcomes)
    over = f"the mean of {n} winds" if n > 1 else "one wind"
    yield f"{design.plan.setup.name}: predicted from geometry alone, sigma0 = 1, {over}"
    for name, block in design.plan.blocks.items():
        yield from _block_lines(block, design.blocks[name])
    parameters, reliability = tables.parameter_table(design), tables.reliability_table(design)
    for method in design.mountings:
        yield from _method_lines(design, method, parameters[parameters["method"] == method])
        yield ""
        yield from _reliability_lines(reliability[reliability["method"] == method])
    yield from _validation_lines(design)
    for title, found in (
        ("notes", tables.notes(design)),
        ("not determined", tables.sentences(design)),
        ("weak", tables.weak_sentences(design)),
    ):
        if found:
            yield from ("", title, *(f"  {line}" for line in found))


def _block_lines(planned: PlannedBlock, block: Block) -> Iterator[str]:
    minutes = flying_time_s(tuple(planned.strips.values())) / 60
    yield ""
    yield f"block {planned.name}"
    yield (
        f"  {len(block.images)} images in {len(planned.strips)} strips, {minutes:.0f} minutes from "
        "the first to the last"
    )
    points = f"{len(block.control)} control points, {len(block.check)} check points"
    yield f"  {len(block.image_points)} measurements of {len(block.points)} points; {points}"


def _method_lines(design: Design, method: str, table: pd.DataFrame) -> Iterator[str]:
    bundle = design.mountings[method].bundle
    yield ""
    yield f"mounting/{method}"
    yield from _aligned(
        ("", "sigma", "change found", "unit", "correlation", "with"),
        [
            (
                _name(row["camera"], row["parameter"]),
                f"{row['sigma']:.3g}" + ("" if row["determined"] else " !"),
                f"{row['detectable_change']:.2g}",
                row["unit"],
                f"{round(row['correlation'], 2) + 0.0:+.2f}",
                row["correlated_with"],
            )
            for row in table.to_dict("records")
        ],
    )
    weakest = determination.weakest_combination(bundle)
    parts = ", ".join(f"{part.unknown} {100 * part.share:.0f} %" for part in weakest)
    yield f"  weakest direction: {parts or 'several are left open altogether'}"


def _name(camera: str, parameter: str) -> str:
    return f"{camera} {parameter}" if camera else parameter


def _reliability_lines(table: pd.DataFrame) -> Iterator[str]:
    """Yield the errors that tests find with a probability of 80 %, and what smaller ones do."""
    rows = []
    for row in table.to_dict("records"):
        axis, _, unit = row["component"].rpartition("_")
        rows.append(
            (
                f"{SAID[row['kind']]}, {axis}",
                f"{row['redundancy_median']:.2f}",
                f"{row['detectable_median']:.2g}",
                f"{row['detectable_largest']:.2g}",
                unit,
                f"{row['effect_sigmas']:.2f}",
                row["effect_on"],
            )
        )
    header = ("error of", "redundancy", "found from", "at worst", "unit", "moves by sigma", "of")
    yield from _aligned(header, rows)


def _validation_lines(design: Design) -> Iterator[str]:
    """Yield the RMS of check points in metres, what it is worth, and the shares of its sources."""
    for method in design.validations:
        yield ""
        yield f"validation/{method}: predicted RMS of differences at check points, m"
        rows = []
        for what, found in tables.expected_rms(design, method).items():
            rows.append((f"{found.n:.0f} {what}", *(f"{value:.3f}" for value in found.rms)))
            if len(found.of_winds) > 1:
                rows.append(("  of many flights, within", *(f"{x:.0%}" for x in found.tolerance)))
                rows.append(("  of one flight, by its wind", *(f"{x:.0%}" for x in found.spread)))
            for group, share in budget.shares(found.variance).items():
                rows.append((f"  of its square, {group}", *(f"{x:.0%}" for x in share)))
        yield from _aligned(("", "east", "north", "height"), rows)


def _aligned(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Yield a table with its first and last columns to the left if they are text."""
    whole = [header, *rows]
    widths = [max(len(row[k]) for row in whole) for k in range(len(header))]
    numeric = [all(_is_number(row[k]) for row in rows) for k in range(len(header))]
    for row in whole:
        cells = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        )
        yield f"  {'  '.join(cells)}".rstrip()


def _is_number(cell: str) -> bool:
    try:
        float(cell.removesuffix(" !").removesuffix("%"))
    except ValueError:
        return False
    return True
