"""Analyses that ship with the project, and the base for one's own.

`__init__.pyi` beside this file lists the names; each is loaded when it is first used, for
onnxruntime and OpenCV take their time.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
