"""Trains the networks that ship with the project, on rendered pictures alone.

``python -m tools.training render``, then ``detector`` and ``pose``; see `docs/models.md`.
Training needs PyTorch: ``pip install 'aerodaas[training]'``.
"""
