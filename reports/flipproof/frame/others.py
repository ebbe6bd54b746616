"""Where solvers that are none of flipproof's own come from.

This floor names no module above it: ``flipproof/__init__.py``, which every process imports first, puts theirs here. It
imports nothing, so that starting stays light.
"""

OTHERS: list[str] = []
"""Names of modules with

    is_spec(name)                     whether a name is written as one of theirs; nothing is imported
    check_spec(name)                  refuse by a ValueError a spec that names nothing
    solve(scenario, *, spec, ...)     its Trajectory, computed in a process of its own
"""
