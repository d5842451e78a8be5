"""Golden flights: what flies today, to the last digit, as the judge of a change that means none."""
