"""The report: one HTML file that a person reads in a minute and can keep, send and print.

Data goes one way: presentations -> `summary` (banner, cards, results side by side), `tables` (cells and
facts), `figures` and `space` (for plotly.js as plain dicts, built on `spec` and `traces`) -> `page` (what
stands where) -> `render` (assets/template.html.jinja).
"""

from urmpipe_pipeline.report.render import Written, render_report, write_report

__all__ = ["Written", "render_report", "write_report"]
