"""A recording as files that other programs open: tables, videos, tracks."""
