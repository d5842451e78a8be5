"""Live views, controls by hand and playback of missions."""
