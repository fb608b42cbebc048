"""A diagnosis as report.json, ten lines, one HTML page and one picture."""
