"""Messages to core types and back: pure functions, the only place where both are known."""
