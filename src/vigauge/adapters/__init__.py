"""Covariances of other libraries' estimates by those libraries' own objects, files and keys.

``gtsam`` and ``pycolmap`` need the package that they are named after, and are imported only when asked for:
``from vigauge.adapters import gtsam``. Both: ``pip install vigauge[adapters]``. The others need no package.
"""
