"""What a sweep says when it cannot go on."""

from __future__ import annotations


class SweepError(ValueError):
    """The sweep cannot begin or go on; the message says where, why, and what to change."""
