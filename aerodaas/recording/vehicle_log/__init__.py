"""A vehicle's own log beside the recording: reading it, laying its clock over, attaching it."""
