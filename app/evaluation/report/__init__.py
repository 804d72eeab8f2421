"""The report of an evaluation: a folder that any browser shows without network or scripts."""

from app.evaluation.report.page import write_report

__all__ = ["write_report"]
