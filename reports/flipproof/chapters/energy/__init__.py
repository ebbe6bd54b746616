"""Energy: where it goes in every equation, and whether the ledger closes."""
