"""The open form of the equations of motion: Lagrange's equations of the second kind, by SymPy.

SymPy comes with the extra `planning`, and is imported where it is used.

    angles -> variables -> bodies -> energies -> equations -> open_form -> text | c_code

Nothing here uses the numeric dynamics: either proves the other.
"""
