"""The synthetic images of a block that is measured in heads: one for each exposure, by its name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4lib import expected
from acx4lib.expected import Index
from acx4lib.flight.block import Block, Images
from acx4lib.geometry.camera import Camera


def synthetic_images(block: Block, synthetic: Camera) -> Block:
    """Return a block's synthetic images, without measurements.

    Parameters
    ----------
    block : Block
        Measured in heads.
    synthetic : Camera
        The only camera of the result.

    Returns
    -------
    Block
        Images are in the order of the exposures' first images, and have their strips. Points,
        control and trajectory are those of `block`.
    """
    expected.instance("block", block, Block)
    expected.instance("synthetic", synthetic, Camera)
    first = first_images(block)
    exposures = np.argsort(first, kind="stable")[: int(np.sum(first < len(block.images)))]
    return replace(
        block,
        cameras=(synthetic,),
        images=Images(
            names=tuple(block.trajectory.exposures[i] for i in exposures),
            camera_idx=np.zeros(len(exposures), dtype=np.intp),
            exposure_idx=exposures,
            strips=tuple(block.images.strips[i] for i in first[exposures]),
        ),
        image_points=block.image_points[np.zeros(0, dtype=np.intp)],
    )


def first_images(block: Block) -> Index:
    """Return the first image of every exposure, shape (n_exposures,); n_images for none."""
    first = np.full(len(block.trajectory), len(block.images))
    np.minimum.at(first, block.images.exposure_idx, np.arange(len(block.images)))
    return first
