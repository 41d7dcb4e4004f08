"""What pieces and board look like in this very frame, learnt from it: how much rather a pixel belongs to a piece.

Colours are counted in bins, once for each side's pieces and once for each kind of ground. Light, shadows and exposure
are in the counts, so nothing has to be known of them beforehand.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from vision.arrays import Field, Picture, Whole

_BITS: Final = 5
_BINS: Final = 1 << _BITS
_BLUR: Final = 1.2
"""Of the counts, along each channel [bins]: neighbouring colours tell about each other."""
_PRIOR: Final = 2e-6  # share of pixels that any bin has to begin with: colours that were never seen decide nothing
_OTHERS: Final = 0.1  # chance that a pixel that is not the piece's belongs to one of the other side
MOST: Final = 2.5  # one pixel decides at most so much (natural logarithm of the ratio)


def colour_bins(colour: Picture) -> Whole:
    """Bin of each pixel of a picture (h, w, 3)."""
    shifted = (colour >> (8 - _BITS)).astype(np.int32)
    return (shifted[..., 0] << (2 * _BITS)) | (shifted[..., 1] << _BITS) | shifted[..., 2]


def shares(bins: Whole) -> Field:
    """Share of each bin among pixels, smoothed, shape (bins³,)."""
    counts = np.bincount(bins.ravel(), minlength=_BINS**3).astype(np.float32).reshape(_BINS, _BINS, _BINS)
    smooth = cv2.GaussianBlur(counts, (0, 0), _BLUR, borderType=cv2.BORDER_REPLICATE)  # along the first two channels
    smooth = cv2.GaussianBlur(
        np.asarray(smooth).reshape(_BINS * _BINS, _BINS), (0, 0), sigmaX=_BLUR, sigmaY=1e-6,
        borderType=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    flat = np.asarray(smooth, dtype=np.float32).ravel()
    return np.asarray(flat / max(float(flat.sum()), 1.0) + np.float32(_PRIOR), dtype=np.float32)


def evidence(piece: Field, others: Field, grounds: list[Field]) -> Field:
    """How much rather a colour is a piece's than the ground's or, here and there, one of the other side's pieces, by
    ground and bin: shape (grounds × bins³,).
    """
    instead = (1.0 - _OTHERS) * np.stack(grounds) + _OTHERS * others[None, :]
    ratio = np.log(piece)[None, :] - np.log(instead)
    return np.asarray(np.clip(ratio, -MOST, MOST).astype(np.float32).ravel())


def looked_up(table: Field, ground: Whole, bins: Whole) -> Field:
    """The evidence at each pixel."""
    return table.take(ground * _BINS**3 + bins)
