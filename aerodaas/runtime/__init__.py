"""The graph of a run as nodes, and the executor that steps them in one process, without Ray."""
