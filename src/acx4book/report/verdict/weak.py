"""Parameters that are determined, but weakly."""

from __future__ import annotations

from collections.abc import Iterator

from acx4book.report.material import Material, sentences, validated
from acx4book.report.verdict.finding import NOTE, Finding


def weak(material: Material) -> Iterator[Finding]:
    """Name the weak parameters of the calibration: why, and what would determine them."""
    names = (*material.decisive, validated(material))
    found = [
        line.partition(": ")[2]
        for line in sentences(material, "weak")
        if line.startswith(tuple(f"{name}: " for name in names))
    ]
    if found:
        answer = "; ".join(dict.fromkeys(found)) + "."
        yield Finding(question="Weak parameters", state=NOTE, answer=answer)
