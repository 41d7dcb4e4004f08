"""Statistics of features, of an episode and of all: smallest, largest, mean, standard deviation, count, quantiles.

LeRobot has only those of episodes at hand when it comes to all of them, and takes the outermost of their quantiles.
Here quantiles of all frames are those of all frames, from histograms between what is smallest and what is largest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
"""Shape (n, d)."""
FeatureStats = dict[str, Any]
"""Lists of numbers by the name of the statistic, as they are written."""

QUANTILES: Final = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
NAMES: Final = ("min", "max", "mean", "std", "count", *QUANTILES)
_BINS: Final = 5000
_LEVELS: Final = 256
_SMALL, _LARGE = 150, 300
"""Pictures of which a side is at least the second are thinned out to about the first, as LeRobot does [px]."""


def episode_stats(values: Values) -> FeatureStats:
    """Of one episode."""
    found = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
    }
    quantiles = np.quantile(values, list(QUANTILES.values()), axis=0)
    listed: FeatureStats = {name: value.tolist() for name, value in found.items()}
    listed["count"] = [len(values)]
    return listed | {name: row.tolist() for name, row in zip(QUANTILES, quantiles, strict=True)}


@dataclass(slots=True)
class RunningStats:
    """All but quantiles of a feature of d numbers, episode by episode."""

    count: int = 0
    mean: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    squares: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    """Sum of the squared distances from the mean."""
    least: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    most: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def take(self, values: Values) -> None:
        """Frames more, shape (n, d)."""
        count, mean = len(values), values.mean(axis=0)
        squares = ((values - mean) ** 2).sum(axis=0)
        if not self.count:
            self.count, self.mean, self.squares = count, mean, squares
            self.least, self.most = values.min(axis=0), values.max(axis=0)
            return
        whole, off = self.count + count, mean - self.mean
        self.squares = self.squares + squares + off**2 * self.count * count / whole
        self.mean = self.mean + off * count / whole
        self.count = whole
        self.least, self.most = np.minimum(self.least, values.min(axis=0)), np.maximum(self.most, values.max(axis=0))

    def stats(self, batches: Iterable[Values]) -> FeatureStats:
        """Of all frames, which are gone through once more for their quantiles."""
        span = np.where(self.most > self.least, self.most - self.least, 1.0)
        counts = np.zeros((len(self.mean), _BINS), dtype=np.int64)
        for values in batches:
            bins = np.minimum(((values - self.least) / span * _BINS).astype(np.int64), _BINS - 1)
            counts += np.array([np.bincount(column, minlength=_BINS) for column in bins.T])
        found = {"min": self.least, "max": self.most, "mean": self.mean, "std": np.sqrt(self.squares / self.count)}
        listed: FeatureStats = {name: value.tolist() for name, value in found.items()}
        for name, share in QUANTILES.items():
            levels = [_level(row, share) for row in counts]
            listed[name] = np.minimum(self.least + span * (np.array(levels) + 0.5) / _BINS, self.most).tolist()
        return listed | {"count": [self.count]}


class PictureStats:
    """Of pictures, each channel from 0 to 1, exactly: from how often each of its 256 levels came."""

    def __init__(self) -> None:
        self._counts = np.zeros((3, _LEVELS), dtype=np.int64)
        self._pictures = 0

    def take(self, picture: NDArray[np.uint8]) -> None:
        """One more, RGB (height, width, 3)."""
        height, width = picture.shape[:2]
        step = max(width, height) // _SMALL if max(width, height) >= _LARGE else 1
        channels = np.moveaxis(picture[::step, ::step], 2, 0)
        self._counts += np.array([np.bincount(channel.ravel(), minlength=_LEVELS) for channel in channels])
        self._pictures += 1

    def add(self, other: PictureStats) -> None:
        """Those of another episode."""
        self._counts += other._counts
        self._pictures += other._pictures

    def stats(self) -> FeatureStats:
        """Shape (3, 1, 1) each, and how many pictures there were."""
        levels = np.arange(_LEVELS) / (_LEVELS - 1)
        total = self._counts.sum(axis=1)
        mean = self._counts @ levels / total
        found = {
            "min": [levels[np.flatnonzero(row)[0]] for row in self._counts],
            "max": [levels[np.flatnonzero(row)[-1]] for row in self._counts],
            "mean": mean,
            "std": np.sqrt(np.maximum(self._counts @ levels**2 / total - mean**2, 0.0)),
            **{name: [levels[_level(row, share)] for row in self._counts] for name, share in QUANTILES.items()},
        }
        listed: FeatureStats = {name: [[[float(value)]] for value in values] for name, values in found.items()}
        return listed | {"count": [self._pictures]}


def _level(counts: NDArray[np.int64], share: float) -> int:
    """The first bin up to which there is a share of all."""
    return int(np.searchsorted(np.cumsum(counts), share * counts.sum()))
