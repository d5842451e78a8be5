"""Dispatch of analyses by an analytics scheduler, and what it estimates from."""
