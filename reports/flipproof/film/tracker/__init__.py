"""For one's own videos: exports of the Tracker video tool, read, checked and turned into theta and omega."""
