"""The open form of the equations of motion: Lagrange's equations of the second kind, by SymPy.

SymPy comes with the extra `planning`, and is imported where it is used. `derivation` derives the terms of the
equations, `formulas` reduces them and writes them as text and C. Nothing here uses the numeric dynamics: each
verifies the other.
"""
