"""Sweeps: a design over throws and solvers in, one SQLite file out, however often the program dies on the way.

A file (``design``) states which fields vary and which solvers throw each bottle; its points are numbered. ``run`` hands
them in batches to workers, processes of this machine or of a Dask cluster, which do nothing but ``work``. What comes
back is written by this program alone (``store``) and can be exported (``command``).

A study that plans its runs can have them made so (``planned``): the map of validity and the waterfall do.
"""
