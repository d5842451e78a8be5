"""Surveys that photograph an area for a map, planned for one of a drone's cameras."""
