"""The report of a game as a page: one file that can be read anywhere, without a network and without scripts."""

from __future__ import annotations

from app.report.page import REPORT_PAGE, report_page, write_report_pages

__all__ = ["REPORT_PAGE", "report_page", "write_report_pages"]
