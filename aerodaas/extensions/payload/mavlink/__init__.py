"""Gimbals and cameras of a MAVLink vehicle: found, commanded and watched."""
