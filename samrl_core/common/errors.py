"""One family of exceptions: every refusal that a user can cause or mend derives from `SamrlError`."""


class SamrlError(Exception):
    """Base class. The message names the value, the limit and the remedy."""


class InputError(SamrlError):
    """Something handed in is wrong: a name, a path, a shape, a number that is not finite."""


class LimitError(SamrlError):
    """A value lies outside a stated limit of the robot, the task or the camera."""


class ReachError(SamrlError):
    """A pose cannot be reached by the arm within its joint limits."""


class SolveError(SamrlError):
    """An iteration did not reach its solution; the message says what is left and what would help."""
