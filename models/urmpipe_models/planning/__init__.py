"""Planned paths: lines and arcs from rows of points, and the law by which time runs along them."""
