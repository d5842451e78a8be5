"""Tests of a provider's user."""
