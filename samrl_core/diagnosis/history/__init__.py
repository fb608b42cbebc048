"""Diagnoses of many robots on many days: parameters over time, and when they changed."""
