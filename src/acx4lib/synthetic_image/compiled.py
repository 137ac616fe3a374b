"""Pixels sampled and blended, compiled: what `rendering` asks for.

`resample_cells` goes through a grid column by column, all bands of a pixel at a time, with the
weights of the heads that see each cell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from acx4lib.compiling import compiled, uncounted, uncounted_inlined
from acx4lib.expected import Array, Index

# --- pixels interpolated and written, all bands at once ---------------------------------------
#
# The compiler does not make these instructions by itself. A pixel and its right neighbour are
# neighbours in memory, with all their bands. One instruction loads or computes both.


MOST_BANDS = 4
SHOULDER = 4.0  # slope of equalised grey values over those just below saturation
LANES = 16

_EMIT: Any = cgutils  # it has no types, nor has `intrinsic`
_emitted: Callable[[Callable[..., Any]], Callable[..., Any]] = intrinsic

_INT, _WIDE, _FLOAT = ir.IntType(32), ir.IntType(64), ir.FloatType()
_FAST = ("contract", "nsz")
_CLAMP = ("nnan", "nsz")
_METHODS = tuple(
    (bits, bands, taps) for taps in (2, 4) for bits in (8, 16) for bands in range(1, MOST_BANDS + 1)
)
_CATMULL_ROM = ((0, 1, 0, 0), (-0.5, 0, 0.5, 0), (1, -2.5, 2, -0.5), (-0.5, 1.5, -1.5, 0.5))


def method_number(bits: int, bands: int, *, cubic: bool) -> int:
    """Return the number that tells `_sample_line` the bits, the bands and the interpolation."""
    return _METHODS.index((bits, bands, 4 if cubic else 2))


@_emitted
def _sample_line(
    _typing: Any,
    method: Any,
    n: Any,  # noqa: ARG001
    image: Any,
    start: Any,
    growth: Any,
    scratch: Any,
    out: Any,
) -> Any:
    """Read n samples: ``_sample_line(method, n, image, start, growth, scratch, out)``.

    `method` is a `method_number`. `image` is the address of a pixel, the bytes from row to row,
    and those from pixel to pixel. `start` is the position of the first sample relative to that
    pixel, `growth` the step to the next one, both col and row, px; no sample may lie left of the
    pixel or above it. `scratch` are arrays of int32, float32 and float32 for n numbers, rounded
    up to 16. `out` is an array of float32, the index of the first sample in it, and the distance
    of samples; each is written as four numbers, of which those beyond the bands mean nothing.
    Of each row 8 numbers are read, 16 for a cubic method, whatever the number of bands.
    """
    signature = types.void(method, types.int64, image, start, growth, scratch, out)

    def generate(context: Any, builder: ir.IRBuilder, typed: Any, values: Any) -> Any:
        n = values[1]
        address, row, pixel = _EMIT.unpack_tuple(builder, values[2], 3)
        arrays = zip(typed.args[5].types, _EMIT.unpack_tuple(builder, values[5], 3), strict=True)
        places = [context.make_array(kind)(context, builder, one).data for kind, one in arrays]
        array, first, step = _EMIT.unpack_tuple(builder, values[6], 3)
        target = context.make_array(typed.args[6].types[0])(context, builder, array).data
        target = builder.gep(target, [first])
        motion = [_EMIT.unpack_tuple(builder, values[k], 2) for k in (3, 4)]
        _find_places(builder, n, motion, (row, pixel), places)
        end = builder.append_basic_block("sampled")
        switch = builder.switch(values[0], end)
        for number, (bits, bands, taps) in enumerate(_METHODS):
            switch.add_case(number, builder.append_basic_block(f"method{number}"))
            builder.position_at_end(switch.cases[-1][1])
            read = _bilinear if taps == 2 else _cubic
            with _EMIT.for_range(builder, n) as loop:
                offset, *shares = (builder.load(builder.gep(p, [loop.index])) for p in places)
                place = builder.add(address, builder.sext(offset, _WIDE))
                sample = read(builder, bits, bands, (place, row), shares)
                place = builder.gep(target, [builder.mul(loop.index, step)])
                _store(builder, sample, place, 4)
            builder.branch(end)
        builder.position_at_end(end)
        return context.get_dummy_value()

    return signature, generate


def _find_places(
    builder: ir.IRBuilder, n: Any, motion: Any, strides: tuple[Any, Any], places: list[Any]
) -> None:
    """Emit, for a line of samples, the byte offset of the pixel before each, and the fractions."""
    (x_0, y_0), (dx, dy) = motion
    row, pixel = (_splat(builder, builder.trunc(stride, _INT), LANES) for stride in strides)
    counting = ir.Constant(ir.VectorType(_FLOAT, LANES), [float(k) for k in range(LANES)])
    groups = builder.udiv(builder.add(n, _wide(LANES - 1)), _wide(LANES))
    with _EMIT.for_range(builder, groups) as loop:
        at = builder.mul(loop.index, _wide(LANES))
        number = builder.fadd(_splat(builder, builder.sitofp(at, _FLOAT), LANES), counting)
        whole, shares = [], []
        for start, growth in ((x_0, dx), (y_0, dy)):
            way = builder.fmul(number, _splat(builder, growth, LANES), flags=_FAST)
            place = builder.fadd(_splat(builder, start, LANES), way, flags=_FAST)
            whole.append(builder.fptosi(place, ir.VectorType(_INT, LANES)))
            shares.append(builder.fsub(place, builder.sitofp(whole[-1], place.type)))
        offset = builder.add(builder.mul(whole[0], pixel), builder.mul(whole[1], row))
        for numbers, to in zip((offset, *shares), places, strict=True):
            _store(builder, numbers, builder.gep(to, [at]), 4)


@_emitted
def _read_number(_typing: Any, bits: Any, address: Any) -> Any:
    """Return a number of an image as a float: ``_read_number(bits, address)``."""

    def generate(_context: Any, builder: ir.IRBuilder, _typed: Any, values: Any) -> Any:
        wide = builder.icmp_unsigned("==", values[0], ir.Constant(values[0].type, 16))
        with builder.if_else(wide) as (then, otherwise):
            with then:
                long, after_long = _row(builder, values[1], 16, 1), builder.block
            with otherwise:
                short, after_short = _row(builder, values[1], 8, 1), builder.block
        number = builder.phi(long.type)
        number.add_incoming(long, after_long)
        number.add_incoming(short, after_short)
        return builder.extract_element(number, ir.Constant(_INT, 0))

    return types.float32(bits, address), generate


@_emitted
def _write_line(
    _typing: Any,
    bits: Any,
    n: Any,  # noqa: ARG001
    line: Any,
    factors: Any,
    height: Any,  # noqa: ARG001
    address: Any,
) -> Any:
    """Write n numbers to an image: ``_write_line(bits, n, line, factors, height, address)``.

    `line` is an array of float32 and the index of the first number in it. `factors` are an array
    of factors, an array that is added to them `height` times, and two numbers: the limit above
    which a sample is saturated, and the value of a saturated sample. Numbers of 8 or 16 bits are
    rounded to the nearest and clipped to their range; those of 32 bits are not changed.
    """
    signature = types.void(bits, types.int64, line, factors, types.float32, address)

    def generate(context: Any, builder: ir.IRBuilder, typed: Any, values: Any) -> Any:
        sources, full = _sources(context, builder, typed.args[2:4], values[2:4])
        end = builder.append_basic_block("written")
        switch = builder.switch(values[0], end)
        for size in (8, 16, 32):
            switch.add_case(size, builder.append_basic_block(f"bits{size}"))
            builder.position_at_end(switch.cases[-1][1])
            kind = _FLOAT if size == 32 else ir.IntType(size)
            target = builder.inttoptr(values[5], kind.as_pointer())
            groups = builder.udiv(values[1], _wide(LANES))
            done = builder.mul(groups, _wide(LANES))
            for lanes, start, stop in ((LANES, _wide(0), groups), (1, done, values[1])):
                with _EMIT.for_range(builder, builder.sub(stop, start)) as loop:
                    at = builder.add(start, builder.mul(loop.index, _wide(lanes)))
                    number = _equalised(
                        builder, [builder.gep(s, [at]) for s in sources], values[4], full, lanes
                    )
                    if size < 32:
                        number = _rounded(builder, number, size)
                    _store(builder, number, builder.gep(target, [at]), size // 8)
            builder.branch(end)
        builder.position_at_end(end)
        return context.get_dummy_value()

    return signature, generate


@_emitted
def _add_line(
    _typing: Any,
    n: Any,  # noqa: ARG001
    line: Any,
    factors: Any,
    height: Any,  # noqa: ARG001
    weights: Any,
    total: Any,
) -> Any:
    """Add n weighted numbers: ``_add_line(n, line, factors, height, weights, total)``.

    `line`, `factors` and `height` are those of `_write_line`. `weights` is an array, `total` an
    array and the index of the first number in it. Always whole groups of 16 are added.
    """
    signature = types.void(types.int64, line, factors, types.float32, weights, total)

    def generate(context: Any, builder: ir.IRBuilder, typed: Any, values: Any) -> Any:
        sources, full = _sources(context, builder, typed.args[1:3], values[1:3])
        weights = context.make_array(typed.args[4])(context, builder, values[4]).data
        out, first = _EMIT.unpack_tuple(builder, values[5], 2)
        target = context.make_array(typed.args[5].types[0])(context, builder, out).data
        target = builder.gep(target, [first])
        groups = builder.udiv(builder.add(values[0], _wide(LANES - 1)), _wide(LANES))
        with _EMIT.for_range(builder, groups) as loop:
            at = builder.mul(loop.index, _wide(LANES))
            number = _equalised(
                builder, [builder.gep(s, [at]) for s in sources], values[3], full, LANES
            )
            weight = _load(builder, builder.gep(weights, [at]), LANES)
            place = builder.gep(target, [at])
            part = builder.fmul(weight, number, flags=_FAST)
            _store(builder, builder.fadd(_load(builder, place, LANES), part, flags=_FAST), place, 4)
        return context.get_dummy_value()

    return signature, generate


def _sources(context: Any, builder: ir.IRBuilder, kinds: Any, values: Any) -> Any:
    """Emit the addresses of numbers and of their factors, and the limits of saturation."""
    line, first = _EMIT.unpack_tuple(builder, values[0], 2)
    *factors, full = _EMIT.unpack_tuple(builder, values[1], 3)
    types_of = (kinds[0].types[0], *kinds[1].types[:2])
    arrays = zip(types_of, (line, *factors), strict=True)
    numbers, *others = (
        context.make_array(kind)(context, builder, one).data for kind, one in arrays
    )
    return [builder.gep(numbers, [first]), *others], full


def _equalised(builder: ir.IRBuilder, places: list[Any], height: Any, full: Any, lanes: int) -> Any:
    """Emit numbers times their factors, which rise steeply to the largest value below it."""
    number, base, slope = (_load(builder, place, lanes) for place in places)
    growth = builder.fmul(_splat(builder, height, lanes), slope, flags=_FAST)
    product = builder.fmul(number, builder.fadd(base, growth, flags=_FAST), flags=_FAST)
    largest, less = (_splat(builder, one, lanes) for one in _EMIT.unpack_tuple(builder, full, 2))
    steep = builder.fmul(number, _filled(number.type, SHOULDER), flags=_FAST)
    steep = builder.fsub(steep, less, flags=_FAST)
    steep = builder.select(builder.fcmp_ordered("<", steep, largest), steep, largest)
    return builder.select(builder.fcmp_ordered("<", product, steep), steep, product)


def _rounded(builder: ir.IRBuilder, number: Any, bits: int) -> Any:
    """Emit the nearest whole numbers, clipped to the range of the bits."""
    low, high = _filled(number.type, 0.0), _filled(number.type, float(2**bits - 1))
    below = builder.fcmp_ordered("<", number, low, flags=_CLAMP)
    number = builder.select(below, low, number)
    above = builder.fcmp_ordered(">", number, high, flags=_CLAMP)
    number = builder.select(above, high, number)
    number = builder.fadd(number, _filled(number.type, 0.5))
    n = number.type.count
    whole = builder.fptosi(number, ir.VectorType(_INT, n))
    return builder.trunc(whole, ir.VectorType(ir.IntType(bits), n))


def _bilinear(
    builder: ir.IRBuilder, bits: int, bands: int, image: tuple[Any, Any], shares: Any
) -> Any:
    """Emit a sample between a pixel, its right neighbour and the two below."""
    place, row = image
    right, down = shares
    upper = _row(builder, place, bits, 8)
    lower = _row(builder, builder.add(place, row), bits, 8)
    pair = _between(builder, upper, lower, down)
    return _between(builder, _pixel(builder, pair, 0), _pixel(builder, pair, bands), right)


def _between(builder: ir.IRBuilder, one: Any, other: Any, share: Any) -> Any:
    way = builder.fsub(other, one, flags=_FAST)
    part = builder.fmul(_splat(builder, share, one.type.count), way, flags=_FAST)
    return builder.fadd(one, part, flags=_FAST)


def _cubic(
    builder: ir.IRBuilder, bits: int, bands: int, image: tuple[Any, Any], shares: Any
) -> Any:
    """Emit a sample in the middle of 4 x 4 pixels."""
    place, row = image
    right, down = (_catmull_rom(builder, share) for share in shares)
    place = builder.sub(builder.sub(place, row), ir.Constant(_WIDE, bands * bits // 8))
    rows = []
    for _ in range(4):
        rows.append(_row(builder, place, bits, 16))
        place = builder.add(place, row)
    column = _weighted(builder, rows, down)
    return _weighted(builder, [_pixel(builder, column, k * bands) for k in range(4)], right)


def _catmull_rom(builder: ir.IRBuilder, share: Any) -> Any:
    """Emit the weights of four pixels for a position between the two middle ones."""
    share = _splat(builder, share, 4)
    powers = [ir.Constant(share.type, [float(c) for c in row]) for row in _CATMULL_ROM]
    total = powers[3]
    for constant in powers[2::-1]:
        product = builder.fmul(total, share, flags=_FAST)
        total = builder.fadd(product, constant, flags=_FAST)
    return total


def _weighted(builder: ir.IRBuilder, vectors: list[Any], weights: Any) -> Any:
    total = None
    for k, vector in enumerate(vectors):
        weight = _lanes(builder, weights, [k] * vector.type.count)
        part = builder.fmul(weight, vector, flags=_FAST)
        total = part if total is None else builder.fadd(total, part, flags=_FAST)
    return total


def _row(builder: ir.IRBuilder, place: Any, bits: int, n: int) -> Any:
    """Emit n numbers of an image at an address, as floats."""
    kind = ir.VectorType(ir.IntType(bits), n)
    numbers = builder.load(builder.inttoptr(place, kind.as_pointer()))
    numbers.align = bits // 8
    wide = builder.zext(numbers, ir.VectorType(_INT, n))
    return builder.sitofp(wide, ir.VectorType(_FLOAT, n))


def _pixel(builder: ir.IRBuilder, vector: Any, first: int) -> Any:
    return _lanes(builder, vector, range(first, first + MOST_BANDS))


def _lanes(builder: ir.IRBuilder, vector: Any, lanes: Iterable[int]) -> Any:
    chosen = list(lanes)
    mask = ir.Constant(ir.VectorType(_INT, len(chosen)), chosen)
    return builder.shuffle_vector(vector, ir.Constant(vector.type, ir.Undefined), mask)


def _splat(builder: ir.IRBuilder, number: Any, n: int) -> Any:
    """Repeat a number in all lanes."""
    unset = ir.Constant(ir.VectorType(number.type, n), ir.Undefined)
    first = builder.insert_element(unset, number, ir.Constant(_INT, 0))
    return _lanes(builder, first, [0] * n)


def _filled(kind: ir.VectorType, number: float) -> Any:
    return ir.Constant(kind, [number] * kind.count)


def _wide(number: int) -> Any:
    return ir.Constant(_WIDE, number)


def _load(builder: ir.IRBuilder, place: Any, n: int) -> Any:
    kind = ir.VectorType(place.type.pointee, n)
    numbers = builder.load(builder.bitcast(place, kind.as_pointer()))
    numbers.align = 4
    return numbers


def _store(builder: ir.IRBuilder, numbers: Any, place: Any, align: int) -> None:
    stored = builder.store(numbers, builder.bitcast(place, numbers.type.as_pointer()))
    stored.align = align  # of a single number, as lines may begin anywhere


# --- heads that see a cell of the grid, and their weights -------------------------------------


MARGIN = 4  # px; at this distance from its border an image is read without a check
TALLEST = 1024  # px; number of rows of an image that can be reached from one position in it

_UNSEEN, _PARTLY, _AT_BORDER, _WITHIN = 0, 1, 2, 3


class Heads(NamedTuple):
    """The heads' images, and the positions of the nodes in them.

    Attributes
    ----------
    nodes : ndarray, shape (n_heads, cols, rows, 2)
        col, row, px; NaN where a head sees nothing. The nodes of a column are neighbours in
        memory, because cells are processed column by column.
    factors : ndarray of float32, shape (n_heads, cols, rows, bands) or (n_heads, 0, 0, bands)
        Factors of the images' numbers at the nodes.
    addresses : ndarray of int64, shape (n_heads,)
        Addresses of the images' first pixels.
    sizes : ndarray of int64, shape (n_heads, 2)
        Columns and rows of the images.
    """

    nodes: np.ndarray
    factors: np.ndarray
    addresses: np.ndarray
    sizes: np.ndarray


class Recipe(NamedTuple):
    """How the result is made from the images.

    Attributes
    ----------
    step : int
        Pixels from node to node.
    bands, bits : int
        Bands and bits per number of the images.
    out_bits : int
        Bits of the result; 32 makes it floats, NaN where no head sees.
    method : int
        An `method_number`.
    cubic : bool
    feather : float
        Width of the transition between heads, px; 0 for a seam.
    """

    step: int
    bands: int
    bits: int
    out_bits: int
    method: int
    cubic: bool
    feather: float


class Window(NamedTuple):
    """The part of the image to make, and the memory to write it to.

    Attributes
    ----------
    rows : tuple of int
        First row, and row after the last, counted from the first node.
    left, cells : int
        Numbers of columns of cells: left of the part, and in it.
    width : int
        Pixels of a row.
    address : int
        Address of the first row's first pixel.
    """

    rows: tuple[int, int]
    left: int
    cells: int
    width: int
    address: int


class Work(NamedTuple):
    """Working memory for one cell; lines of samples begin `line` numbers apart.

    Attributes
    ----------
    line : int
    block, total : ndarray of float32
        Samples of one head; weighted sum of all heads' samples.
    factors, unity : tuple of ndarray of float32, shape (line,)
        Factors of the first row of a cell, and their increase from row to row.
    spread : ndarray of float32, shape (line,)
        Weights of a row, one for each number.
    scratch : tuple of ndarray
        For `_sample_line`.
    weights : ndarray of float32, shape (n_heads, step * step)
    best, norm : ndarray of float32, shape (step * step,)
        The largest distance from a border, px; the sum of the weights.
    places : ndarray, shape (n_heads, 8)
        Position of a cell in a head: a corner (col, row), its change by column, row and both.
    kinds : ndarray of int64, shape (n_heads,)
        Whether a head sees the cell: `_UNSEEN` and so on.
    """

    line: int
    block: np.ndarray
    total: np.ndarray
    factors: tuple[np.ndarray, np.ndarray]
    unity: tuple[np.ndarray, np.ndarray]
    spread: np.ndarray
    scratch: tuple[np.ndarray, np.ndarray, np.ndarray]
    weights: np.ndarray
    best: np.ndarray
    norm: np.ndarray
    places: np.ndarray
    kinds: np.ndarray


def room(n_heads: int, step: int, bands: int) -> Work:
    """Return the working memory of one thread."""
    n = -(-step * bands // LANES) * LANES
    line = n + MOST_BANDS  # every sample is written as `MOST_BANDS` numbers
    n_scratch = -(-step // LANES) * LANES
    real = np.float32
    return Work(
        line,
        np.zeros(step * line, real),
        np.zeros(step * line, real),
        (np.ones(line, real), np.zeros(line, real)),
        (np.ones(line, real), np.zeros(line, real)),
        np.zeros(line, real),
        (np.zeros(n_scratch, np.int32), np.zeros(n_scratch, real), np.zeros(n_scratch, real)),
        np.zeros((n_heads, step * step), real),
        np.zeros(step * step, real),
        np.zeros(step * step, real),
        np.zeros((n_heads, 8)),
        np.zeros(n_heads, np.int64),
    )


@uncounted_inlined
def _find_heads(heads: Heads, recipe: Recipe, i: int, j: int, work: Work) -> int:
    """Set the weights of the heads in a cell; return the only one with weight, -1 for several."""
    n_used, only = 0, -1
    for k in range(len(heads.addresses)):
        work.kinds[k] = _place_cell(heads, k, i, j, recipe.step, work.places)
        if work.kinds[k] != _UNSEEN:
            n_used, only = n_used + 1, k
    if n_used == 1 and work.kinds[only] != _PARTLY:
        return only
    work.norm[:] = 0
    if n_used == 0:
        return -1
    return _weigh(heads.sizes, recipe, work)


@uncounted_inlined
def _place_cell(heads: Heads, k: int, i: int, j: int, step: int, places: np.ndarray) -> int:
    """Set the position of a cell in a head; return whether the head sees it."""
    width, height = heads.sizes[k, 0], heads.sizes[k, 1]
    left, right = _place_axis(heads.nodes, k, (i, j), 0, step, places)
    if not (right > -0.5 and left < width - 0.5):
        return _UNSEEN
    upper, lower = _place_axis(heads.nodes, k, (i, j), 1, step, places)
    if not (lower > -0.5 and upper < height - 0.5):
        return _UNSEEN
    if left < -0.5 or upper < -0.5 or right > width - 0.5 or lower > height - 0.5:
        return _PARTLY
    within = left >= MARGIN and right <= width - 1 - MARGIN
    within = within and upper >= MARGIN and lower <= height - 1 - MARGIN
    return _WITHIN if within and lower - upper < TALLEST else _AT_BORDER


@uncounted_inlined
def _place_axis(
    nodes: np.ndarray, k: int, cell: tuple[int, int], axis: int, step: int, places: np.ndarray
) -> tuple[float, float]:
    """Set the terms of one coordinate; return its smallest and largest value, NaN if unknown."""
    i, j = cell
    a, b = nodes[k, j, i, axis], nodes[k, j + 1, i, axis]
    c, d = nodes[k, j, i + 1, axis], nodes[k, j + 1, i + 1, axis]
    if np.isnan(a + b + c + d):
        return np.nan, np.nan
    share = 1 / step
    places[k, axis] = a
    places[k, 2 + axis] = (b - a) * share
    places[k, 4 + axis] = (c - a) * share
    places[k, 6 + axis] = ((d - c) - (b - a)) * (share * share)
    return min(a, b, c, d), max(a, b, c, d)


@uncounted_inlined
def _weigh(sizes: np.ndarray, recipe: Recipe, work: Work) -> int:
    """Set the heads' weights at each pixel of a cell; return the only head with weight, or -1.

    A head without weight at any pixel is marked as unseen.
    """
    n = recipe.step * recipe.step
    feather = np.float32(recipe.feather)
    best, norm, kinds, weights = work.best, work.norm, work.kinds, work.weights
    best[:] = 0
    for k in range(len(kinds)):
        if kinds[k] != _UNSEEN:
            _set_depths(sizes, k, recipe.step, work)
    for k in range(len(kinds)):
        if kinds[k] != _UNSEEN:
            for p in range(n):
                d = weights[k, p]
                if feather > 0:
                    w = max(np.float32(0), min(d, d - best[p] + feather))
                else:
                    # of several heads with the same distance, the first
                    first = d == best[p] and d > 0 and norm[p] == 0
                    w = np.float32(1) if first else np.float32(0)
                weights[k, p] = w
                norm[p] += w
    only, n_used = -1, 0
    for k in range(len(kinds)):
        if kinds[k] != _UNSEEN:
            some, everywhere = _normalise(weights, k, norm)
            n_used += some
            kinds[k] = kinds[k] if some else _UNSEEN
            only = k if everywhere else only
    return only if n_used == 1 else -1


@uncounted_inlined
def _set_depths(sizes: np.ndarray, k: int, step: int, work: Work) -> None:
    """Set the distances of a cell's pixels from a head's border, px; update the largest ones."""
    places, depths, best = work.places, work.weights, work.best
    right, bottom = np.float32(sizes[k, 0] - 0.5), np.float32(sizes[k, 1] - 0.5)
    half = np.float32(0.5)
    for i in range(step):
        x_0, dx = places[k, 0] + i * places[k, 4], places[k, 2] + i * places[k, 6]
        y_0, dy = places[k, 1] + i * places[k, 5], places[k, 3] + i * places[k, 7]
        start, growth = (np.float32(x_0), np.float32(y_0)), (np.float32(dx), np.float32(dy))
        for j in range(step):
            x, y = start[0] + np.float32(j) * growth[0], start[1] + np.float32(j) * growth[1]
            d = min(x + half, right - x, y + half, bottom - y)
            depths[k, i * step + j] = d
            best[i * step + j] = max(best[i * step + j], d)


@uncounted_inlined
def _normalise(weights: np.ndarray, k: int, norm: np.ndarray) -> tuple[int, int]:
    """Divide weights by their sum; return whether one is positive, and whether all are 1."""
    n_some, n_alone = 0, 0
    for p in range(len(norm)):
        w = weights[k, p]
        alone = w == norm[p] and w > 0
        n_some += w > 0
        n_alone += alone
        weights[k, p] = np.float32(1) if alone else w / max(norm[p], np.float32(1e-30))
    return int(n_some > 0), int(n_alone == len(norm))


# --- requests for memory before it is needed -------------------------------------------------


@_emitted
def _ask_to_read(_typing: Any, address: Any) -> Any:
    """Ask the processor to load memory that will be read: ``_ask_to_read(address)``."""
    return types.void(address), lambda *given: _ask(given[0], given[1], given[3][0], 0)


@_emitted
def _ask_to_write(_typing: Any, address: Any) -> Any:
    """Ask the processor to load memory that will be written: ``_ask_to_write(address)``."""
    return types.void(address), lambda *given: _ask(given[0], given[1], given[3][0], 1)


def _ask(context: Any, builder: ir.IRBuilder, address: Any, write: int) -> Any:
    pointer = ir.IntType(8).as_pointer()
    kind = ir.FunctionType(ir.VoidType(), [pointer, _INT, _INT, _INT])
    ask = _EMIT.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
    how = [ir.Constant(_INT, number) for number in (write, 3, 1)]  # 3: nearest cache, 1: data
    builder.call(ask, [builder.inttoptr(address, pointer), *how])
    return context.get_dummy_value()


# --- Means of small patches of an image, and what of them is saturated, compiled


@compiled
def patch_means(image: Array, at: Array, mean: Array, peak: Array, often: Index) -> None:
    """Fill in the means of bilinear samples, and the largest of the pixels that they are made of.

    Count how often the pixel right of and below each sample has each value: enough pixels to tell
    how frequent a value is.

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
    at : ndarray, shape (n, samples, 2)
        col, row of the samples of each patch; they have pixels on all sides.
    mean : ndarray, shape (n, bands)
    peak : ndarray of the image's type, shape (n, bands)
    often : ndarray of int64, shape (bands, values)
        To be added to.
    """
    n, samples = at.shape[:2]
    bands = image.shape[2]
    total = np.empty(bands)
    for p in range(n):
        total[:] = 0.0
        peak[p] = 0
        for s in range(samples):
            col, row = int(at[p, s, 0]), int(at[p, s, 1])
            x, y = np.float32(at[p, s, 0] - col), np.float32(at[p, s, 1] - row)
            for k in range(4):
                down, across = k // 2, k % 2
                weight = abs(np.float32(1 - across) - x) * abs(np.float32(1 - down) - y)
                for band in range(bands):
                    value = image[row + down, col + across, band]
                    total[band] += np.float64(value) * np.float64(weight)
                    peak[p, band] = max(peak[p, band], value)
                    if k == 3:
                        often[band, value] += 1
        for band in range(bands):
            mean[p, band] = total[band] / samples


# --- Images sampled at the positions of maps and blended, in compiled code
#
# The cells of the maps' grid are made one by one. If only one head has weight in a cell, its
# samples are equalised and written. Otherwise the heads' samples are equalised, weighted and added
# first. This module knows neither cameras nor files.


LINE = 64  # bytes that the processor loads from memory at a time


@uncounted
def resample_cells(heads: Heads, recipe: Recipe, window: Window, work: Work) -> None:
    """Make a part of an image.

    Cells are processed downwards. The heads are usually mounted crosswise, so this reads along
    the rows of their images, and the pixels of one cell are still in the cache for the next.
    """
    step = recipe.step
    n_heads = len(heads.addresses)
    for j in range(window.cells):
        for i in range(window.rows[0] // step, (window.rows[1] + step - 1) // step):
            only = _find_heads(heads, recipe, i, j, work)
            if only < 0:
                work.total[:] = 0
            for k in range(n_heads):
                if work.kinds[k] == _UNSEEN:
                    continue
                _ask_ahead(heads, recipe, k, i + 1, j)
                _sample_cell(heads, recipe, k, work)
                _set_factors(heads.factors, k, recipe, i, j, work)
                if only < 0:
                    _add_weighted(k, recipe, work)
            if only < 0 and recipe.out_bits == 32:
                _mark_unseen(recipe, work)
            if only < 0:
                _write_cell(recipe, window, i, j, work.total, work.unity, work.line)
            else:
                _write_cell(recipe, window, i, j, work.block, work.factors, work.line)


# --- samples -------------------------------------------------------------------------------------


@uncounted_inlined
def _sample_cell(heads: Heads, recipe: Recipe, k: int, work: Work) -> None:
    """Sample an image at the pixels of a cell, in lines along the rows of the image."""
    step, bands = recipe.step, recipe.bands
    place = _place(work.places, k)
    turned = abs(place[3]) > abs(place[5])  # right in the cell is down in the image
    a, b = (2, 4) if turned else (4, 2)
    at_line, at_sample = (bands, work.line) if turned else (work.line, bands)
    pixel = bands * recipe.bits // 8
    row = heads.sizes[k, 0] * pixel
    # positions count from a pixel left of and above all others: single precision is then enough
    col_0, row_0 = _before(place, 0, step), _before(place, 1, step)
    for m in range(step):
        start = (
            np.float32(place[0] - col_0 + m * place[a]),
            np.float32(place[1] - row_0 + m * place[a + 1]),
        )
        growth = np.float32(place[b] + m * place[6]), np.float32(place[b + 1] + m * place[7])
        if work.kinds[k] == _WITHIN:
            image = heads.addresses[k] + row_0 * row + col_0 * pixel, row, pixel
            out = work.block, m * at_line, at_sample
            _sample_line(recipe.method, step, image, start, growth, work.scratch, out)
        else:
            for p in range(step):
                x = start[0] + np.float32(p) * growth[0]
                y = start[1] + np.float32(p) * growth[1]
                out_at = m * at_line + p * at_sample
                _sample_at_border(heads, recipe, k, (col_0, row_0), (x, y), (work.block, out_at))


@uncounted_inlined
def _place(places: np.ndarray, k: int) -> Any:
    return (
        places[k, 0],
        places[k, 1],
        places[k, 2],
        places[k, 3],
        places[k, 4],
        places[k, 5],
        places[k, 6],
        places[k, 7],
    )


@uncounted_inlined
def _before(place: Any, axis: int, step: int) -> int:
    """Return a column or row that lies at least one before all pixels of a cell."""
    n = step - 1
    a, b = place[axis], place[axis] + n * place[2 + axis]
    down = n * place[4 + axis]
    c, d = a + down, b + down + n * n * place[6 + axis]
    return int(min(a, b, c, d)) - 1


@uncounted
def _sample_at_border(
    heads: Heads, recipe: Recipe, k: int, before: Any, way: Any, out: Any
) -> None:
    """Sample an image as if its outermost pixels were repeated without end."""
    width, height = heads.sizes[k, 0], heads.sizes[k, 1]
    x = min(max(way[0], np.float32(-before[0])), np.float32(width - 1 - before[0]))
    y = min(max(way[1], np.float32(-before[1])), np.float32(height - 1 - before[1]))
    col, row = int(x), int(y)
    size = recipe.bits // 8
    for band in range(recipe.bands):
        total = 0.0
        for r in range(-1, 3):
            for c in range(-1, 3):
                i = min(max(before[1] + row + r, 0), height - 1)
                j = min(max(before[0] + col + c, 0), width - 1)
                at = heads.addresses[k] + ((i * width + j) * recipe.bands + band) * size
                weight = _weight(recipe.cubic, y - row - r) * _weight(recipe.cubic, x - col - c)
                total += weight * _read_number(recipe.bits, at)
        out[0][out[1] + band] = total


@uncounted_inlined
def _weight(cubic: bool, way: float) -> float:
    """Return the weight of a pixel at a distance, px: linear, or Catmull and Rom's cubic."""
    d = abs(way)
    if not cubic:
        return max(1 - d, 0.0)
    if d < 1:
        return 1 + d * d * (1.5 * d - 2.5)
    return 2 + d * (-4 + d * (2.5 - 0.5 * d)) if d < 2 else 0.0


