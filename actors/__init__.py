"""Ray actors of a run; the only package of the project that imports ray."""
