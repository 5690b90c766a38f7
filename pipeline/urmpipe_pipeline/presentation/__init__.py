"""What a result shows of itself: values with units and limits, no texts of numbers, no place to draw.

A presenter, one a kind of result, makes a `Presentation`; recording, report, terminal, notebook and
JUnit render it and know no kind.
"""
