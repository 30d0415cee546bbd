"""Where the words of marks on a map stand: beside their mark, off other marks, names and words."""

from __future__ import annotations

from collections.abc import Sequence

Box = tuple[float, float, float, float]
"""Left, top, right and bottom, in units of the picture."""
_LETTER, _LINE = 5.9, 11.0  # of the words of marks
_GAPS = (2.0, 9.0)
_AROUND = ((0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
_ASIDE = 0.15  # what a later place in the order costs, against units of area that overlap


def place_words(marks: Sequence[tuple[float, float, float]], words: Sequence[str], taken: Sequence[Box], frame: Box
                ) -> list[tuple[float, float]]:
    """The middle of each mark's word: above it if there is room, else where it hides least.

    Args:
        marks: Centre and radius of each mark.
        words: What each says; an empty word takes no room.
        taken: What is there already.
        frame: What words should stay inside.
    """
    hidden = [*taken, *((x - r, y - r, x + r, y + r) for x, y, r in marks)]
    found = []
    for (x, y, radius), word in zip(marks, words, strict=True):
        half, tall = _LETTER * len(word) / 2, _LINE / 2
        places = [(x + dx * (radius + gap + half), y + dy * (radius + gap + tall)) for gap in _GAPS
                  for dx, dy in _AROUND]
        boxes = [(px - half, py - tall, px + half, py + tall) for px, py in places]
        costs = [sum(_overlap(box, other) for other in hidden) + 4 * _outside(box, frame) + _ASIDE * number
                 for number, box in enumerate(boxes)]
        best = costs.index(min(costs))
        found.append(places[best])
        if word:
            hidden.append(boxes[best])
    return found


def _overlap(a: Box, b: Box) -> float:
    return max(min(a[2], b[2]) - max(a[0], b[0]), 0.0) * max(min(a[3], b[3]) - max(a[1], b[1]), 0.0)


def _outside(box: Box, frame: Box) -> float:
    return (box[2] - box[0]) * (box[3] - box[1]) - _overlap(box, frame)
