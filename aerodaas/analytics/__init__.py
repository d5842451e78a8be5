"""Analyses that ship with the project, and the base classes for user-defined ones.

`__init__.pyi` beside this file lists the names; each is loaded on first use, because
onnxruntime and OpenCV are slow to import.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