# --- equalised, weighted, written ----------------------------------------------------------------


@uncounted_inlined
def _set_factors(nodes: np.ndarray, k: int, recipe: Recipe, i: int, j: int, work: Work) -> None:
    """Set the factors of a cell's first row, and their increase from row to row."""
    if nodes.shape[1] == 0:
        return
    first, growth = work.factors
    share = np.float32(1) / np.float32(recipe.step)
    for b in range(recipe.bands):
        upper, lower = nodes[k, j, i, b], nodes[k, j, i + 1, b]
        upper_step = (nodes[k, j + 1, i, b] - upper) * share
        lower_step = (nodes[k, j + 1, i + 1, b] - lower) * share
        slope, slope_step = (lower - upper) * share, (lower_step - upper_step) * share
        for c in range(recipe.step):
            first[c * recipe.bands + b] = upper + np.float32(c) * upper_step
            growth[c * recipe.bands + b] = slope + np.float32(c) * slope_step


@uncounted_inlined
def _saturation(recipe: Recipe) -> tuple[np.float32, np.float32]:
    """Return the largest value, and what to subtract from samples times `SHOULDER`."""
    top = np.float32(2**recipe.bits - 1)
    return top, np.float32(SHOULDER - 1) * top


@uncounted_inlined
def _add_weighted(k: int, recipe: Recipe, work: Work) -> None:
    """Add the samples of a head, each times its factor and its weight."""
    step, bands = recipe.step, recipe.bands
    factors = work.factors[0], work.factors[1], _saturation(recipe)
    for r in range(step):
        for c in range(step):
            for b in range(bands):
                work.spread[c * bands + b] = work.weights[k, r * step + c]
        at = r * work.line
        line, total = (work.block, at), (work.total, at)
        _add_line(step * bands, line, factors, np.float32(r), work.spread, total)


