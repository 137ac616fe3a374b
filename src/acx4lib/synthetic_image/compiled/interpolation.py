"""Pixels interpolated and written, all bands of a pixel at once, for compiled code.

The compiler does not make these instructions by itself. A pixel and its right neighbour are
neighbours in memory, with all their bands. One instruction loads or computes both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

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
    """Return the number that tells `sample_line` the bits, the bands and the interpolation."""
    return _METHODS.index((bits, bands, 4 if cubic else 2))


@_emitted
def sample_line(
    _typing: Any,
    method: Any,
    n: Any,  # noqa: ARG001
    image: Any,
    start: Any,
    growth: Any,
    scratch: Any,
    out: Any,
) -> Any:
    """Read n samples: ``sample_line(method, n, image, start, growth, scratch, out)``.

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
def read_number(_typing: Any, bits: Any, address: Any) -> Any:
    """Return a number of an image as a float: ``read_number(bits, address)``."""

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
def write_line(
    _typing: Any,
    bits: Any,
    n: Any,  # noqa: ARG001
    line: Any,
    factors: Any,
    height: Any,  # noqa: ARG001
    address: Any,
) -> Any:
    """Write n numbers to an image: ``write_line(bits, n, line, factors, height, address)``.

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
def add_line(
    _typing: Any,
    n: Any,  # noqa: ARG001
    line: Any,
    factors: Any,
    height: Any,  # noqa: ARG001
    weights: Any,
    total: Any,
) -> Any:
    """Add n weighted numbers: ``add_line(n, line, factors, height, weights, total)``.

    `line`, `factors` and `height` are those of `write_line`. `weights` is an array, `total` an
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
