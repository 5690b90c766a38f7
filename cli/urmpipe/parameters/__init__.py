"""Every parameter, declared once: an option, a keyword of Python, and a key of urmpipe.toml.

1. param: `Kind` (one reader of values for all three), `Param` (its place in a command), reading of many.
2. kinds: the kinds of values. completion: what a shell offers for them.
3. shared: the arm, the reading of tables and logs, what a command prints.
4. comparing, motions, systems, outputs: the parameters of each command, as typed dictionaries.
"""
