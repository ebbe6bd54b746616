"""One folder for each subject of a report."""
