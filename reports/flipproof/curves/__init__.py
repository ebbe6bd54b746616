"""Curves in any columns, with jumps or without: how far apart they are, and until when they may be compared."""
