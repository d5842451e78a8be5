"""Export of recordings to common file formats: tables, videos, GPS tracks."""
