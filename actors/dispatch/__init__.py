"""Dispatcher actor, which runs an analytics scheduler, and the executors."""
