"""The program ``flipproof``: an interrupt is one line and one exit status from its first instruction to its last.

This module imports next to nothing, so that signals are handled before anything else is loaded.
"""

from __future__ import annotations

from flipproof.cli.signals import guard


def entry() -> None:
    """Run the command line as a program."""
    guard()
    from flipproof.cli.main import entry as run

    run()
