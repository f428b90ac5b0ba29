"""Rows of lanes, transposed in memory by instructions that the compiler does not find.

A loop that stores six rows of sixteen lanes lane by lane becomes 96 single stores, which take three times as
long as the shuffles and stores of vectors here.
"""

from __future__ import annotations

from typing import Any

import numba
import numba.extending
from llvmlite import ir

from .lanes import LANES


def _store_by_lanes(typing: Any, rows: Any, at: Any, out: Any, to: Any, step: Any) -> Any:
    """Six rows of sixteen lanes from ``rows[at]`` on: the six numbers of lane i to ``out[to + i step]`` on.

    ``rows`` and ``out`` are flat.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def address(array: Any, index: int) -> Any:
            made = context.make_array(signature.args[index])(context, builder, array)
            return made.data

        def shuffle(a: Any, b: Any, order: list[int]) -> Any:
            mask = ir.Constant(ir.VectorType(ir.IntType(32), len(order)), order)
            return builder.shuffle_vector(a, b, mask)

        def store(vector: Any, pointer: Any) -> None:
            builder.store(vector, builder.bitcast(pointer, vector.type.as_pointer()), align=8)

        source = builder.gep(address(arguments[0], 0), [arguments[1]])
        target = builder.gep(address(arguments[2], 2), [arguments[3]])
        size = arguments[1].type
        vector = ir.VectorType(ir.DoubleType(), 8)
        for half in range(0, LANES, 8):
            row = []
            for a in range(6):
                pointer = builder.gep(source, [size(a * LANES + half)])
                row.append(builder.load(builder.bitcast(pointer, vector.as_pointer()), align=8))
            for first in (0, 4):
                order = [index for i in range(first, first + 4) for index in (i, 8 + i)]
                x, y, z = (shuffle(row[a], row[a + 1], order) for a in (0, 2, 4))
                for i in range(4):
                    pointer = builder.gep(target, [builder.mul(arguments[4], size(half + first + i))])
                    store(shuffle(x, y, [2 * i, 2 * i + 1, 8 + 2 * i, 9 + 2 * i]), pointer)
                    store(shuffle(z, z, [2 * i, 2 * i + 1]), builder.gep(pointer, [size(4)]))
        return context.get_dummy_value()

    flat = numba.types.Array(numba.types.float64, 1, "C")
    index = numba.types.int64
    return numba.types.void(flat, index, flat, index, index), generate


store_by_lanes: Any = numba.extending.intrinsic(_store_by_lanes)
