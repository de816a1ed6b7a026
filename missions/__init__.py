"""Mission files and mission scripts an operator starts from."""
