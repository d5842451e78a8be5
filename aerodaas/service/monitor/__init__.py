"""The monitor: holds the connection to each vehicle between missions, and only reads."""
