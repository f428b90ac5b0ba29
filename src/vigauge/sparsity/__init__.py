"""How the motion block of H is stored, and which observations meet."""
