"""``python -m flipproof``: the command line without its script."""

from flipproof.cli.start import entry

if __name__ == "__main__":
    entry()
