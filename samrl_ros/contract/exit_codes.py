"""Exit codes of every command (contract: 2 wrong usage, 3 input refused, 130 interrupted)."""

OK = 0
FAILED = 1  # the run could not go on: a node died, a fault, a stall
USAGE = 2
INPUT_REFUSED = 3
GAP_FOUND = 4  # `samrl diagnose --fail-on-gap` found one
INTERRUPTED = 130  # by Ctrl-C, SIGTERM or a closed terminal; a node that was asked to stop ends with OK
