"""Mission documents without flying: their JSON schema and their check.

It imports analyses and the safety rules of missions; the service, the environment and the command
line import it.
"""
