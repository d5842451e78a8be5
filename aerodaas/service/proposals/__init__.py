"""Proposals: missions that agents propose, and people approve before they fly."""
