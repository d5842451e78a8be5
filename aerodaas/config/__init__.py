"""The environment file as a typed model, settings laid over it, run options, and plug-ins by name.

It may import `types`.
"""
