"""Commands of the command line that look at recordings, one module each."""
