"""Files of the user: locks, private ones, and folders."""
