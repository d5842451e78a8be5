"""The training itself needs PyTorch, which flying does not: without it, its tests do not exist."""

from __future__ import annotations

import importlib.util

collect_ignore = [] if importlib.util.find_spec("torch") else ["test_training_run.py"]
