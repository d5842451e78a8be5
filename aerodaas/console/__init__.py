"""The console: one web page from which flights are watched and commanded."""
