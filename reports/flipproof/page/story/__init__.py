"""The story: the page as it opens, every number of it read from the summary."""
