"""The page a reader opens first: verdicts, figures, tables, ledger, and the gauge explorer, in one file.

``d3.min.js`` is D3 7.9.0 (scales, axes, dragging) as its npm package has it; its licence, ISC, is
``d3.LICENSE``. It is kept here because no Python package brings it, and a build fetches nothing.
"""