@uncounted_inlined
def _mark_unseen(recipe: Recipe, work: Work) -> None:
    step, bands = recipe.step, recipe.bands
    for p in range(step * step):
        if work.norm[p] == 0:
            at = p // step * work.line + p % step * bands
            work.total[at : at + bands] = np.nan


@uncounted_inlined
def _write_cell(
    recipe: Recipe, window: Window, i: int, j: int, block: np.ndarray, factors: Any, line: int
) -> None:
    """Write the part of a cell that lies in the window."""
    step = recipe.step
    given = factors[0], factors[1], _saturation(recipe)
    col = (window.left + j) * step
    n = min(step, window.width - col) * recipe.bands
    size = recipe.out_bits // 8 * recipe.bands
    first, end = window.rows
    for r in range(max(first, i * step), min(end, (i + 1) * step)):
        to = window.address + ((r - first) * window.width + col) * size
        m = r - i * step
        _write_line(recipe.out_bits, n, (block, m * line), given, np.float32(m), to)
        _ask_to_write(to + step * window.width * size)  # for the next cell, which lies below
        _ask_to_write(to + step * window.width * size + LINE)


@uncounted_inlined
def _ask_ahead(heads: Heads, recipe: Recipe, k: int, i: int, j: int) -> None:
    """Ask for the pixels of an image that a cell reads, as the processor cannot predict them."""
    nodes = heads.nodes
    if i + 1 >= nodes.shape[2]:
        return
    a, b = nodes[k, j, i, 0], nodes[k, j, i, 1]
    c, d = nodes[k, j + 1, i + 1, 0], nodes[k, j + 1, i + 1, 1]
    x_0, x_1, y_0, y_1 = min(a, c), max(a, c), min(b, d), max(b, d)
    few = 4 * recipe.step
    if not (x_0 >= 0 and y_0 >= 0 and x_1 < x_0 + few and y_1 < y_0 + few):
        return
    pixel = recipe.bands * recipe.bits // 8
    row = heads.sizes[k, 0] * pixel
    for r in range(int(y_0), int(y_1) + 2):
        at = heads.addresses[k] + r * row + int(x_0) * pixel
        end = heads.addresses[k] + r * row + (int(x_1) + 2) * pixel
        while at < end:
            _ask_to_read(at)
            at += LINE
        _ask_to_read(end)
