"""Worlds of servo machines: sealed worlds of one to three axes with an engine of their own.

No robot library takes part: each mechanism's equations of motion are written out by hand (`mechanisms`),
integrated in plain numpy (`engine`) under position servos, voltage, current and velocity drives and
steppers (`drives`), and logged as a user would log them, with a URDF and an import mapping (`world`).
Nothing of the diagnosis was read for them, and nothing of it is imported; the kinds of controller are those
of the interface that both sides were given.
"""
