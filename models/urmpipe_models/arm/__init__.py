"""Arms.

The chapters, each over those above it:

    chain                frames and joints, with parameters, masses, shapes and drives
    denavit_hartenberg   standard and modified parameters, R and T joints, the 6R arm, URM modules
    solids               shapes for arms that have none
"""
