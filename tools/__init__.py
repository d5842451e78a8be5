"""The workshop: what makes, tunes and tests the product, and is no part of it.

It may import all of `aerodaas`; nothing there imports it.
"""
