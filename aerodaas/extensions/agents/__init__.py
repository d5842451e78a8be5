"""Agents: programs that propose missions over the Model Context Protocol, and never fly."""
