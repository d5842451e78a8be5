"""Sheets of the gallery: each picture in its place, whole."""

from __future__ import annotations

import numpy as np

from aerodaas.extensions.notebook import Pictures
from aerodaas.extensions.notebook.pictures import Picture
from tools.gallery import sheet


def test_a_sheet_holds_every_picture() -> None:
    """Three to a row, in order, white where there is none."""
    grey = [Picture(np.full((90, 160, 3), 50 * one, np.uint8), str(one)) for one in range(4)]
    page = sheet(Pictures(grey))
    assert page.shape == (2 * 180 + 6, 3 * 320 + 2 * 6, 3)
    middles = [page[90, 160], page[90, 486], page[90, 812], page[276, 160]]
    assert [int(one[0]) for one in middles] == [0, 50, 100, 150]
    assert (page[276, 486:] == 255).all()
    assert (page[:, 320:326] == 255).all()
