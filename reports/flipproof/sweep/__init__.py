"""Sweeps: a design over throws and solvers in, one SQLite file out, however often the program dies on the way.

A file (``design``) states which fields vary and which solvers throw each bottle. The ``loop`` hands points that have no
row in chunks to an executor, whose workers do nothing but ``work``; what comes back goes to a ``frame.store.Store`` and
can be exported (``export``). Whoever has a list of points can have them made so: maps, waterfalls and landing studies
(``flipproof.presets``) do.
"""
