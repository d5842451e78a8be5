"""Colours that colour-blind readers can distinguish (Okabe and Ito, 2008)."""

from __future__ import annotations

import zlib
from functools import lru_cache

__all__ = ["OKABE_ITO", "STATE_COLOURS", "label_colour", "rgb"]

OKABE_ITO = {
    "black": "#000000",
    "orange": "#E69F00",
    "sky": "#56B4E9",
    "green": "#009E73",
    "yellow": "#F0E442",
    "blue": "#0072B2",
    "vermilion": "#D55E00",
    "purple": "#CC79A7",
    "grey": "#999999",
}
"""The eight colours of https://jfly.uni-koeln.de/color/, and a neutral grey."""

STATE_COLOURS = {
    "idle": OKABE_ITO["grey"],
    "preflight": OKABE_ITO["grey"],
    "taking_off": OKABE_ITO["sky"],
    "holding": OKABE_ITO["yellow"],
    "enroute": OKABE_ITO["blue"],
    "loitering": OKABE_ITO["orange"],
    "following": OKABE_ITO["green"],
    "diverted": OKABE_ITO["vermilion"],
    "paused": OKABE_ITO["yellow"],
    "returning": OKABE_ITO["purple"],
    "landing": OKABE_ITO["sky"],
    "landed": OKABE_ITO["grey"],
    "aborted": OKABE_ITO["black"],
}
"""Colour of each mission state; states that never follow one another may share one."""

_LABELS = ("orange", "sky", "green", "yellow", "blue", "vermilion", "purple")


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue, each 0 to 1, of `#RRGGBB`."""
    red, green, blue = (int(colour[index : index + 2], 16) / 255 for index in (1, 3, 5))
    return red, green, blue


@lru_cache(maxsize=1024)
def label_colour(label: str) -> str:
    """Colour of a detection label, the same in every recording."""
    return OKABE_ITO[_LABELS[zlib.crc32(label.encode()) % len(_LABELS)]]
