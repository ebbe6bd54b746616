"""The subjects of a report, a folder each."""
