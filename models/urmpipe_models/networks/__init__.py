"""Kinematic networks: bodies, joints, constraint elements and controls, with loops.

The chapters, each over those above it:

    parts            bodies, joints, elements, controls, and the expressions that drive them
    file_values, elements, file   TOML files: values; Denavit-Hartenberg elements, robots, gears; networks
    faults           validation of parts
    joint_motion     motion of joints and measures of elements, elementwise
    mechanism        loops cut; variables; poses of bodies
    closure          equations of loops and elements, and configurations that satisfy them
    assembly         configurations in which a network closes
    mobility         degrees of freedom, redundant constraints, idle spins
    continuation     motion along its drives on one branch: where it turns back or branches
    row_motion       motion along the rows of a log
    driving          the entry for motions: drives by name
    rates, forces    velocities and accelerations; static forces
    tables           a network as tables, the inverse of a file
"""
