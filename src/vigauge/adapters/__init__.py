"""Covariances of other libraries' estimates by those libraries' own objects and keys.

Each module needs the package that it is named after, and is imported only when asked for:
``from vigauge.adapters import gtsam``. All of them: ``pip install vigauge[adapters]``.
"""
