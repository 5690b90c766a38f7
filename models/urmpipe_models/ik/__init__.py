"""Inverse kinematics: joint values that bring the tool of an arm to targets, or along a path.

`solve.solve` is the entry for targets, `path.solve_path` for paths. Each chapter imports only earlier ones:

    solutions        Targets, SearchOptions, Solutions: what all solvers take and return
    limits           limits of joints, and their whole turns
    trigonometric    equations in the cosine and sine of a joint angle
    loop_equations   joints 1 to 3 of an arm with a spherical wrist as two equations (Pieper)
    shoulder_elbow   their postures: right, left, elbow up, elbow down
    spherical        arms with a spherical wrist: postures x flips of the wrist
    outer_joints     joints 1 and 5 of an arm with three parallel axes (UR)
    parallel_axes    its other joints: elbow up, elbow down
    task             error of the tool and its Jacobian, for many rows
    numeric          iterative solution from one start: `refine`; least motion of redundant arms
    closed           which arm has a closed form, exactly or nearly
    restarts         iterative solution from several starts
    solve            the entry for targets
    path_numeric     least motion along a path
    path             the entry for paths; branches along it, jumps, speeds
"""
