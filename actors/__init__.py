"""The actors: the only code of the project that imports ray."""
