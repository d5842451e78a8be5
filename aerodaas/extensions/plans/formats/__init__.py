"""Files that plans and areas are read from and written to."""
