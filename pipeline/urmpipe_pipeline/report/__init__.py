"""The report: one HTML file that a person reads in a minute and can keep, send and print.

Data goes one way: results -> `tables`, `figures`, `paths` (plain dicts for plotly.js, built on `spec`
and `decimate`), `banner` -> `page` -> assets/template.html.jinja.
"""

from urmpipe_pipeline.report.page import render_report, write_report

__all__ = ["render_report", "write_report"]
