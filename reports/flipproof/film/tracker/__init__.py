"""A bench for one's own videos: what the Tracker video tool exports, read, judged and turned into theta and omega."""
