"""The paper's figures and some of our own, each computed anew: ``touchmove figures NAME``; a module for each."""

from app.measure.figures.registry import FIGURES, UnknownFigure, make_figure
from app.measure.figures.result import Bar, FigureResult, FolderUnusable

__all__ = ["FIGURES", "Bar", "FigureResult", "FolderUnusable", "UnknownFigure", "make_figure"]
