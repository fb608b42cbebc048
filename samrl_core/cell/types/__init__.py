"""Values that cross a border: frozen dataclasses of NumPy arrays, units in the field's line."""
