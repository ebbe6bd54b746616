"""Anybody's solver: one contract, how a solver is named, where it runs, and what it is tested for.

A foreign solver is a callable, or an object with ``solve(ask)`` and a few attributes (``contract.Traits``). It is named
by a spec, a string that travels to worker processes and is resolved there (``specs``). It runs in a process of its own
with a time limit (``isolated``), with the rights of the user who named it; nothing is imported that was not named.
"""
