"""Logs of other tools (CSV, NPZ, MAT) to bags, by a YAML mapping alone. See msgs_docs/guide/import.md."""
