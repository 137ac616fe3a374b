"""Which head took a picture, and how the heads of a rig are turned to each other.

`RigRelatives` of MicaSense are three angles of every head to its reference. The vendor's own
software makes Rx(a) Ry(b) Rz(c) of them. This matrix turns a ray of the *head* into the reference:
the pixels say so (chapter on ten real heads). Camera axes there have y down and z ahead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from acx4lib.expected import Array
from acx4tools.exchange.lens import FLIP
from acx4tools.exchange.pictures.tags import Tags

RELATIVES, REFERENCE = "Camera:RigRelatives", "Camera:RigRelativesReferenceRigCameraIndex"
INDEX, BAND = "Camera:RigCameraIndex", "Camera:BandName"

DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""R_b_c of a camera that looks straight down and whose top of the image is ahead."""


@dataclass(frozen=True, kw_only=True)
class Head:
    """One head of a camera.

    Attributes
    ----------
    name : str
        Number and band: ``2 Green``; of a camera without bands, its model.
    index : int
        Its number in the rig; -1 where it has none.
    reference : int or None
        Number of the head to which its angles are; None where it has none.
    relatives_deg : tuple of float
        Its angles a, b, c; none where it has none.
    """

    name: str
    index: int
    reference: int | None
    relatives_deg: tuple[float, ...]


def head_of(tags: Tags) -> Head:
    """Return the head that took a picture.

    Raises
    ------
    FlightError
        Where numbers in the metadata are none.
    """
    found, reference = tags.number(INDEX), tags.number(REFERENCE)
    index, band = -1 if found is None else int(found), tags.text(BAND, "drone-dji:BandName")
    model = tags.text("Model", "Make") or "camera"
    relatives = tags.numbers(RELATIVES, 3)
    name = " ".join(filter(None, [str(index + 1) if index >= 0 else "", band])) or model
    return Head(
        name=name,
        index=index,
        reference=int(reference) if relatives and reference is not None else None,
        relatives_deg=relatives,
    )


def rotation(relatives_deg: Sequence[float]) -> Array:
    """Return R_ref_h of a head, the library's axes: from the head's to those of its reference.

    Parameters
    ----------
    relatives_deg : sequence of float
        `RigRelatives`: a, b, c.
    """
    flip = np.diag([*FLIP, -1.0])
    turned = Rotation.from_euler("XYZ", relatives_deg, degrees=True).as_matrix()
    return np.asarray(flip @ turned @ flip)


def in_order(heads: Sequence[Head]) -> list[Head]:
    """Return the heads, first the one that is the reference of most; without angles, the first.

    Parameters
    ----------
    heads : sequence of Head
    """
    sorted_heads = sorted(heads, key=lambda head: (head.index, head.name))
    named = [head.reference for head in heads if head.reference is not None]
    first = next((h for h in sorted_heads if named and h.index == named[0]), sorted_heads[0])
    return [first, *(head for head in sorted_heads if head is not first)]


def mountings(heads: Sequence[Head]) -> Mapping[str, Array]:
    """Return R_b_c of every head: looking down, the top of the image ahead, by its angles."""
    turned = {
        head.name: DOWN @ rotation(head.relatives_deg) if head.relatives_deg else DOWN
        for head in heads
    }
    return {name: np.asarray(R) for name, R in turned.items()}


def sentence(heads: Sequence[Head]) -> str:
    """Return what was assumed of the heads' rotations."""
    names = {head.index: head.name for head in heads}
    references = dict.fromkeys(h.reference for h in heads if h.reference is not None)
    if not references:
        return "the heads look in one direction: the metadata have no RigRelatives"
    said = (
        "RigRelatives a, b, c are degrees; Rx(a) Ry(b) Rz(c) turns a ray of a head into its "
        f"reference, {' or '.join(names.get(r, f'head {r}') for r in references)}; y down, z ahead"
    )
    if len(references) > 1:
        said += "; no angles join the rigs, whose references look in one direction at first"
    return said
