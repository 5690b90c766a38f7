"""Arms in files, in and out.

The chapters, each over those above it:

    toml             robot files and stored robots
    urdf_tree, urdf  links and joints of a URDF, with lines; the chain between two links, mimic joints
    urdf_writer      a chain as URDF
    catalogue        the robots that are shipped, and the robot of a name or a file
"""
