"""Applications in a notebook: streams and recordings as tables, pictures with what was found.

Needs pandas for tables: `pip install 'aerodaas[notebook]'`.
"""

from __future__ import annotations

from aerodaas.notebook.pictures import Pictures, boxed, recorded_pictures
from aerodaas.notebook.tables import live_table, recorded_table

__all__ = ["Pictures", "boxed", "live_table", "recorded_pictures", "recorded_table"]
