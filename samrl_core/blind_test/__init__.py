"""Sealed worlds: recordings of arms with hidden disturbances, for blind tests of a gap diagnosis.

Imports nothing of the diagnosis. `plan_worlds` lists the worlds, `make_world` makes one, `forge` all, sealed.
"""
