"""Maps, waterfalls and landing studies as commands: which runs a sweep makes, and what is drawn of its rows."""
