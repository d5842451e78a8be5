"""Applications in a notebook: streams and recordings as tables, pictures with what was found.

Needs pandas for tables: `pip install 'aerodaas[notebook]'`.
"""

import lazy_loader

# Every command imports this package for its `extension.py`; what it offers is imported when asked.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
