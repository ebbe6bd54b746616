"""Curves of any columns, with or without jumps: how far apart they are, and for how long they can be compared."""
