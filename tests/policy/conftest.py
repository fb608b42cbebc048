"""The model of peg insertion, and one thread: small networks gain nothing from two."""

from tests.peg_model import model  # noqa: F401 (a fixture)
from tests.torch_threads import one_thread  # noqa: F401 (a fixture)
