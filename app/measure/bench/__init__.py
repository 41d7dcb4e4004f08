"""Measurements that say whether a bar is held: ``touchmove bench NAME``. One module for each bench."""

from app.measure.bench.registry import BENCHES, UnknownBench, run_bench
from app.measure.bench.report import BenchReport, Row

__all__ = ["BENCHES", "BenchReport", "Row", "UnknownBench", "run_bench"]
