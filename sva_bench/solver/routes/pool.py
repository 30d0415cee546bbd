"""The routes that a search met, each once, in compiled code."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def keep(order, length, vehicle_class, pool, pool_length, pool_class, size, table, keys, ordered):
    """Put a route into the pool unless it is there or the pool is full; the size of the pool."""
    if length == 0 or size == len(pool):
        return size
    code = np.uint64(vehicle_class + 1) * np.uint64(0x9E3779B97F4A7C15)
    for k in range(length):
        code += keys[order[k]] * np.uint64(k + 1) if ordered else keys[order[k]]
    code ^= code >> np.uint64(29)
    slot = np.int64(code % np.uint64(len(table)))
    while table[slot] >= 0:
        other = table[slot]
        if pool_length[other] == length and pool_class[other] == vehicle_class and \
                _same(pool[other], order, length, ordered):
            return size
        slot = (slot + 1) % len(table)
    table[slot] = size
    pool[size, :length] = order[:length]
    pool_length[size], pool_class[size] = length, vehicle_class
    return size + 1


@njit(cache=True)
def _same(one, other, length, ordered):
    if ordered:
        for k in range(length):  # noqa: SIM110 - all() takes seconds to compile
            if one[k] != other[k]:
                return False
        return True
    for k in range(length):
        there = False
        for i in range(length):
            if one[k] == other[i]:
                there = True
                break
        if not there:
            return False
    return True
