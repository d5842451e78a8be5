"""Other aircraft around a drone, as its vehicle hears them (ADS-B), and what they demand."""
