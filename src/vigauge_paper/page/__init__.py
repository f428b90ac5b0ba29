"""The page a reader opens first: verdicts, figures, tables, ledger, and the gauge explorer, in one file."""
