"""The artifact: every table and figure of Zhang, Gallego and Scaramuzza (RA-L 2018)."""
