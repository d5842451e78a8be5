"""Tests of the provider's service."""
